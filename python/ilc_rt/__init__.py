"""The motion controller that learns: iterative learning control on the machine.

An array of the wrong shape or dtype, or with a number that is NaN or infinite, is refused under its
name everywhere, with a `ValueError` or a `TypeError`; other errors are documented where they occur.

The names are those of `ilc_rt.public`, imported at the first use of one: the program `ilc` starts
without NumPy.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ilc_rt.public import *  # noqa: F403
    from ilc_rt.public import __all__ as __all__
    from ilc_rt.public import __version__ as __version__


def __getattr__(name: str) -> Any:  # noqa: ANN401
    # A submodule is imported directly: loading `public` here would be a circular import.
    if find_spec(f"{__name__}.{name}"):
        return import_module(f"{__name__}.{name}")
    try:
        value = getattr(import_module(f"{__name__}.public"), name)
    except AttributeError:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message) from None
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *import_module(f"{__name__}.public").__all__})
