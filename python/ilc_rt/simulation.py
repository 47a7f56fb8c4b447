"""Simulation of learning: any plant, any law, from the first run to the last."""

from __future__ import annotations

import tempfile
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import Cell
from ilc_rt.ask_tell import Experiment, finite, like
from ilc_rt.campaign import Campaign
from ilc_rt.errors import BadInputError, PlantError
from ilc_rt.plants import Circumstances, Plant, plant_of
from ilc_rt.trial_result import TrialResult

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import AnyLaw

    Array = NDArray[np.float64]

__all__ = ["simulate"]

TRIALS_MAX = 50_000


def simulate(
    plant: object,
    law: AnyLaw | None = None,
    reference: ArrayLike | None = None,
    *,
    trials: int = 10,
    noise_std: float = 0.0,
    disturbance: Callable[[int], ArrayLike] | ArrayLike | None = None,
    output_disturbance: Callable[[int], ArrayLike] | ArrayLike | None = None,
    initial_state: Callable[[int], ArrayLike] | ArrayLike | None = None,
    initial_input: ArrayLike | None = None,
    library: str | PathLike[str] | None = None,
    name: str = "simulation",
    campaign: str | None = None,
    resume: bool = False,
    dt_s: float | None = None,
    unit: str = "m",
    n_inputs: int | None = None,
    seed: int = 0,
) -> TrialResult:
    """Let a law learn on a simulated plant.

    ``y[j] = P(u[j]) + d[j] + n[j]``, ``e[j] = r - y[j]``, ``u[j+1] = law(u[j], e[j])``

    Parameters
    ----------
    plant : callable, model, array_like, path or Cell
        The plant P: a function ``u -> y``; a `StateSpace`, a `TimeVarying` or a model of
        scipy.signal or python-control; a lifted matrix; an impulse response of shape (n,), or
        Markov parameters of shape (n, n_outputs, n_inputs); or a cell description, whose simulated
        drives the real controller then runs in lock-step. A function may also take the keywords
        `trial` (number of the run), `disturbance` (of the run) and `rng` (its random numbers).
    law : Law, object or None
        A law of this package or any object with ``update(u, e, disturbance=None)``. None: nothing
        is learned, or a cell's own law.
    reference : array_like or None, shape (n_samples,) or (n_samples, n_outputs)
        Reference r; a cell has its own.
    trials : int
        Number of runs, including those before a `resume`.
    noise_std : float
        Standard deviation of white noise n in the measurement, other in every run.
    disturbance : callable, array_like or None
        Measured disturbance of each run, as for a `Campaign`: one row per run, or a function of
        its number. Given to the law, and to a plant that takes it.
    output_disturbance : callable, array_like or None
        Disturbance d that is added to the output: one of the shape of the reference for all runs,
        or a function of the run's number.
    initial_state : callable, array_like or None
        State of a model at the first sample, shape (n_states,), or a function of the run's number.
    initial_input, library, name, campaign, resume, unit, n_inputs
        As for `ilc_rt.Experiment`.
    dt_s : float or None
        Sample time in s; None for that of the plant, or 1. A continuous-time model is discretised
        with it.
    seed : int
        Seed of all random numbers: the same seed gives the same runs bit for bit, also resumed.

    Returns
    -------
    TrialResult
        The runs with their signals and figures.

    Raises
    ------
    PlantError
        If the plant returns NaN or infinity, naming trial and sample; its `result` has the runs
        before.
    BadInputError
        If the library does not have what is to be resumed, or an argument is not for a cell.
    ValueError, TypeError
        If an argument has the wrong shape or kind.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import NormOptimalIlc, discretize, second_order, simulate
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> reference = 0.01 * np.hanning(300)
    >>> result = simulate(axis, NormOptimalIlc(axis, 300, r=0.01), reference, trials=4)
    >>> result.records[-1].tracking_rms_m < 0.01 * result.records[0].tracking_rms_m
    True
    """
    if not isinstance(trials, int) or isinstance(trials, bool) or not 1 <= trials <= TRIALS_MAX:
        message = f"trials = {trials!r}; a whole number from 1 to {TRIALS_MAX}"
        raise ValueError(message)
    if isinstance(plant, (str, PathLike, Cell)):
        _refuse_for_a_cell(
            reference=reference, noise_std=noise_std or None, output_disturbance=output_disturbance,
            initial_state=initial_state, initial_input=initial_input, campaign=campaign, dt_s=dt_s,
            n_inputs=n_inputs,
        )  # fmt: skip
        return _simulated_cell(plant, law, trials, library, disturbance, resume=resume)
    if reference is None:
        message = "reference: needed, unless the plant is a cell description"
        raise ValueError(message)
    if not isinstance(noise_std, Real) or not 0.0 <= noise_std < np.inf:
        message = f"noise_std = {noise_std}; a finite number from 0"
        raise ValueError(message)
    known = plant_of(plant, dt_s)
    found = n_inputs if n_inputs is not None else known.n_inputs
    experiment = Experiment(
        law, reference, library=library, name=name, campaign=campaign, resume=resume,
        dt_s=dt_s or known.dt_s or 1.0, unit=unit, initial_input=initial_input,
        n_inputs=None if initial_input is not None else found,
    )  # fmt: skip
    experiment.result.seed = seed
    surroundings = _Surroundings(
        disturbance, output_disturbance, initial_state, experiment.shape, float(noise_std), seed
    )
    while experiment.trial < trials:
        surroundings.run(known, experiment)
    experiment.result.status = "completed"
    return experiment.result


