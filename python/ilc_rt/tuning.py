"""Weights of norm-optimal learning for a cell, chosen by trials on perturbed axes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import TUNING_RUNS_MAX, Cell
from ilc_rt.cell_file import write_values
from ilc_rt.errors import BadInputError
from ilc_rt.trials import KNOWN_SHARE, BelievedAxis, Bench, Trial, Weights, believed_axes
from ilc_rt.weight_search import WeightSearch, rounded

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

TUNED_LAWS = ("norm_optimal", "constrained")
UNCERTAINTY = 0.3
"""Default relative model uncertainty: the residual of a good fit on an axis with friction."""
GROWTH_MAX = 1.2
"""Largest growth of an error over the smallest one in a trial."""
TRIAL_RUNS_MAX = 100
"""Largest number of runs of a trial: an error that has not grown by then grows slowly enough to be
noticed."""
ACROSS_TO_ALONG = 1.5
"""Largest ratio of the weights of an error across the path and along it."""
SAMPLES_MAX = 20_000
"""Largest number of samples per run in a trial."""


@dataclass(frozen=True)
class Reason:
    """A proposed weight, with its reason."""

    key: str
    value: float
    why: str


@dataclass(frozen=True)
class Proposal:
    """Weights for a cell, with reasons and predictions.

    Attributes
    ----------
    cell : str
        Name of the cell.
    law : str
        The law of the cell.
    section : str
        Table of the cell description in which the weights belong.
    weights : Weights
        The proposed weights.
    reasons : tuple of Reason
        Reasons, weight by weight.
    trials : tuple of Trial
        Results of the weights on all perturbed axes.
    notes : tuple of str
        Further notes, one sentence each.
    uncertainty, known_hz, noise, n_runs
        Assumptions of the trials; `known_hz` per axis.
    units : dict
        Unit of position of each axis.
    along : float or None
        Proposed weight along the path, if the cell weighs contours and its own is too small.
    """

    cell: str
    law: str
    section: str
    weights: Weights
    reasons: tuple[Reason, ...]
    trials: tuple[Trial, ...]
    notes: tuple[str, ...]
    uncertainty: float
    known_hz: dict[str, float]
    noise: float
    n_runs: int
    units: dict[str, str]
    along: float | None = None

    def toml(self) -> str:
        """Return the lines for the cell description."""
        lines = [f"{key} = {value}" for key, value in self.values().items()]
        if self.along is not None:
            lines += ["", f"[{self.section}.contour]", f"along = {self.along}"]
        return f"[{self.section}]\n" + "\n".join(lines) + "\n"

    def values(self) -> dict[str, float]:
        """Return the weights by key."""
        w = self.weights
        return {"q": w.q, "s": w.s, "r": w.r, "rate": w.rate}

    def write(self, path: str | Path) -> bool:
        """Write the weights into a cell description; return True if it changed."""
        tables: dict[str, dict[str, float]] = {self.section: self.values()}
        if self.along is not None:
            tables[f"{self.section}.contour"] = {"along": self.along}
        return write_values(path, tables)

    def of(self, axis: str) -> list[Trial]:
        """Return the trials of an axis."""
        return [trial for trial in self.trials if trial.axis == axis]

    def to_json(self) -> dict[str, Any]:
        """Return the content of the file written by ``--json``."""
        return {
            "cell": self.cell,
            "law": self.law,
            **self.values(),
            "along": self.along,
            "reasons": [asdict(reason) for reason in self.reasons],
            "notes": list(self.notes),
            "uncertainty": self.uncertainty,
            "known_hz": self.known_hz,
            "noise_m": self.noise,
            "n_runs": self.n_runs,
            "trials": [
                {
                    "axis": trial.axis,
                    "what": trial.what,
                    "unit": self.units[trial.axis],
                    "rms": trial.rms.tolist(),
                    "growth": trial.growth,
                    "input_peak": trial.input_peak,
                }
                for trial in self.trials
            ],
        }


def propose_weights(
    cell: str | Path,
    *,
    uncertainty: float | Sequence[float] = UNCERTAINTY,
    known_hz: float | None = None,
    noise_m: float = 0.0,
    n_runs: int = 10,
    progress: Callable[[int, int], object] | None = None,
) -> Proposal:
    """Propose the learning weights of a cell.

    The weight `rate` is chosen by trials on perturbed axes: up to `known_hz` the model within
    `uncertainty`, above it with a mode, everywhere with friction. Among the weights for which
    no trial's error grows by more than 20 % over its smallest one, those with the smallest mean
    error after `n_runs` runs are chosen.

    Parameters
    ----------
    cell : path
        The cell description.
    uncertainty : float or sequence of float
        Relative model uncertainty where the model is known, 0.3 for 30 %; an array holds gains at
        equally spaced frequencies from zero to the Nyquist frequency: the first one applies where
        the model is known, which is up to where they first reach 1.
    known_hz : float or None
        Frequency up to which the model is known; None for 1.3 times the natural frequency of each
        axis.
    noise_m : float
        Standard deviation of white measurement noise.
    n_runs : int
        Runs by which learning should be complete, at most 10 000; a trial has 100 at most.
    progress : callable or None
        Called with the number of rates that were tried and of all, before each.

    Raises
    ------
    BadInputError
        If the file cannot be used, a value is out of range, or nothing moves.

    Examples
    --------
    >>> found = propose_weights("examples/01_gantry.toml")
    >>> found.weights.rate > 3
    True
    """
    described = _load(cell)
    law = described.law
    section = "learning.constrained" if law == "constrained" else "learning.norm_optimal"
    axes, written = believed_axes(described, SAMPLES_MAX)
    low, known = _known(uncertainty, known_hz, described.cycle_s)
    if not (np.isfinite(noise_m) and noise_m >= 0.0):
        message = f"noise_m = {noise_m}; 0 or a positive number is needed"
        raise BadInputError(message)
    if not 1 <= n_runs <= TUNING_RUNS_MAX:
        message = f"n_runs = {n_runs}; 1 to {TUNING_RUNS_MAX} is needed"
        raise BadInputError(message)
    n_runs = min(n_runs, TRIAL_RUNS_MAX)
    known_of = {axis.name: known or KNOWN_SHARE * axis.natural_frequency_hz for axis in axes}
    moving = [axis for axis in axes if np.any(axis.way != 0.0)]
    if not moving:
        message = f"{described.path}: no axis moves in the program: there is nothing to learn"
        raise BadInputError(message)
    benches = [Bench(axis, low, known_of[axis.name], noise_m, n_runs) for axis in moving]
    table = written.get("learning", {}).get(section.removeprefix("learning."), {})
    along = _along(table) if law == "norm_optimal" else None
    if along is not None:
        table = {**table, "contour": {**table["contour"], "along": along}}
    varies = bool(table.get("contour") or table.get("phase")) and law not in {"constrained"}
    q = float(table.get("q", 1.0)) if varies else 1.0
    levels = _error_weights(table) if varies else [q]
    search = WeightSearch(benches, q, levels, _growth_max(written), n_runs, progress)
    weights, trials = search.weights()
    return Proposal(
        cell=described.name, law=law, section=section, weights=weights,
        reasons=_reasons(search, weights, trials, low, known_of, noise_m, along), along=along,
        trials=tuple(trials), notes=_notes(law, moving, trials),
        uncertainty=low, known_hz=known_of, noise=noise_m, n_runs=n_runs,
        units={axis.name: axis.unit for axis in axes},
    )  # fmt: skip


def _load(cell: str | Path) -> Cell:
    try:
        # Weights are requested because those in the file may be wrong.
        return Cell.load(cell, allow_divergent=True)
    except ValueError as error:
        raise BadInputError(" ".join(str(error).split())) from error


def _known(
    uncertainty: float | Sequence[float], known_hz: float | None, dt_s: float
) -> tuple[float, float | None]:
    """Return the uncertainty where the model is known, and up to which frequency."""
    gains = np.atleast_1d(np.asarray(uncertainty, dtype=np.float64))
    if gains.ndim != 1 or len(gains) == 0 or not np.all(np.isfinite(gains) & (gains >= 0.0)):
        message = f"uncertainty = {uncertainty}; gains of 0 or more are needed, as 0.3 for 30 %"
        raise BadInputError(message)
    low, nyquist_hz = float(gains[0]), 0.5 / dt_s
    if low >= 1.0:
        message = (
            f"uncertainty = {low}; below 1 is needed at low frequencies: a model that may be wrong "
            "by all of itself teaches nothing; `ilc identify` measures a better one"
        )
        raise BadInputError(message)
    if known_hz is not None:
        if not 0.0 < known_hz < nyquist_hz:
            message = (
                f"known_hz = {known_hz}; between 0 and {nyquist_hz:g} Hz, half the cycle rate, "
                "is needed"
            )
            raise BadInputError(message)
        return low, float(known_hz)
    wrong = np.flatnonzero(gains >= 1.0)
    if len(wrong) == 0:
        return low, None
    at = int(wrong[0])
    share = (1.0 - gains[at - 1]) / (gains[at] - gains[at - 1])
    return low, float((at - 1 + share) / (len(gains) - 1) * nyquist_hz)


def _growth_max(written: dict[str, Any]) -> float:
    """Return the allowed growth of an error, safely below that of a rollback."""
    rollback = float(written.get("learning", {}).get("rollback_ratio", 1.5))
    return min(GROWTH_MAX, 1.0 + 0.4 * (rollback - 1.0))


def _error_weights(table: dict[str, Any]) -> list[float]:
    """Return the smallest and the largest error weight that the table of the cell produces."""
    contour = table.get("contour")
    found = []
    for phase in [{}, *table.get("phase", [])]:
        q = float(phase.get("q", table.get("q", 1.0)))
        found.append(q + (float(contour.get("along", 0.0)) if contour is not None else 0.0))
        if contour is not None:
            found.append(q + float(phase.get("contour", contour.get("weight", 1.0))))
    positive = [value for value in found if value > 0.0]
    return sorted({min(positive), max(positive)}) if positive else [1.0]


def _along(table: dict[str, Any]) -> float | None:
    """Return the required weight along the path; None if it is large enough."""
    contour = table.get("contour")
    if contour is None:
        return None
    q, along = float(table.get("q", 1.0)), float(contour.get("along", 0.0))
    across = q + float(contour.get("weight", 1.0))
    if across <= 2.0 * (q + along):
        return None
    return rounded(across / ACROSS_TO_ALONG - q)


def _reasons(
    search: WeightSearch,
    weights: Weights,
    trials: list[Trial],
    uncertainty: float,
    known_hz: dict[str, float],
    noise: float,
    along: float | None,
) -> tuple[Reason, ...]:
    count, runs = len(trials), search.n_runs
    steep = 100.0 * (search.growth_max - 1.0)
    q = (
        "only ratios matter: every error counts alike"
        if len(search.levels) == 1
        else f"as it is in the file; the error weighs from {search.levels[0]:g} to "
        f"{search.levels[-1]:g} along the run"
    )
    if weights.r > 0.0:
        r = f"the measurement's noise of {1e6 * noise:.3g} µm is averaged over more runs"
    elif noise > 0.0:
        r = "the noise asks for no slower learning than `rate` makes it"
    else:
        r = "no noise is known that slower learning would average out"
    known = ", ".join(f"{name} {hz:.3g} Hz" for name, hz in known_hz.items())
    rate = (
        f"keeps learning below what the model knows ({known}), where friction and modes outside it "
        f"begin: of {len(search.rates)} rates the one with the least error after {runs} runs on "
        f"{count} trials, of which none may grow by more than {steep:.0f} %; the model is taken to "
        f"be right within {100.0 * uncertainty:.0f} %"
    )
    if search.refused is not None:
        rate += f"; at {search.refused:g} one grows by more"
    if not search.held:
        rate = (
            f"the largest of {len(search.rates)} rates; with every one of them some trial grows by "
            f"more than {steep:.0f} %: the model is not good enough, `ilc identify` measures it"
        )
    reasons = [
        Reason("q", weights.q, q),
        Reason("s", weights.s, "a weight of the input would leave a part of every error"),
        Reason("r", weights.r, r),
        Reason("rate", weights.rate, rate),
    ]
    if along is not None:
        why = (
            "error along the path becomes error across it in every corner, so it must be learned "
            f"nearly as quickly: it weighs {ACROSS_TO_ALONG:g} times less"
        )
        reasons.append(Reason("contour.along", along, why))
    return tuple(reasons)


def _notes(law: str, axes: list[BelievedAxis], trials: list[Trial]) -> tuple[str, ...]:
    notes = []
    if law not in TUNED_LAWS:
        notes.append(
            f'[learning] law = "{law}" does not read these weights: law = "norm_optimal" does'
        )
    for axis in axes:
        key, bound = axis.input_bound
        own = [trial for trial in trials if trial.axis == axis.name]
        needed = own[-1].input_peak
        if needed > bound:
            notes.append(
                f"axis {axis.name}: learning wants {needed:.3g} of input, "
                f"[learning] {key} = {bound:g} holds it there; raise {key}"
            )
        left = max(trial.rms[-1] / trial.rms[0] for trial in own if trial.rms[0] > 0.0)
        if left > 0.3:
            notes.append(
                f"axis {axis.name}: a trial keeps {100.0 * left:.0f} % of its error; a better "
                "model (`ilc identify`) or more runs (--runs) leave less"
            )
    return tuple(notes)
