"""Libraries as the page reads them: rows, signals, relevance; they are never written.

A run is named by the number of its library and its key there, so that a browser can name no file.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.closing import Closing
from ilc_rt.dashboard.capture import Capture
from ilc_rt.dashboard.flight import FlightRecord, read_flight
from ilc_rt.errors import BadInputError
from ilc_rt.pictures.aligned import SAME_MIN, shift_of
from ilc_rt.quantity import axis_unit
from ilc_rt.sources import campaign_of, source

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LOADED_MAX = 24


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run with its signals, shifted in time onto another one.

    Attributes
    ----------
    key : tuple of int
        Number of the library, key in it.
    row : dict
        As `Library.load` gives it.
    shift_s : float
        Time to be added to its own.
    is_same : bool
        False if its reference is another motion than that of the run it is compared with.
    """

    key: tuple[int, int]
    row: dict[str, Any]
    shift_s: float = 0.0
    is_same: bool = True

    @property
    def name(self) -> str:
        """Short name: campaign and number of the run."""
        return f"{self.row['campaign']} run {self.row['index']}"

    def time_s(self) -> Array:
        """Return the common time of each sample."""
        return np.arange(self.row["n_samples"]) * float(self.row["cycle_s"]) + self.shift_s

    def signal(self, what: str, axis: int) -> Array:
        """Return "error", "input" or "command" (set point) of an axis; NaN without that axis."""
        values = self.row[{"error": "error_m", "input": "input", "command": "reference_m"}[what]]
        if axis >= values.shape[1]:
            return np.full(len(values), np.nan)
        column: Array = values[:, axis]
        return column

    def unit(self, what: str, axis: int) -> str:
        """Return the unit of a signal."""
        units = self.row["input_units"]
        unit = str(units[axis]) if axis < len(units) else "m"
        return unit if what == "input" else axis_unit(unit)


class Archive(Closing):
    """Runs of several libraries, files or fleet databases.

    Parameters
    ----------
    addresses : sequence of str or pathlib.Path
        The files, and ``postgresql://USER@HOST/NAME``; a file that does not exist yet has no runs.

    Raises
    ------
    BadInputError
        If a file is not a library, or a database cannot be read.
    """

    def __init__(self, addresses: Sequence[str | Path] = ()) -> None:
        self.sources = tuple(map(source, addresses))
        self._lock = Lock()
        self._rows: dict[int, tuple[object, list[dict[str, Any]]]] = {}
        self._loaded: OrderedDict[tuple[int, int, str], dict[str, Any]] = OrderedDict()
        try:
            self.rows()
        except BadInputError:
            self.close()
            raise

    def close(self) -> None:
        """Close the connections to databases."""
        for one in self.sources:
            one.close()

    def rows(self) -> list[dict[str, Any]]:
        """Return the runs of all libraries, oldest first; ``library`` is the number of the source.

        One that has not changed is not read again.
        """
        with self._lock:
            return [row for number in range(len(self.sources)) for row in self._rows_of(number)]

    def campaign(
        self, cell: str, campaign: str | None = None, digest: str | None = None
    ) -> list[dict[str, Any]]:
        """Return the runs of a campaign of a cell, chosen as by `campaign_of`."""
        return campaign_of(self.rows(), cell, campaign, digest)

    def load(self, key: tuple[int, int]) -> StoredRun:
        """Return a run with its signals.

        Raises
        ------
        BadInputError
            If there is no such run any more.
        """
        number, run = key
        if not 0 <= number < len(self.sources):
            message = f"library {number}: there are {len(self.sources)}"
            raise BadInputError(message)
        row = next((row for row in self.rows() if (row["library"], row["id"]) == key), None)
        if row is None:
            message = f"{self.sources[number].name}: no run {run} any more"
            raise BadInputError(message)
        cached = (number, run, str(row["digest"]))
        with self._lock:
            if cached not in self._loaded:
                self._loaded[cached] = self.sources[number].load(run)
                while len(self._loaded) > LOADED_MAX:
                    self._loaded.popitem(last=False)
            self._loaded.move_to_end(cached)
            return StoredRun(key, self._loaded[cached])

    def why_not(self, key: tuple[int, int]) -> str | None:
        """Return in words why a run cannot be read; None if it can."""
        try:
            self.load(key)
        except BadInputError as error:
            return str(error)
        return None

    def capture(self, cell: str, campaign: str | None) -> Capture | None:
        """Return the signals of the newest stored run of a campaign, as if they had been heard."""
        try:
            rows = self.campaign(cell, campaign)
            if not rows:
                return None
            run = self.load((rows[-1]["library"], rows[-1]["id"])).row
        except BadInputError:
            # Deleted or replaced meanwhile: the next run brings another one.
            return None
        captured = Capture(int(run["index"]), int(run["n_axes"]))
        # The error is that of the measurement that is learned from.
        measured = run["reference_m"] - run["error_m"]
        values = np.stack((run["reference_m"], measured, run["input"]), axis=1)
        captured.put(np.arange(len(values)), values)
        return captured

    def flight(self, cell: str, rows: Sequence[dict[str, Any]]) -> FlightRecord | None:
        """Return the flight record of the campaign of some rows, from beside their library."""
        for number in {row["library"] for row in rows}:
            path = self.sources[number].path
            record = None if path is None else read_flight(path, cell)
            if record is not None and record.campaign == rows[-1]["campaign"]:
                return record
        return None

    def aligned(self, keys: Sequence[tuple[int, int]], axis: int) -> list[StoredRun]:
        """Return runs on the time of the first one, shifted until their references agree."""
        runs = [self.load(key) for key in keys]
        aligned = runs[:1]
        for run in runs[1:]:
            first = runs[0]
            shift_s, same = shift_of(
                first.signal("command", axis), float(first.row["cycle_s"]),
                run.signal("command", axis), float(run.row["cycle_s"]),
            )  # fmt: skip
            is_same = bool(same >= SAME_MIN)
            aligned.append(StoredRun(run.key, run.row, shift_s if is_same else 0.0, is_same))
        return aligned

    def _rows_of(self, number: int) -> list[dict[str, Any]]:
        stamp = self.sources[number].stamp()
        if stamp is None:
            return []
        kept = self._rows.get(number)
        if kept is None or kept[0] != stamp:
            rows = self.sources[number].rows()
            kept = stamp, [{**row, "library": number} for row in rows]
            self._rows[number] = kept
        return kept[1]


