"""Arguments that a method hands to the compiled module under their own names.

Classes over a native one import it; a plain function passes its `locals()` as they are.
"""

from __future__ import annotations

from typing import Any

NOT_ARGUMENTS = ("self", "cls", "__class__")


def given(local: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of a method from its `locals()`: all but the object or the class."""
    return {name: value for name, value in local.items() if name not in NOT_ARGUMENTS}
