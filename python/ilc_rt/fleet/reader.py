"""A fleet database that is only read: `FleetLibrary`, for dashboards and evaluation."""

from __future__ import annotations

import json
from dataclasses import MISSING, fields
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.closing import Closing
from ilc_rt.errors import BadInputError
from ilc_rt.figures import Figures
from ilc_rt.fleet.database import connect, told
from ilc_rt.library_file import ARRAYS
from ilc_rt.retention import selected

if TYPE_CHECKING:
    import builtins
    from collections.abc import Iterator


LISTED = """
SELECT id, created_utc, cell, campaign, iteration, law, measure, n_samples, n_axes, cycle_s,
    axis_names::text, input_units::text, disturbance::text, figures::text, digest,
    fingerprint IS NOT NULL FROM run
WHERE (%(cell)s::text IS NULL OR cell = %(cell)s)
    AND (%(campaign)s::text IS NULL OR starts_with(campaign, %(campaign)s))
ORDER BY id LIMIT %(limit)s OFFSET %(offset)s
"""
CAMPAIGNS = """
SELECT cell, campaign, min(law), count(*), count(fingerprint), min(created_utc), max(created_utc),
    min((figures ->> 'tracking_rms_m')::double precision)
FROM run WHERE %(cell)s::text IS NULL OR cell = %(cell)s GROUP BY cell, campaign
ORDER BY max(created_utc), cell, campaign
"""