class _Surroundings:
    """Disturbances, initial states and random numbers of every run."""

    def __init__(
        self,
        disturbance: Callable[[int], ArrayLike] | ArrayLike | None,
        output_disturbance: Callable[[int], ArrayLike] | ArrayLike | None,
        initial_state: Callable[[int], ArrayLike] | ArrayLike | None,
        shape: tuple[int, ...],
        noise_std: float,
        seed: int,
    ) -> None:
        self._disturbance, self._initial_state = disturbance, initial_state
        self._output, self._shape = output_disturbance, shape
        self._noise_std, self._seed = noise_std, seed

    def run(self, plant: Plant, experiment: Experiment) -> None:
        """Make one run."""
        trial = experiment.trial
        measured = self._measured(trial)
        u = experiment.ask(measured)
        # Streams of their own, so that the noise is the same whatever the plant draws.
        noise, own = (
            np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=(trial, stream)))
            for stream in (0, 1)
        )
        state = self._initial_state(trial) if callable(self._initial_state) else self._initial_state
        y = plant.respond(u, Circumstances(trial, measured, state, own))
        y = like(y, self._shape)
        if y.shape == self._shape and y.dtype.kind in "iuf":
            y = y + self._added(trial)
            if self._noise_std > 0.0:
                y = y + self._noise_std * noise.standard_normal(self._shape)
        try:
            experiment.tell(y)
        except PlantError as error:
            error.result = experiment.result
            raise

    def _measured(self, trial: int) -> Array | None:
        if self._disturbance is None:
            return None
        if callable(self._disturbance):
            return np.atleast_1d(finite("disturbance", self._disturbance(trial)))
        rows = finite("disturbance", self._disturbance)
        if trial >= len(rows):
            message = f"disturbance has shape {rows.shape}; a row for trial {trial} is needed"
            raise ValueError(message)
        return np.atleast_1d(rows[trial])

    def _added(self, trial: int) -> Array | float:
        if self._output is None:
            return 0.0
        given = self._output(trial) if callable(self._output) else self._output
        added = finite("output_disturbance", given)
        if added.shape != self._shape:
            message = f"output_disturbance has shape {added.shape}; {self._shape} is needed"
            raise ValueError(message)
        return added


def _refuse_for_a_cell(**given: object) -> None:
    for name, value in given.items():
        if value is not None:
            message = f"{name}: not for a cell description, which has its own"
            raise BadInputError(message)


def _simulated_cell(
    cell: str | PathLike[str] | Cell,
    law: AnyLaw | None,
    trials: int,
    library: str | PathLike[str] | None,
    disturbance: Callable[[int], ArrayLike] | ArrayLike | None,
    *,
    resume: bool,
) -> TrialResult:
    """Run a cell's simulated drives in this process, in lock-step."""
    with tempfile.TemporaryDirectory(prefix="ilc-simulate-") as folder:
        kept = Path(folder, "library.db") if library is None else Path(library)
        campaign = Campaign(
            cell if isinstance(cell, Cell) else Path(cell), law, kept,  # type: ignore[arg-type]
            bus="loopback:", drives="simulated", resume=resume, disturbance=disturbance,
            telemetry=False,
        )  # fmt: skip
        for _ in campaign.run(trials):
            pass
        found = campaign.result
        result = TrialResult(
            **{name: getattr(found, name) for name in found.__dataclass_fields__}, seed=None
        )
        if library is None:
            # The file goes; its signals stay.
            for record in result.records:
                record.row()
    return result
