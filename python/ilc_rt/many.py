"""Learning on many linear plants at once, in compiled code on all processors."""

from __future__ import annotations

import os
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ilc_rt import _native
from ilc_rt.ask_tell import LARGEST, finite
from ilc_rt.many_result import ManyResult
from ilc_rt.plants import own_model
from ilc_rt.simulation import TRIALS_MAX
from ilc_rt.sweeping import case_seed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import AnyLaw

    Array = NDArray[np.float64]

__all__ = ["simulate_many"]

Keep = Literal["figures", "errors", "signals", "all"]

KEEP = ("figures", "errors", "signals", "all")
VALUES_MAX = 1_000_000_000
THREADS_MAX = 1024


def simulate_many(
    plants: Iterable[Any],
    law: AnyLaw | Sequence[AnyLaw] | None,
    reference: ArrayLike,
    *,
    trials: int = 10,
    noise_std: float = 0.0,
    seed: int = 0,
    threads: int | None = None,
    disturbance: ArrayLike | None = None,
    output_disturbance: Callable[[int], ArrayLike] | ArrayLike | None = None,
    initial_input: ArrayLike | None = None,
    keep: Keep = "figures",
) -> ManyResult:
    """Let a law learn on each of many linear plants.

    ``y[j] = P(u[j]) + d[j] + n[j]``, ``e[j] = r - y[j]``, ``u[j+1] = law(u[j], e[j])``

    Parameters
    ----------
    plants : iterable of StateSpace
        Discrete plants P, from rest in every run; also of scipy.signal or python-control. They may
        have different orders, but each has as many inputs and outputs as the others.
    law : Law, sequence of Law, or None
        One law for all plants, which begins afresh on each, or one for each plant. None: nothing is
        learned. Laws written in Python are for `ilc_rt.sweep`.
    reference : array_like, shape (n_samples,) or (n_samples, n_outputs)
        Reference r of all plants.
    trials : int
        Number of runs of each plant.
    noise_std : float
        Standard deviation of white noise n in the measurement, other in every run of every plant.
    seed : int
        Seed of all noise, from which that of each plant derives by its number, as in a sweep.
    threads : int or None
        Number of threads; None for one per available processor. The result is the same bit by bit.
    disturbance : array_like or None, shape (trials,) or (trials, n_disturbances)
        Measured disturbance of each run, for the law.
    output_disturbance : callable, array_like or None
        Disturbance d that is added to the output: one of the shape of the reference for all runs,
        or a function of the run's number.
    initial_input : array_like or None, shape (n_samples,) or (n_samples, n_inputs)
        Input of the first run; None for zero.
    keep : {"figures", "errors", "signals", "all"}
        Kept besides the figures of all runs: nothing, the last error of each plant, its last error
        and input, or errors and inputs of all runs.

    Returns
    -------
    ManyResult
        The figures, and what is to be kept; infinite from the run on in which a plant diverges,
        which the other plants do not notice.

    Raises
    ------
    LearningError
        If a law refuses a run for another reason than numbers that are too large, naming plant and
        trial.
    ValueError, TypeError
        If an argument has the wrong shape or kind, or a law is written in Python.

    Notes
    -----
    Every plant's inputs, errors and figures are those of `ilc_rt.simulate` with the seed that
    ``seeds`` of the result has for it, bit by bit: the sums are in the same order, and the noise is
    drawn by the same generator as NumPy's. Only what is kept, and the workspace of a few plants per
    thread, takes memory.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import NormOptimalIlc, discretize, second_order, simulate, simulate_many
    >>> plants = [discretize(second_order(w, 0.7), 0.002) for w in (80.0, 94.0, 110.0)]
    >>> law, reference = NormOptimalIlc(plants[1], 300, r=0.01), 0.01 * np.hanning(300)
    >>> found = simulate_many(plants, law, reference, trials=4, noise_std=1e-6, seed=5)
    >>> found.rms.shape, bool(found.rms[1, -1] < 0.01 * found.rms[1, 0])
    ((3, 4), True)
    >>> alone = simulate(plants[2], law, reference, trials=4, noise_std=1e-6, seed=found.seeds[2])
    >>> bool(alone.records[-1].tracking_rms_m == found.rms[2, -1])
    True
    """
    _check_numbers(trials, noise_std, seed, threads, keep)
    models = [_model(number, plant) for number, plant in enumerate(plants)]
    if not models:
        message = "plants: at least one is needed"
        raise ValueError(message)
    n_inputs, n_outputs = models[0].n_inputs, models[0].n_outputs
    r = finite("reference", reference)
    if r.reshape(len(r), -1).shape[1] != n_outputs:
        message = f"reference has shape {r.shape}; ({len(r)}, {n_outputs}) is needed"
        raise ValueError(message)
    if np.abs(r).max() > LARGEST:
        message = f"reference holds {np.abs(r).max():g}; at most {LARGEST:g} is allowed"
        raise ValueError(message)
    u = _first_input(initial_input, r, n_inputs)
    laws, law_of_plant = _laws(law, len(models))
    kept_errors, kept_inputs = {
        "figures": (0, 0), "errors": (1, 0), "signals": (1, 1), "all": (trials, trials)
    }[keep]  # fmt: skip
    n_values = len(models) * (2 * trials + kept_errors * r.size + kept_inputs * u.size)
    if n_values > VALUES_MAX:
        message = f"keep = {keep!r}: {n_values} numbers; at most {VALUES_MAX} are kept"
        raise ValueError(message)
    seeds = [case_seed(seed, number) for number in range(len(models))] if noise_std else []
    found = _native.simulate_many({
        "plants": models, "reference": r.reshape(-1), "initial_input": u.reshape(-1),
        "n_samples": len(r), "trials": trials, "laws": laws, "law_of_plant": law_of_plant,
        "noise_std": float(noise_std), "seeds": seeds,
        "threads": _available() if threads is None else threads,
        "disturbance": _measured(disturbance, trials),
        "output_disturbance": _added(output_disturbance, trials, r.shape),
        "kept_errors": kept_errors, "kept_inputs": kept_inputs,
    })  # fmt: skip
    figures = (len(models), trials)
    errors = found["errors"].reshape(len(models), kept_errors, *r.shape)
    inputs = found["inputs"].reshape(len(models), kept_inputs, *u.shape)
    return ManyResult(
        rms=found["rms"].reshape(figures),
        inf=found["inf"].reshape(figures),
        seeds=tuple(seeds) or None,
        last_error=errors[:, -1] if kept_errors else None,
        last_input=inputs[:, -1] if kept_inputs else None,
        error=errors if keep == "all" else None,
        input=inputs if keep == "all" else None,
    )


