"""Parameters of any law, chosen by simulated learning on several plants.

Imported by users; `ilc_rt.tune` proposes weights of norm-optimal ILC without simulation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import LearningError, ModelError, SignalError
from ilc_rt.errors import PlantError
from ilc_rt.simulation import simulate
from ilc_rt.sweeping import sweep

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from concurrent.futures import Executor

    from numpy.typing import ArrayLike

    from ilc_rt.laws.arguments import AnyLaw
    from ilc_rt.sweep_result import SweepResult

__all__ = ["SimulatedTuning", "tune_by_simulation"]

#: Default of the largest allowed growth of an error over the smallest one before.
GROWTH_MAX = 1.2


@dataclass(frozen=True, repr=False)
class SimulatedTuning:
    """Chosen parameters of a law, with what every case did.

    Attributes
    ----------
    parameters : dict
        Keywords of the best case.
    law : Law or object
        The law made from them.
    worst : float
        RMS error of the last run over that of the first, on the worst plant.
    growth : float
        Largest growth of an error over the smallest one before, on the worst plant.
    growth_max : float
        Growth that was allowed.
    cases : SweepResult
        ``worst``, ``growth`` and ``why`` of every case.

    Notes
    -----
    ``cases.arrays()`` has the figures for a picture, ``cases.to_dataframe()`` as a table.
    """

    parameters: dict[str, Any]
    law: Any
    worst: float
    growth: float
    growth_max: float
    cases: SweepResult

    def __str__(self) -> str:
        """Return the choice with its reasons."""
        held = sum(value["growth"] <= self.growth_max for value in self.cases.values)
        shown = ", ".join(
            f"{name} = {value:.4g}" if isinstance(value, float) else f"{name} = {value}"
            for name, value in self.parameters.items()
        )
        return (
            f"{shown}: {100.0 * self.worst:.3g} % of the first error is left on the worst plant; "
            f"of {len(self.cases)} cases {held} grow by no more than "
            f"{100.0 * (self.growth_max - 1.0):.0f} %"
        )

    def __repr__(self) -> str:
        """Return the parameters and the figures."""
        return (
            f"SimulatedTuning({self.parameters}, worst={self.worst:.4g}, growth={self.growth:.4g})"
        )


def tune_by_simulation(
    make: Callable[..., AnyLaw],
    cases: Iterable[Mapping[str, Any]],
    plants: Sequence[Any],
    reference: ArrayLike,
    *,
    trials: int = 12,
    noise_std: float = 0.0,
    growth_max: float = GROWTH_MAX,
    dt_s: float | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> SimulatedTuning:
    """Choose the parameters of a law that learn best on the worst of several plants.

    ``min_p max_i |e_last(p, i)| / |e_0(i)|`` among the cases whose error grows by at most
    `growth_max` over its smallest value before, on every plant.

    Parameters
    ----------
    make : callable
        Called with the keywords of a case; returns the law. For processes it must be importable.
    cases : iterable of mappings
        Keywords of each case; `grid` and `latin_hypercube` make them.
    plants : sequence
        Plants, as `ilc_rt.simulate` takes them: the model and what it may be in truth.
    reference : array_like, shape (n_samples,) or (n_samples, n_outputs)
        Reference.
    trials : int
        Runs on each plant, at least 2.
    noise_std : float
        Standard deviation of white measurement noise, the same in every case.
    growth_max : float
        Largest growth of an error over the smallest one before, from 1.
    dt_s : float or None
        As for `ilc_rt.simulate`.
    seed : int
        Seed of the noise.
    executor : concurrent.futures.Executor or None
        Where cases are simulated, as for `ilc_rt.sweep`; the result is the same bit for bit.
    progress : callable or None
        Called with the number of finished cases and of all, after each.

    Returns
    -------
    SimulatedTuning
        The best case; of equally good ones the first.

    Raises
    ------
    LearningError
        If the error grows by more than `growth_max` in every case.
    ValueError, TypeError
        If an argument has the wrong shape or kind.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, discretize, grid, second_order, tune_by_simulation
    >>> plants = [discretize(second_order(w, 0.7), 0.002) for w in (80.0, 94.0, 110.0)]
    >>> found = tune_by_simulation(PdIlc, grid(kp=[0.2, 0.5, 3.0]), plants, np.hanning(100))
    >>> found.parameters
    {'kp': 0.5}
    """
    if not callable(make):
        message = f"make = {make!r}: a function that returns a law is needed"
        raise TypeError(message)
    if not isinstance(trials, int) or trials < 2:
        message = f"trials = {trials!r}: a whole number from 2 is needed"
        raise ValueError(message)
    if not growth_max >= 1.0:
        message = f"growth_max = {growth_max}: a number from 1 is needed"
        raise ValueError(message)
    if not isinstance(plants, (list, tuple)) or not plants:
        message = "plants: a list of at least one plant is needed"
        raise TypeError(message)
    bench = _Bench(make, tuple(plants), np.asarray(reference), trials, noise_std, dt_s, seed)
    found = sweep(bench, cases, executor, progress=progress)
    if not found.values:
        message = "cases: at least one is needed"
        raise ValueError(message)
    held = [number for number, value in enumerate(found.values) if value["growth"] <= growth_max]
    if not held:
        least = min(found.values, key=lambda value: value["growth"])
        message = (
            f"in every case an error grows by more than {growth_max:g} times; the least growth is "
            f"{least['growth']:.4g} {least['why']}".rstrip()
        )
        raise LearningError(message)
    best = min(held, key=lambda number: float(found.values[number]["worst"]))
    value, parameters = found.values[best], dict(found.cases[best])
    return SimulatedTuning(
        parameters, make(**parameters), value["worst"], value["growth"], growth_max, found
    )


@dataclass(frozen=True)
class _Bench:
    """Plants and runs, called with the parameters of a case in any process."""

    make: Callable[..., AnyLaw]
    plants: tuple[Any, ...]
    reference: Any
    trials: int
    noise_std: float
    dt_s: float | None
    seed: int

    def __call__(self, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401 (those of any law)
        """Return the figures of the worst plant."""
        worst, growth, why = 0.0, 1.0, ""
        for number, plant in enumerate(self.plants):
            try:
                result = simulate(
                    plant, self.make(**parameters), self.reference, trials=self.trials,
                    noise_std=self.noise_std, dt_s=self.dt_s, seed=self.seed,
                )  # fmt: skip
            except (LearningError, ModelError, SignalError, PlantError) as error:
                return {"worst": np.inf, "growth": np.inf, "why": f"(plant {number}: {error})"}
            rms = np.array([record.tracking_rms_m for record in result.records])
            first = rms[0] if rms[0] > 0.0 else 1.0
            least = np.minimum.accumulate(rms)[:-1]
            own = float(np.max(rms[1:] / np.maximum(least, 1e-9 * first)))
            worst, growth = max(worst, float(rms[-1] / first)), max(growth, own)
        return {"worst": worst, "growth": growth, "why": why}
