"""Argument types shared by laws, and the refusal of renamed arguments."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, ParamSpec, Protocol, TypeAlias, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt._native import Filter, StateSpace, TimeVarying, _ForeignModel

    Model: TypeAlias = StateSpace | _ForeignModel
    VaryingModel: TypeAlias = StateSpace | TimeVarying | _ForeignModel
    QFilter: TypeAlias = Filter | ArrayLike | None
    Side: TypeAlias = ArrayLike | None
    Bounds: TypeAlias = float | tuple[Side, Side] | None

P = ParamSpec("P")
T = TypeVar("T")


class AnyLaw(Protocol):
    """Any object with ``update(u, e, disturbance=None)``."""

    def update(
        self,
        u: NDArray[np.float64],
        e: NDArray[np.float64],
        disturbance: NDArray[np.float64] | None = None,
        /,
    ) -> ArrayLike:
        """Return the next input."""


def renamed(**names: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Refuse arguments under their former names.

    Parameters
    ----------
    **names : str
        New name of each old one.

    Examples
    --------
    >>> @renamed(lead="lead_samples")
    ... def law(lead_samples=1):
    ...     return lead_samples
    >>> law(lead=2)
    Traceback (most recent call last):
    TypeError: lead: is called lead_samples now
    """

    def decorate(call: Callable[P, T]) -> Callable[P, T]:
        @functools.wraps(call)
        def checked(*args: P.args, **kwargs: P.kwargs) -> T:
            for old, new in names.items():
                if old in kwargs:
                    line = f"{old}: is called {new} now"
                    raise TypeError(line)
            return call(*args, **kwargs)

        return checked

    return decorate