def distance(row: dict[str, Any], current: dict[str, Any]) -> float | None:
    """Return the distance of two runs in their measured disturbances; None without them."""
    a, b = row.get("disturbance"), current.get("disturbance")
    if a is None or b is None or len(np.ravel(a)) != len(np.ravel(b)):
        return None
    return float(np.linalg.norm(np.ravel(a) - np.ravel(b)))


def relevance(rows: Sequence[dict[str, Any]], current: dict[str, Any]) -> list[float]:
    """Return the share of each run in what the current run would be told, as DPW-ILC weighs.

    ``N_j = 1 / (E_j + |d - d_j|^2 + 1e-6)``, with the square of the RMS error in units of its mean
    over these runs and each disturbance in units of its standard deviation; normalised to a sum of
    1. `Library.trim` keeps runs by the same measure. A run whose error has no finite square has no
    share.
    """
    with np.errstate(over="ignore"):
        squares = np.square([_number(row["tracking_rms_m"]) for row in rows])
    good = np.isfinite(squares)
    mean = float(squares[good].mean()) if good.any() else 0.0
    sums = squares / mean if mean > 0.0 else np.zeros(len(rows))
    there = [row for row in (*rows, current) if row.get("disturbance") is not None]
    widths = {len(np.ravel(row["disturbance"])) for row in there}
    if len(there) == len(rows) + 1 and len(widths) == 1:
        places = np.array([np.ravel(row["disturbance"]) for row in rows], dtype=float)
        spread = places.std(axis=0)
        spread[spread == 0.0] = 1.0
        away = (places - np.ravel(current["disturbance"])) / spread
        sums = sums + (away**2).sum(axis=1)
    weights = np.where(good, 1.0 / (sums + 1e-6), 0.0)
    shares: list[float] = (weights / weights.sum()).tolist() if good.any() else [0.0] * len(rows)
    return shares


def _number(value: object) -> float:
    """Return a figure of a run, NaN if it has none."""
    return float(value) if isinstance(value, (int, float)) else math.nan
