"""Linearisation along a trajectory: `TimeVarying.linearize` calls it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import TimeVarying

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Step = Callable[[Array, Array], ArrayLike]

__all__ = ["linearize"]


def linearize(
    f: Step,
    x: ArrayLike,
    u: ArrayLike,
    dt_s: float,
    h: Step | None = None,
    jacobian: Callable[[Array, Array], tuple[ArrayLike, ...]] | None = None,
    step: float = 1e-6,
) -> TimeVarying:
    """Return the model of deviations from a trajectory.

    ``A[k] = df/dx``, ``B[k] = df/du``, ``C[k] = dh/dx``, ``D[k] = dh/du`` at ``x[k], u[k]``

    Parameters
    ----------
    f : callable
        Next state of a state (n_states,) and an input (n_inputs,).
    x : array_like, shape (n_samples, n_states)
        States of the trajectory.
    u : array_like, shape (n_samples,) or (n_samples, n_inputs)
        Inputs of the trajectory.
    dt_s : float
        Sample time in s.
    h : callable or None
        Output of a state and an input; None: the states.
    jacobian : callable or None
        Function that returns A, B, C and D; None for central differences.
    step : float
        Step of the differences, relative to the size of a value or 1.

    Returns
    -------
    TimeVarying
        The model; call it again with the last run's trajectory to follow a strong nonlinearity.

    Raises
    ------
    ValueError, TypeError
        If an argument has the wrong shape or kind, or a function returns another shape or a number
        that is not finite, naming the sample.
    ModelError
        If the sample time is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.linearization import linearize
    >>> model = linearize(lambda x, u: x * x + u, np.array([[1.0], [3.0]]), np.zeros(2), 0.1)
    >>> model.a.round(6).ravel().tolist()
    [2.0, 6.0]
    """
    for name, function in (("f", f), ("h", h), ("jacobian", jacobian)):
        if function is not None and not callable(function):
            message = f"{name} = {function!r}: a function is needed"
            raise TypeError(message)
    states, inputs = _rows("x", x), _rows("u", u)
    if len(states) != len(inputs):
        message = f"x has {len(states)} samples, u has {len(inputs)}; they must be as many"
        raise ValueError(message)
    if not (isinstance(step, (int, float)) and 1e-12 <= step <= 1.0):
        message = f"step = {step!r}: allowed from 1e-12 to 1"
        raise ValueError(message)
    samples = [
        _differences(f, h, *point, step, k) if jacobian is None else _given(jacobian, *point, k)
        for k, point in enumerate(zip(states, inputs, strict=True))
    ]
    a, b, c, d = (np.array(matrices) for matrices in zip(*samples, strict=True))
    return TimeVarying(a, b, c, d, dt_s)


def _differences(
    f: Step, h: Step | None, x: Array, u: Array, step: float, k: int
) -> tuple[Array, ...]:
    measured: Step = (lambda state, _: state) if h is None else h
    n_outputs = _value("h", measured, x, u, None, k).size
    point = np.concatenate((x, u))
    columns = []
    for index, value in enumerate(point):
        width = step * max(1.0, abs(float(value)))
        ends = []
        for sign in (1.0, -1.0):
            moved = point.copy()
            moved[index] += sign * width
            state, driven = moved[: len(x)], moved[len(x) :]
            ends.append(
                np.concatenate(
                    (
                        _value("f", f, state, driven, len(x), k),
                        _value("h", measured, state, driven, n_outputs, k),
                    )
                )
            )
        # Divided by the distance after rounding, not by the one asked for.
        distance = (point[index] + width) - (point[index] - width)
        columns.append((ends[0] - ends[1]) / distance)
    slope = np.array(columns).T
    n = len(x)
    return slope[:n, :n], slope[:n, n:], slope[n:, :n], slope[n:, n:]


def _given(
    jacobian: Callable[[Array, Array], tuple[ArrayLike, ...]], x: Array, u: Array, k: int
) -> tuple[Array, ...]:
    found = tuple(
        np.atleast_2d(np.asarray(part, dtype=np.float64)) for part in jacobian(x.copy(), u.copy())
    )
    if len(found) != 4:
        message = f"sample {k}: jacobian returned {len(found)} matrices; A, B, C, D are needed"
        raise ValueError(message)
    n_outputs = found[2].shape[0]
    wanted = ((len(x), len(x)), (len(x), len(u)), (n_outputs, len(x)), (n_outputs, len(u)))
    for name, matrix, shape in zip("ABCD", found, wanted, strict=True):
        if matrix.shape != shape or not np.isfinite(matrix).all():
            message = (
                f"sample {k}: jacobian returned {name} of shape {matrix.shape}; finite numbers of "
                f"shape {shape} are needed"
            )
            raise ValueError(message)
    return found


def _value(name: str, function: Step, x: Array, u: Array, size: int | None, k: int) -> Array:
    found: NDArray[Any] = np.atleast_1d(np.asarray(function(x.copy(), u.copy())))
    if (
        found.dtype.kind not in "iuf"
        or found.ndim != 1
        or (size is not None and found.size != size)
    ):
        needed = "n_outputs" if size is None else size
        message = f"sample {k}: {name} returned shape {found.shape}; ({needed},) is needed"
        raise ValueError(message)
    if not np.isfinite(found).all():
        message = f"sample {k}: {name} returned a number that is not finite"
        raise ValueError(message)
    return found.astype(np.float64)


def _rows(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        message = f"{name} has dtype {array.dtype}; numbers are needed"
        raise TypeError(message)
    rows = array.reshape(-1, 1) if array.ndim == 1 else array
    if rows.ndim != 2 or rows.size == 0 or not np.isfinite(rows).all():
        message = f"{name} has shape {array.shape}; finite numbers (n_samples, n) are needed"
        raise ValueError(message)
    return rows.astype(np.float64)
