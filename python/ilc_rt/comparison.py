"""Displayed errors of a campaign's runs, and the error by which they are compared.

Runs are compared by their contour error if their path has one, else by their tracking error.
Lengths and angles are never combined in one figure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ilc_rt.quantity import Unit, in_words, unit_for

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ilc_rt.record import IterationRecord

    Figure = Callable[[IterationRecord], "float | None"]

# The best run is mentioned if it is this much better than the last.
BEST_SHARE = 0.9


@dataclass(frozen=True, slots=True)
class Column:
    """An error of every run, with its display unit."""

    name: str
    unit: Unit
    of: Figure

    @property
    def heading(self) -> str:
        """Heading: ``"max tracking µm"``."""
        return f"{self.name} {self.unit.symbol}"

    def cell(self, record: IterationRecord) -> str:
        """Return the number of a run."""
        return self.unit.number(self.of(record))


@dataclass(frozen=True, slots=True)
class Comparison:
    """The errors of a campaign's runs.

    Attributes
    ----------
    records : sequence of IterationRecord
        The runs in their order, at least one.
    units : sequence of str
        Unit of each axis, ``"m"`` or ``"rad"``; all linear if empty.
    """

    records: Sequence[IterationRecord]
    units: Sequence[str] = ()

    @property
    def first(self) -> IterationRecord:
        """The reference run of the comparison."""
        return self.records[0]

    @property
    def is_mixed(self) -> bool:
        """True if there are both linear and rotary axes."""
        return len(set(self.units)) > 1

    @property
    def by_contour(self) -> bool:
        """True if the runs are compared by their contour error."""
        there = all(record.contour_inf_m is not None for record in self.records)
        return there and (self.first.contour_inf_m or 0.0) > 0.0

    @property
    def learned(self) -> Sequence[IterationRecord]:
        """The runs whose error counts: all but those that only measured something for the law."""
        return [*self.records[:1], *(record for record in self.records[1:] if not record.phase)]

    def compared(self, record: IterationRecord) -> float:
        """Return the error by which a run is compared."""
        contour_m = record.contour_inf_m if self.by_contour else None
        return record.tracking_inf_m if contour_m is None else contour_m

    def size(self, of: Figure) -> float:
        """Return the largest value of an error over the runs, which determines its unit."""
        errors = (of(record) for record in self.records)
        return max((e for e in errors if e is not None and math.isfinite(e)), default=0.0)

    def errors(self, *, rms: bool = True) -> list[Column]:
        """Return the displayed errors of every run."""
        columns = self.tracking(rms=rms)
        if self.first.contour_inf_m is not None:
            sizes = (lambda record: record.contour_inf_m), (lambda record: record.tracking_inf_m)
            unit = unit_for("m", max(map(self.size, sizes)))
            columns.append(Column("max contour", unit, lambda record: record.contour_inf_m))
            if rms:
                columns.append(Column("RMS contour", unit, lambda record: record.contour_rms_m))
        return columns

    def tracking(self, *, rms: bool = True) -> list[Column]:
        """Return the displayed tracking errors: of linear and rotary axes separately."""
        if not self.is_mixed:
            base = self.units[0] if self.units else "m"
            unit = unit_for(base, self.size(lambda record: record.tracking_inf_m))
            columns = [Column("max tracking", unit, lambda record: record.tracking_inf_m)]
            if rms:
                columns.append(Column("RMS tracking", unit, lambda record: record.tracking_rms_m))
            return columns
        columns = []
        for base in ("m", "rad"):
            axes = [axis for axis, unit in enumerate(self.units) if unit == base]
            unit = unit_for(base, self.size(_largest_of(axes)))
            columns.append(Column("max tracking", unit, _largest_of(axes)))
            if rms:
                columns.append(Column("RMS tracking", unit, _rms_of(axes)))
        return columns

    def sentence(self) -> str:
        """Return the result of learning as a sentence."""
        if self.by_contour:
            unit = unit_for("m", self.size(self.compared))
            return f"Contour error {self._course(Column('', unit, self.compared))}."
        if not self.is_mixed:
            return f"Tracking error {self._course(self.tracking(rms=False)[0])}."
        parts = []
        for what, column in zip(("linear", "rotary"), self.tracking(rms=False), strict=True):
            before, after = column.of(self.first), column.of(self.learned[-1])
            said = in_words(before, after)
            parts.append(
                f"of the {what} axes from {column.unit.text(before)} to {column.unit.text(after)}"
                + (f" ({said})" if said else "")
            )
        return f"Tracking error {', '.join(parts)} within {self._count()}."

    def remarks(self) -> list[str]:
        """Return the decisions on inputs other than learning, one per line.

        A remark repeated in consecutive runs appears once.
        """
        return [line for _, line in self.numbered_remarks()]

    def numbered_remarks(self) -> list[tuple[int, str]]:
        """Return the lines of `remarks`, each with the number of its run."""
        before: str | None = None
        lines = []
        for record in self.records:
            remark = remark_on(record)
            if remark and remark != before:
                lines.append((record.index, f"run {record.index}: {remark}"))
            before = remark
        return lines

    def _course(self, column: Column) -> str:
        learned = self.learned
        errors = [column.of(record) or 0.0 for record in learned]
        before, after, unit = errors[0], errors[-1], column.unit
        if len(self.records) == 1:
            return f"{unit.text(before)} at most in 1 run"
        said = in_words(before, after)
        best = min(errors)
        index = learned[errors.index(best)].index
        aside = f"; best {unit.text(best)} in run {index}" if best < BEST_SHARE * after else ""
        change = f" ({said})" if said else ""
        course = f"from {unit.text(before)} to {unit.text(after)}{change}"
        return f"{course} within {self._count()}{aside}"

    def _count(self) -> str:
        return f"{len(self.records)} run{'' if len(self.records) == 1 else 's'}"


def remark_on(record: IterationRecord) -> str | None:
    """Return the decision on the input after a run, unless it was learning."""
    if record.remark:
        return record.remark
    # Stored by a version without reasons.
    return "the error grew: the best input is restored" if record.rolled_back else None


def note(record: IterationRecord) -> str:
    """Return the outcome of a run in a few words, for a column of a table."""
    said = ("rolled back", record.rolled_back), ("learning off", record.learning_off)
    words = [record.phase] if record.phase else []
    return ", ".join(words + [outcome for outcome, holds in said if holds])


def largest(figures: Sequence[float], axes: Sequence[int]) -> float | None:
    """Return the largest figure of some axes; None if one of them has none."""
    if not axes or max(axes) >= len(figures):
        return None
    return max(figures[axis] for axis in axes)


def _largest_of(axes: Sequence[int]) -> Figure:
    return lambda record: largest(record.axes_tracking_inf_m, axes)


def _rms_of(axes: Sequence[int]) -> Figure:
    def rms(record: IterationRecord) -> float | None:
        figures = record.axes_tracking_rms_m
        if not axes or max(axes) >= len(figures):
            return None
        return float(sum(figures[axis] ** 2 for axis in axes) ** 0.5)

    return rms
