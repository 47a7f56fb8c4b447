"""Batches of servo cycles as arrays; whatever a stranger publishes is left out.

Imported by `watched`, when the first batch comes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.misfit import AXES_MAX, CYCLES_MAX, NUMBER_MAX

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Cycles:
    """Servo cycles, one row per cycle and one column per axis.

    Attributes
    ----------
    first : int
        Number of the first cycle since the start of the loop.
    places : list
        Run and sample of each cycle, or None between runs, as published.
    reference_m, measured_m, input : ndarray of float64, shape (n_cycles, n_axes)
        Set points, measurement, learned input; NaN for a missing value.
    """

    first: int
    places: list[Any]
    reference_m: Array
    measured_m: Array
    input: Array

    @property
    def error_m(self) -> Array:
        """Set points minus measurement."""
        return self.reference_m - self.measured_m

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(self.reference_m.shape[1])

    def newest(self) -> list[list[float | None]]:
        """Return set point, measurement, input and error of each axis in the last cycle."""
        tables = (self.reference_m, self.measured_m, self.input, self.error_m)
        rows = np.column_stack([table[-1] for table in tables]).tolist()
        return [[None if value != value else value for value in row] for row in rows]

    def largest_errors_m(self) -> list[float | None]:
        """Return the largest absolute error of each axis; None where nothing was measured."""
        largest = np.fmax.reduce(np.abs(self.error_m), axis=0).tolist()
        return [None if value != value else value for value in largest]

    def samples(self) -> dict[int, NDArray[np.intp]]:
        """Return rows of cycles and numbers of samples, shape (n, 2), by run."""
        found: dict[int, list[tuple[int, int]]] = {}
        for row, place in enumerate(self.places):
            if isinstance(place, list) and len(place) == 2 and all(type(n) is int for n in place):
                found.setdefault(place[0], []).append((row, place[1]))
        return {run: np.array(pairs, dtype=np.intp) for run, pairs in found.items()}


def read_cycles(batch: dict[str, Any], n_axes: int, measure: str | None) -> Cycles | None:
    """Return the cycles of a published batch; None if it is malformed.

    Parameters
    ----------
    batch : dict
        Payload of a message of the topic ``servo``.
    n_axes : int
        Number of axes; 0 if it is not known.
    measure : str or None
        Measurement that is learned from; unless it is "encoder", that at the tool where it exists.
    """
    first, places = batch.get("first_sync"), batch.get("iteration_and_sample")
    if not isinstance(first, int) or isinstance(first, bool) or not 0 <= first < 2**53:
        return None
    if not isinstance(places, list) or not 0 < len(places) <= CYCLES_MAX:
        return None
    shape = (len(places), n_axes or _width(batch.get("reference_m")))
    if not 0 < shape[1] <= AXES_MAX:
        return None
    tables = [_table(batch, key, shape) for key in ("reference_m", "encoder_m", "input", "tool_m")]
    reference, measured, applied, tool = tables
    if reference is None or measured is None or applied is None:
        return None
    if tool is not None and measure != "encoder":
        measured = np.where(np.isfinite(tool), tool, measured)
    return Cycles(first, places, reference, measured, applied)


def _width(rows: object) -> int:
    return len(rows[0]) if isinstance(rows, list) and rows and isinstance(rows[0], list) else 0


def _table(batch: dict[str, Any], key: str, shape: tuple[int, int]) -> Array | None:
    """Return a published table, with NaN for a missing value; None if its shape is another."""
    try:
        table = np.array(batch.get(key), dtype=np.float64)
    except (OverflowError, TypeError, ValueError):
        return None
    if table.shape != shape:
        return None
    table[~(np.abs(table) <= NUMBER_MAX)] = np.nan
    return table
