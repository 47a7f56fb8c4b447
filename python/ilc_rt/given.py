"""Arguments that a method hands to the compiled module under their own names.

Classes over a native one import it; a plain function passes its `locals()` as they are.
"""

from __future__ import annotations

from typing import Any

NOT_ARGUMENTS = ("self", "cls", "__class__")


def given(local: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of a method from its `locals()`, without the object or the class."""
    for name in NOT_ARGUMENTS:
        local.pop(name, None)
    return local
