"""Plants of a simulation: a function, a model, a matrix or an impulse response, under one call.

Imported by `ilc_rt.simulation` alone.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import StateSpace, TimeVarying
from ilc_rt.models import discretize

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

# Keywords that a plant written as a function may take besides the input.
OFFERED = ("trial", "disturbance", "rng")


@dataclass(frozen=True)
class Circumstances:
    """Circumstances of one run: its number, disturbance, initial state and random numbers."""

    trial: int
    disturbance: Array | None
    initial_state: ArrayLike | None
    rng: np.random.Generator


@dataclass(frozen=True)
class Plant:
    """A plant as a function of the input and the circumstances of a run.

    Attributes
    ----------
    respond : callable
        Output for an input of shape (n_samples, n_inputs), or (n_samples,) if `is_flat`.
    n_inputs, n_outputs : int or None
        Number of channels, if known beforehand.
    dt_s : float or None
        Sample time in s, if known.
    """

    respond: Callable[[Array, Circumstances], ArrayLike]
    n_inputs: int | None = None
    n_outputs: int | None = None
    dt_s: float | None = None


def plant_of(plant: object, dt_s: float | None = None) -> Plant:
    """Return anything that is accepted as a plant under one call.

    Parameters
    ----------
    plant : object
        See `ilc_rt.simulate`.
    dt_s : float or None
        Sample time in s by which a continuous-time model is discretised.

    Raises
    ------
    TypeError
        If it is not a plant.
    ModelError, ValueError
        If a model is continuous and there is no sample time, or an array has another shape.

    Examples
    --------
    >>> plant_of([0.0, 2.0]).n_inputs
    1
    """
    if isinstance(plant, TimeVarying):
        return _varying(plant)
    if isinstance(plant, StateSpace) or _is_foreign_model(plant):
        return _invariant(own_model(plant), dt_s)
    if callable(plant):
        return _function(plant)
    if isinstance(plant, (np.ndarray, list, tuple)):
        return _array(np.asarray(plant))
    message = (
        f"plant is a {type(plant).__name__}; a function u -> y, a model, a lifted matrix, an "
        "impulse response or a cell description is needed"
    )
    raise TypeError(message)


def own_model(model: Any) -> StateSpace:  # noqa: ANN401 (also of scipy.signal and python-control)
    """Return a model of scipy.signal or python-control as a `StateSpace`.

    Examples
    --------
    >>> import scipy.signal
    >>> own_model(scipy.signal.TransferFunction([1.0], [1.0, -0.5], dt=0.1)).dt_s
    0.1
    """
    if isinstance(model, StateSpace):
        return model
    n_inputs = int(getattr(model, "ninputs", 0) or getattr(model, "inputs", 0) or 1)
    nothing = np.zeros((0, 0)), np.zeros((0, n_inputs)), np.zeros((n_inputs, 0))
    dt_s = getattr(model, "dt", None)
    # The compiled module reads every kind of model; in series with 1 it stays the same.
    return StateSpace(*nothing, np.eye(n_inputs), dt_s or None).series(model)


def _is_foreign_model(plant: object) -> bool:
    return hasattr(plant, "dt") and (
        hasattr(plant, "A") or hasattr(plant, "to_ss") or hasattr(plant, "ninputs")
    )


def _invariant(model: StateSpace, dt_s: float | None) -> Plant:
    if model.dt_s is None and dt_s is not None:
        model = discretize(model, dt_s)
    if model.dt_s is None:
        message = "plant is in continuous time: give dt_s, the sample time in s"
        raise ValueError(message)
    if dt_s is not None and dt_s != model.dt_s:
        message = f"dt_s = {dt_s}, but the plant has a sample time of {model.dt_s} s"
        raise ValueError(message)
    simulate = model.simulate
    return Plant(
        lambda u, run: simulate(u, run.initial_state), model.n_inputs, model.n_outputs, model.dt_s
    )


def _varying(model: TimeVarying) -> Plant:
    simulate = model.simulate
    return Plant(
        lambda u, run: simulate(u, run.initial_state), model.n_inputs, model.n_outputs, model.dt_s
    )


def _function(function: Callable[..., ArrayLike]) -> Plant:
    try:
        names = {
            parameter.name
            for parameter in inspect.signature(function).parameters.values()
            if parameter.kind in {parameter.KEYWORD_ONLY, parameter.POSITIONAL_OR_KEYWORD}
        }
    except (TypeError, ValueError):
        # Some compiled functions have no signature.
        names = set()
    wanted = [name for name in OFFERED if name in names]

    def respond(u: Array, run: Circumstances) -> ArrayLike:
        if run.initial_state is not None:
            message = "initial_state: a function has none; let it take the keyword trial"
            raise ValueError(message)
        return function(u, **{name: getattr(run, name) for name in wanted})

    return Plant(respond)


def _array(array: NDArray[Any]) -> Plant:
    if array.dtype.kind not in "iuf" or not np.isfinite(array).all() or array.size == 0:
        message = "plant: only finite numbers are allowed in a matrix or impulse response"
        raise ValueError(message)
    numbers = array.astype(np.float64)
    if array.ndim == 2:
        return Plant(lambda u, run: _lifted(numbers, u, run))
    if array.ndim not in {1, 3}:
        message = (
            f"plant has shape {array.shape}; an impulse response (n,), Markov parameters "
            "(n, n_outputs, n_inputs) or a lifted matrix (rows, columns) is needed"
        )
        raise ValueError(message)
    markov = numbers.reshape(-1, 1, 1) if array.ndim == 1 else numbers
    return Plant(lambda u, run: _convolved(markov, u, run), markov.shape[2], markov.shape[1])


def _lifted(matrix: Array, u: Array, run: Circumstances) -> Array:
    _no_state(run)
    if matrix.shape[1] != u.size:
        message = f"plant has {matrix.shape[1]} columns, but the input has {u.size} values"
        raise ValueError(message)
    y = matrix @ u.reshape(-1)
    return y if u.ndim == 1 else y.reshape(len(u), -1)


def _convolved(markov: Array, u: Array, run: Circumstances) -> Array:
    _no_state(run)
    signals = u.reshape(len(u), -1)
    if signals.shape[1] != markov.shape[2]:
        message = f"plant has {markov.shape[2]} inputs, but the input has {signals.shape[1]}"
        raise ValueError(message)
    y = np.zeros((len(u), markov.shape[1]))
    for output in range(markov.shape[1]):
        for channel in range(markov.shape[2]):
            response = markov[: len(u), output, channel]
            y[:, output] += np.convolve(signals[:, channel], response)[: len(u)]
    return y[:, 0] if u.ndim == 1 and markov.shape[1] == 1 else y


def _no_state(run: Circumstances) -> None:
    if run.initial_state is not None:
        message = "initial_state: a matrix or impulse response has no state; give a StateSpace"
        raise ValueError(message)