def _check_numbers(
    trials: object, noise_std: float, seed: object, threads: object, keep: object
) -> None:
    for name, value, least, greatest in (
        ("trials", trials, 1, TRIALS_MAX),
        ("seed", seed, 0, 2**128 - 1),
        ("threads", 1 if threads is None else threads, 1, THREADS_MAX),
    ):
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= greatest:
            message = f"{name} = {value!r}; a whole number from {least} to {greatest}"
            raise ValueError(message)
    if not isinstance(noise_std, Real) or not 0.0 <= noise_std < np.inf:
        message = f"noise_std = {noise_std}; a finite number from 0"
        raise ValueError(message)
    if keep not in KEEP:
        message = f"keep = {keep!r}; one of {', '.join(map(repr, KEEP))}"
        raise ValueError(message)


def _model(number: int, plant: Any) -> _native.StateSpace:  # noqa: ANN401 (any linear model)
    """Return a plant as a discrete `StateSpace`."""
    known = hasattr(plant, "dt_s") or hasattr(plant, "dt")
    if not known or isinstance(plant, _native.TimeVarying):
        message = (
            f"plants[{number}] is a {type(plant).__name__}; a StateSpace, or a discrete model of "
            "scipy.signal or python-control, is needed; ilc_rt.sweep takes every plant of simulate"
        )
        raise TypeError(message)
    model = own_model(plant)
    if model.dt_s is None:
        message = f"plants[{number}] is in continuous time: discretize it first"
        raise ValueError(message)
    return model


def _laws(law: object, n_plants: int) -> tuple[list[Any], list[int]]:
    """Return the different laws, and the index of each plant's."""
    if law is None:
        return [], []
    if not isinstance(law, (list, tuple)):
        _require_native("law", law)
        return [law], [0] * n_plants
    if len(law) != n_plants:
        message = f"law: {len(law)} laws; one, or {n_plants} as there are plants, is needed"
        raise ValueError(message)
    numbers: dict[int, int] = {}
    laws: list[Any] = []
    for place, one in enumerate(law):
        if id(one) not in numbers:
            _require_native(f"law[{place}]", one)
            numbers[id(one)] = len(laws)
            laws.append(one)
    return laws, [numbers[id(one)] for one in law]


def _require_native(name: str, law: Any) -> None:  # noqa: ANN401 (any object)
    """Refuse a law that does not run without the interpreter, also inside another one."""
    if not callable(getattr(law, "update", None)):
        message = f"{name} = {law!r}: a law of ilc_rt, a list of them, or None is needed"
        raise TypeError(message)
    if not isinstance(law, _native.Law) or type(law).update is not _native.Law.update:
        message = (
            f"{name} is a {type(law).__name__}, which is written in Python; simulate_many runs "
            "compiled laws alone: use ilc_rt.sweep with simulate for this one"
        )
        raise TypeError(message)
    given = law.parameters
    if given.get("library") is not None:
        message = f"{name} learns from a library, for each plant anew: use ilc_rt.sweep for it"
        raise TypeError(message)
    for inner in ("law", "core"):
        if inner in given:
            _require_native(f"{name}.{inner}", given[inner])


def _first_input(initial_input: ArrayLike | None, r: Array, n_inputs: int) -> Array:
    """Return the input of the first run, of the shape that `simulate` gives it."""
    if initial_input is None:
        return np.zeros(len(r) if r.ndim == 1 and n_inputs == 1 else (len(r), n_inputs))
    u = finite("initial_input", initial_input)
    if len(u) != len(r) or u.size != len(r) * n_inputs:
        message = f"initial_input has shape {u.shape}; ({len(r)}, {n_inputs}) is needed"
        raise ValueError(message)
    return u


def _measured(disturbance: ArrayLike | None, trials: int) -> list[Array]:
    if disturbance is None:
        return []
    rows = finite("disturbance", disturbance)
    if len(rows) < trials:
        message = f"disturbance has shape {rows.shape}; a row for each of {trials} runs is needed"
        raise ValueError(message)
    return [np.atleast_1d(row) for row in rows[:trials]]


def _added(
    given: Callable[[int], ArrayLike] | ArrayLike | None, trials: int, shape: tuple[int, ...]
) -> list[Array]:
    """Return the disturbance of the output, of all runs or of each, without its shape."""
    if given is None:
        return []
    each = [given(trial) for trial in range(trials)] if callable(given) else [given]
    arrays = [finite("output_disturbance", one) for one in each]
    for array in arrays:
        if array.shape != shape:
            message = f"output_disturbance has shape {array.shape}; {shape} is needed"
            raise ValueError(message)
    return [array.reshape(-1) for array in arrays]


def _available() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