class FleetLibrary(Closing):
    """The runs of many cells in one PostgreSQL database, read as a library is.

    Parameters
    ----------
    address : str
        ``postgresql://USER@HOST/NAME``.

    Raises
    ------
    BadInputError
        If it cannot be reached, or has no tables of a fleet.

    Examples
    --------
    >>> FleetLibrary("fleet.db")
    Traceback (most recent call last):
      ...
    ilc_rt.errors.BadInputError: fleet.db: postgresql://USER@HOST/NAME is the address of a database
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self._connection = connect(address, read_only=True)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    @property
    def is_open(self) -> bool:
        """False after `close`, or when the connection was lost."""
        return not (self._connection.closed or self._connection.broken)

    def stamp(self) -> tuple[int, int]:
        """Return two numbers, one of which changes with each run that is stored or changed."""
        runs, changes = self._rows("SELECT count(*), sum(xmin::text::bigint) FROM run")[0]
        return int(runs), int(changes or 0)

    def __len__(self) -> int:
        """Return the number of stored runs."""
        return int(self._rows("SELECT count(*) FROM run")[0][0])

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the stored runs, in the order of their arrival."""
        return iter(self.list())

    def cells(self) -> builtins.list[str]:
        """Return the names of all cells, in the order of the alphabet."""
        return [row[0] for row in self._rows("SELECT DISTINCT cell FROM run ORDER BY cell")]

    def campaigns(self, cell: str | None = None) -> builtins.list[dict[str, Any]]:
        """Return the campaigns, those with the newest run last.

        Parameters
        ----------
        cell : str or None
            Only those of the cell of this name.

        Returns
        -------
        list of dict
            ``cell``, ``campaign``, ``law``, ``runs``, ``with_signals`` (runs whose arrays are
            there), ``first_utc``, ``last_utc``, ``best_tracking_rms_m``.
        """
        names = (
            "cell", "campaign", "law", "runs", "with_signals", "first_utc", "last_utc",
            "best_tracking_rms_m",
        )  # fmt: skip
        rows = self._rows(CAMPAIGNS, {"cell": cell})
        return [dict(zip(names, row, strict=True)) for row in rows]

    def list(self, cell: str | None = None) -> builtins.list[dict[str, Any]]:
        """Return the runs of one cell or of all, in the order of their arrival, without arrays.

        Returns
        -------
        list of dict
            The keys of `Library.list`, and ``has_signals``: False for a run that is known from its
            event alone, and that sync has not brought yet.
        """
        return self.page(cell)

    def page(
        self,
        cell: str | None = None,
        campaign: str | None = None,
        limit: int | None = None,
        offset: int = 0,
    ) -> builtins.list[dict[str, Any]]:
        """Return a part of the runs, as `Library.page` does.

        Raises
        ------
        BadInputError
            If limit or offset is negative.
        """
        for key, value in (("limit", limit), ("offset", offset)):
            if value is not None and value < 0:
                message = f"{key} = {value}: a number of runs, 0 or more"
                raise BadInputError(message)
        wanted = {"cell": cell, "campaign": campaign, "limit": limit, "offset": offset}
        return [_described(row) for row in self._rows(LISTED, wanted)]

    def select(self, **wanted: Any) -> builtins.list[dict[str, Any]]:  # noqa: ANN401 (any key)
        """Return the runs whose entries have wanted values, as `Library.select` does."""
        return selected(self.page(wanted.get("cell")), wanted)

    def to_dataframe(self, **wanted: Any) -> Any:  # noqa: ANN401 (pandas is optional)
        """Return the runs as a table of pandas, one row per run; `wanted` as for `select`."""
        table = import_module("pandas").DataFrame(self.select(**wanted))
        return table.set_index("id") if len(table) else table

    def load(self, id: int) -> dict[str, Any]:
        """Return a run with its arrays, as `Library.load` does.

        Raises
        ------
        BadInputError
            If there is no such run, or its arrays have not been brought yet.
        """
        query = (
            f"SELECT {', '.join(ARRAYS)}, program, law_parameters FROM run "
            "JOIN signals ON signals.run = run.id "
            "JOIN provenance ON provenance.digest = run.provenance WHERE run.id = %(id)s"
        )
        listed = self._rows(LISTED.replace("WHERE", "WHERE id = %(id)s AND"), _one(id))
        if not listed:
            message = f"id = {id}: no such run"
            raise BadInputError(message)
        run = _described(listed[0])
        found = self._rows(query, {"id": id})
        if not found:
            message = f"id = {id}: known from its event alone; `ilc library sync` brings its arrays"
            raise BadInputError(message)
        *arrays, program, law_parameters = found[0]
        for name, array in zip(ARRAYS, arrays, strict=True):
            signal = None if array is None else np.frombuffer(array, "<f8").astype(float)
            if signal is not None and name != "contour_m":
                signal = signal.reshape(-1, run["n_axes"])
            run[name] = signal
        if run["contour_inf_m"] is None or not len(run["contour_m"]):
            run["contour_m"] = None
        if run["disturbance"] is not None:
            run["disturbance"] = np.asarray(run["disturbance"], float)
        return run | {"program": program, "law_parameters": law_parameters}

    def _rows(self, query: str, values: dict[str, Any] | None = None) -> builtins.list[Any]:
        with told(self.address):
            return self._connection.execute(query.encode(), values).fetchall()


def _one(id_: int) -> dict[str, Any]:
    return {"id": id_, "cell": None, "campaign": None, "limit": 1, "offset": 0}


def _described(row: Any) -> dict[str, Any]:  # noqa: ANN401 (a row of any columns)
    names = (
        "id", "created_utc", "cell", "campaign", "index", "law", "measure", "n_samples", "n_axes",
        "cycle_s",
    )  # fmt: skip
    axis_names, input_units, disturbance, figures, digest, has_signals = row[len(names) :]
    run: dict[str, Any] = dict(zip(names, row, strict=False))
    run |= {"axis_names": json.loads(axis_names), "input_units": json.loads(input_units)}
    run["disturbance"] = None if disturbance is None else json.loads(disturbance)
    stored = json.loads(figures)
    for figure in fields(Figures):
        value = stored.get(figure.name)
        if value is None and figure.default is not MISSING:
            value = list(figure.default) if figure.default == () else figure.default
        run[figure.name] = value
    return run | {"digest": digest, "has_signals": has_signals}
