"""Repeatability of a cell's error: the part that repeats, and the rest."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ilc_rt.analysis import repeatability
from ilc_rt.campaign import Campaign, Drives, load_cell
from ilc_rt.errors import BadInputError
from ilc_rt.result import json_text, write_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt._native import Cell
    from ilc_rt.events import Event

# Thresholds of the ratio for "some" and "good" benefit of learning.
SOME, WELL = 1.0, 3.0


@dataclass(frozen=True, slots=True)
class AxisRepeatability:
    """Repeatability of one axis' error from run to run.

    Attributes
    ----------
    axis : str
        Name of the axis.
    repeatable_rms_m : float
        RMS over time of the repeatable part: what learning can remove.
    non_repeatable_rms_m : float
        RMS of the remainder that differs from run to run: what it cannot.
    ratio : float
        Ratio of the two; None if nothing differs.
    unit : {"m", "rad"}
        Unit of the axis, and of both figures.
    """

    axis: str
    repeatable_rms_m: float
    non_repeatable_rms_m: float
    ratio: float | None
    unit: str = "m"

    @property
    def verdict(self) -> Literal["yes", "a little", "no"]:
        """Verdict whether learning is worth while on this axis."""
        if self.repeatable_rms_m <= 0.0:
            return "no"
        if self.ratio is None or self.ratio >= WELL:
            return "yes"
        return "a little" if self.ratio >= SOME else "no"


@dataclass(frozen=True, slots=True)
class RepeatabilityCheck:
    """Repeatability of all axes of a cell.

    Attributes
    ----------
    n_runs : int
        Runs without learning that were compared.
    axes : tuple of AxisRepeatability
        One for each axis.
    """

    n_runs: int
    axes: tuple[AxisRepeatability, ...]

    @property
    def applicable(self) -> bool:
        """True if learning is worth while on any axis."""
        return any(axis.verdict != "no" for axis in self.axes)

    def to_json(self) -> dict[str, Any]:
        """Return the content of the ``--json`` file."""
        axes = [{**asdict(axis), "verdict": axis.verdict} for axis in self.axes]
        return {"n_runs": self.n_runs, "applicable": self.applicable, "axes": axes}

    def write_json(self, path: str | Path) -> None:
        """Write the figures to a file.

        Raises
        ------
        BadInputError
            If the file cannot be written.
        """
        write_text(path, json_text(self.to_json()))


def compare_runs(
    errors: ArrayLike, axis_names: tuple[str, ...] = (), axis_units: tuple[str, ...] = ()
) -> RepeatabilityCheck:
    """Split the errors of equal runs into the repeatable and the non-repeatable part.

    ``s^2[k] = sum_j (e_j[k] - m[k])^2 / (n - 1)`` with m the mean over the runs; the repeatable
    part is ``ms(m) - ms(s) / n``, as the mean of n runs still contains an n-th of the scatter.

    Parameters
    ----------
    errors : array_like, shape (n_runs, n_samples, n_axes)
        Error of each run, all with the same input.
    axis_names : tuple of str
        Names of the axes; numbers if empty.
    axis_units : tuple of str
        Their units; all m if empty.

    Raises
    ------
    ValueError
        For fewer than two runs, another shape, or numbers that are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> lag = np.ones((1, 100, 1)) * 1e-3
    >>> compare_runs(np.concatenate([lag, lag])).axes[0].verdict
    'yes'
    """
    values = np.asarray(errors, dtype=np.float64)
    if values.ndim != 3 or values.shape[0] < 2 or 0 in values.shape:
        message = f"errors has shape {values.shape}; (n_runs, n_samples, n_axes), 2 runs at least"
        raise ValueError(message)
    if not np.isfinite(values).all():
        message = "errors holds a number that is not finite"
        raise ValueError(message)
    n_runs = values.shape[0]
    names = axis_names or tuple(str(number + 1) for number in range(values.shape[2]))
    if len(names) != values.shape[2]:
        message = f"axis_names has {len(names)} names; {values.shape[2]} are needed"
        raise ValueError(message)
    units = axis_units or ("m",) * len(names)
    axes = tuple(
        _axis(str(name), values[:, :, column], unit)
        for column, (name, unit) in enumerate(zip(names, units, strict=True))
    )
    return RepeatabilityCheck(n_runs, axes)


def _axis(name: str, errors: NDArray[np.float64], unit: str) -> AxisRepeatability:
    found = repeatability(np.ascontiguousarray(errors))
    other = found.spread_rms
    same = float(np.sqrt(max(found.mean_rms**2 - other**2 / len(errors), 0.0)))
    return AxisRepeatability(name, same, other, same / other if other > 0.0 else None, unit)


def check_repeatability(
    cell: str | Path | Cell,
    runs: int = 5,
    *,
    bus: str | None = None,
    measure: Literal["encoder", "tcp"] | None = None,
    lockstep: bool | None = None,
    drives: Drives = "auto",
    library: str | Path | None = None,
    telemetry: bool = True,
    observe: Callable[[Event], None] | None = None,
) -> RepeatabilityCheck:
    """Run a cell's program without learning and compare the runs.

    Parameters
    ----------
    cell : path or Cell
        The cell.
    runs : int
        Number of runs, at least 2.
    bus, measure, lockstep, drives, telemetry
        As for `Campaign`.
    library : path or None
        Library that the runs are stored in; None for no library.
    observe : callable or None
        Called with every event of the controller.

    Raises
    ------
    CampaignError
        If there are fewer than two runs, or the controller stopped.

    Examples
    --------
    >>> check_repeatability("examples/01_gantry.toml", runs=3, bus="loopback:").applicable
    True
    """
    if runs < 2:
        message = f"runs = {runs}: at least 2, as one shows no spread"
        raise BadInputError(message)
    described = load_cell(cell) if isinstance(cell, (str, Path)) else cell
    with ExitStack() as stack:
        if library is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="ilc-repeat-"))
            library = Path(folder) / "runs.db"
        campaign = Campaign(
            described, library=library, bus=bus, measure=measure, lockstep=lockstep,
            drives=drives, telemetry=telemetry, learning=False,
        )  # fmt: skip
        with closing(campaign.events(runs)) as events:
            for event in events:
                if observe is not None:
                    observe(event)
        errors = [record.error_m for record in campaign.result.records]
    if len(errors) < 2:
        message = "the runs were stopped before two of them were over"
        raise BadInputError(message)
    names, units = tuple(described.axis_names), campaign.result.axis_units
    return compare_runs(np.stack(errors), names, units)
