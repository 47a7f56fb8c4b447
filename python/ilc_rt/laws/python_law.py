"""Base of the laws that are written in Python: made, shown, copied and reset like the native ones.

Imported by the laws of this folder alone; a user's law needs no base.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import LearningError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


class PythonLaw:
    """A law written in Python: its arguments are its identity, and copies begin afresh."""

    def __init__(self, **arguments: Any) -> None:  # noqa: ANN401 (those of any law)
        self._arguments = arguments

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters of the law by name, as they were given."""
        return dict(self._arguments)

    def reset(self) -> None:
        """Forget everything learned from earlier runs."""

    def __repr__(self) -> str:
        """Return the call that makes the law."""
        shown = ", ".join(f"{name}={_shown(value)}" for name, value in self._arguments.items())
        return f"{type(self).__name__}({shown})"

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the call that makes it again, without what it has learned."""
        return _made, (type(self), self._arguments)


def _made(kind: type[PythonLaw], arguments: dict[str, Any]) -> PythonLaw:
    return kind(**arguments)


def _shown(value: object) -> str:
    if isinstance(value, np.ndarray):
        text = np.array2string(value, separator=", ", threshold=12, max_line_width=10_000)
        return " ".join(text.split())
    return " ".join(repr(value).split())


def signals(
    u: ArrayLike, e: ArrayLike, n_samples: int, n_inputs: int, n_outputs: int
) -> tuple[Array, Array]:
    """Return input and error of a run with a channel axis each.

    Parameters
    ----------
    u, e : array_like, shape (n_samples,) or (n_samples, n_channels)
        Input and error.
    n_samples, n_inputs, n_outputs : int
        Size that the law was made for.

    Raises
    ------
    ValueError, TypeError
        If the shape or the dtype differs, or a number is not finite.

    Examples
    --------
    >>> signals([1.0, 2.0], [0.0, 0.0], 2, 1, 1)[0].shape
    (2, 1)
    """
    found = []
    for name, given, channels in (("u", u, n_inputs), ("e", e, n_outputs)):
        array = np.asarray(given)
        if array.dtype.kind not in "iuf":
            message = f"{name} has dtype {array.dtype}; numbers are needed"
            raise TypeError(message)
        flat = array.reshape(-1, 1) if array.ndim == 1 else array
        if flat.shape != (n_samples, channels):
            message = f"{name} has shape {array.shape}; ({n_samples}, {channels}) is needed"
            raise ValueError(message)
        if not np.isfinite(flat).all():
            place = np.argwhere(~np.isfinite(flat))[0]
            message = f"{name}: sample {place[0]} is {flat[tuple(place)]}; it must be finite"
            raise ValueError(message)
        found.append(flat.astype(np.float64))
    return found[0], found[1]


def number(name: str, value: object, least: float, greatest: float = np.inf) -> float:
    """Return an argument as a number of a range, ends included.

    Raises
    ------
    LearningError, TypeError
        If it is out of range, or not a number.

    Examples
    --------
    >>> number("gain", 1, 0.0)
    1.0
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.number)):
        message = f"{name} = {value!r}: a number is needed"
        raise TypeError(message)
    if isinstance(value, np.complexfloating) or not least <= float(value) <= greatest:
        top = f" to {greatest:g}" if np.isfinite(greatest) else ""
        message = f"{name} = {value!r}: allowed from {least:g}{top}"
        raise LearningError(message)
    if not np.isfinite(float(value)):
        message = f"{name} = {value!r}: it must be finite"
        raise LearningError(message)
    return float(value)


def whole(name: str, value: object, least: int, greatest: int) -> int:
    """Return an argument as a whole number of a range, ends included.

    Raises
    ------
    LearningError, TypeError
        If it is out of range, or not a whole number.

    Examples
    --------
    >>> whole("n_samples", 3, 1, 10)
    3
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        message = f"{name} = {value!r}: a whole number from {least} to {greatest} is needed"
        raise TypeError(message)
    if not least <= int(value) <= greatest:
        message = f"{name} = {value}: a whole number from {least} to {greatest} is allowed"
        raise LearningError(message)
    return int(value)


def weight(name: str, value: ArrayLike, n_samples: int, n_channels: int) -> Array:
    """Return a diagonal weight as one number per sample and channel.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : float or array_like, shape (n_samples,) or (n_samples, n_channels)
        The weight, from 0.
    n_samples, n_channels : int
        Size.

    Raises
    ------
    LearningError, ValueError, TypeError
        If it is negative, not finite or of another shape or dtype.

    Examples
    --------
    >>> weight("q", 2.0, 2, 1)
    array([[2.],
           [2.]])
    """
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        message = f"{name} has dtype {array.dtype}; numbers are needed"
        raise TypeError(message)
    if array.shape not in {(), (n_samples,), (n_samples, n_channels)}:
        message = f"{name} has shape {array.shape}; a number or ({n_samples},) is needed"
        raise ValueError(message)
    if not np.isfinite(array).all() or (array < 0).any():
        message = f"{name}: a weight must be finite and not negative"
        raise LearningError(message)
    rows = array.reshape(-1, 1) if array.ndim == 1 else array
    return np.array(np.broadcast_to(rows, (n_samples, n_channels)), dtype=np.float64)
