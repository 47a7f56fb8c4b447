"""Time series of a cell, from the batches of servo cycles that its controller publishes.

A batch counts cycles from the start of the loop. Both bridges show time in seconds since 1970, axes
by name, and tracking errors beside positions; this module computes them for both.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ilc_rt.events import StartEvent
from ilc_rt.misfit import AXES_MAX, CYCLES_MAX, is_number
from ilc_rt.quantity import axis_unit
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from ilc_rt import Cell
    from ilc_rt.monitor import Message

    Recall = Callable[[str], Sequence[Mapping[str, Any]]]

#: Duration of a batch, by which a reader who has missed the start knows the cycle.
BATCH_S = 0.05
#: Difference between two clocks that is not delay of the network.
JUMP_S = 1.0
#: Any program on the network can publish under any name.
CELLS_MAX = 200
POSITIONS = {"reference_m": "reference", "encoder_m": "encoder", "tool_m": "tool"}


@dataclass(frozen=True, slots=True)
class Row:
    """One servo cycle of a cell.

    Attributes
    ----------
    time_s : float
        Time of the cycle, in seconds since 1970.
    iteration : int or None
        Number of the run; None between runs.
    axes : dict
        By name of the axis, its signals by name with unit: ``reference_m``, ``encoder_m``,
        ``tool_m``, ``encoder_error_m``, ``tool_error_m`` (``_rad`` for a rotary axis), and the
        learned ``input`` in the unit of the law. A signal without a value is absent.
    """

    time_s: float
    iteration: int | None
    axes: dict[str, dict[str, float]]


class Signals:
    """Rows of one cell.

    Parameters
    ----------
    names, units : sequence of str
        Names of the axes, and units of their positions; told by the controller at its start.
    cycle_s : float, optional
        Servo cycle in seconds; likewise.
    clock : callable
        Returns the time in seconds since 1970.
    """

    def __init__(
        self,
        names: Sequence[str] = (),
        units: Sequence[str] = (),
        cycle_s: float | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._names, self._units, self._cycle_s = tuple(names), tuple(units), cycle_s
        self._clock = clock
        #: Time of cycle 0, and number of the cycle that comes next.
        self._zero_s: float | None = None
        self._next = 0

    @classmethod
    def of_cell(cls, cell: Cell) -> Signals:
        """Return the signals of a described cell."""
        return cls(cell.axis_names, cell.axis_units, cell.cycle_s)

    @classmethod
    def of_run(cls, row: Mapping[str, Any]) -> Signals:
        """Return the signals of the cell of a stored run."""
        units = tuple(map(axis_unit, map(str, row["input_units"])))
        return cls(tuple(map(printable, row["axis_names"])), units, float(row["cycle_s"]))

    def rows(self, message: Message) -> Iterator[Row]:
        """Yield the cycles of a message; none if it has no batch."""
        if isinstance(message.event, StartEvent):
            start = message.event
            self._names = start.axis_names
            self._units = tuple(map(axis_unit, start.input_units))
            self._cycle_s = start.cycle_s
            self._zero_s = None
        if message.topic == "servo":
            yield from self._batch(message.payload)

    def _batch(self, batch: dict[str, Any]) -> Iterator[Row]:
        first, places = batch.get("first_sync"), batch.get("iteration_and_sample")
        if not is_number(first) or not isinstance(first, int) or first < 0:
            return
        if not isinstance(places, list) or not 0 < len(places) <= CYCLES_MAX:
            return
        cycle_s = self._cycle_s or BATCH_S / len(places)
        # A batch is sent when its last cycle is over.
        zero_s = self._clock() - (first + len(places)) * cycle_s
        if self._zero_s is None or first < self._next or abs(zero_s - self._zero_s) > JUMP_S:
            self._zero_s = zero_s
        self._next = first + len(places)
        for index, place in enumerate(places):
            run = place[0] if isinstance(place, list) and place else None
            iteration = run if is_number(run) and isinstance(run, int) else None
            time_s = self._zero_s + (first + index) * cycle_s
            yield Row(time_s, iteration, self._axes(batch, index))

    def _axes(self, batch: dict[str, Any], index: int) -> dict[str, dict[str, float]]:
        axes: dict[str, dict[str, float]] = {}
        for key, name in {**POSITIONS, "input": "input"}.items():
            for axis, value in enumerate(_row(batch.get(key), index)):
                if is_number(value):
                    unit = "" if key == "input" else f"_{self._unit(axis)}"
                    axes.setdefault(self._name(axis), {})[f"{name}{unit}"] = float(value)
        for axis, (name, signals) in enumerate(axes.items()):
            unit = self._unit(axis)
            for measured in ("encoder", "tool"):
                values = [signals.get(f"{signal}_{unit}") for signal in ("reference", measured)]
                if values[0] is not None and values[1] is not None:
                    axes[name][f"{measured}_error_{unit}"] = values[0] - values[1]
        return axes

    def _name(self, axis: int) -> str:
        return self._names[axis] if axis < len(self._names) else str(axis)

    def _unit(self, axis: int) -> str:
        return self._units[axis] if axis < len(self._units) else "m"


def _row(rows: object, index: int) -> list[object]:
    """Return one row of a published table; empty if it has none."""
    if isinstance(rows, list) and index < len(rows) and isinstance(rows[index], list):
        return list(rows[index][:AXES_MAX])
    return []


class Cells:
    """Signals of every cell that is heard.

    Parameters
    ----------
    described : Cell, optional
        The cell whose description is at hand; the others tell theirs when they start.
    recall : callable, optional
        Called with the name of a cell that is heard for the first time; returns its stored runs.
    """

    def __init__(
        self,
        described: Cell | None = None,
        recall: Recall | None = None,
    ) -> None:
        self._recall = recall
        self._signals: dict[str, Signals] = {}
        if described is not None:
            self._signals[described.name] = Signals.of_cell(described)

    def rows(self, message: Message) -> Iterator[Row]:
        """Yield the servo cycles of a message."""
        if message.cell not in self._signals:
            if len(self._signals) >= CELLS_MAX:
                return iter(())
            runs = [] if self._recall is None else self._recall(message.cell)
            self._signals[message.cell] = Signals.of_run(runs[-1]) if runs else Signals()
        return self._signals[message.cell].rows(message)
