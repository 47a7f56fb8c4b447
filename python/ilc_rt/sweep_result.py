"""Result of a sweep: its cases and values as arrays, a table, or a Parquet file."""

from __future__ import annotations

import hashlib
import html
import json
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

ROWS_SHOWN = 20


@dataclass(frozen=True, eq=False)
class SweepResult:
    """Cases of a sweep and what the function returned for each.

    Attributes
    ----------
    cases : tuple of dict
        Keywords of each case.
    values : list
        What the function returned, in the order of the cases.
    seed : int
        Seed of the sweep.

    Examples
    --------
    >>> result = SweepResult(({"a": 1.0}, {"a": 2.0}), [{"b": 3.0}, {"b": 4.0}], seed=0)
    >>> result.arrays()
    {'a': array([1., 2.]), 'b': array([3., 4.])}
    """

    cases: tuple[dict[str, Any], ...]
    values: list[Any]
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse results that are not one for each case."""
        if not isinstance(self.values, list) or len(self.values) != len(self.cases):
            message = f"values = {self.values!r}; a list with one entry for each case is needed"
            raise TypeError(message)

    def __len__(self) -> int:
        """Return the number of cases."""
        return len(self.cases)

    def rows(self) -> list[dict[str, Any]]:
        """Return keywords and results of each case in one dict; a bare result is ``value``."""
        return [
            {**case, **(value if isinstance(value, dict) else {"value": value})}
            for case, value in zip(self.cases, self.values, strict=True)
        ]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return keywords and results as arrays by name, the first axis being the case.

        Returns
        -------
        dict of ndarray
            NaN where a case has no such number; of dtype object if the entries are not numbers
            of one shape.
        """
        rows = self.rows()
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: _column([row.get(name) for row in rows]) for name in names}

    def to_dataframe(self) -> Any:  # noqa: ANN401 (pandas is optional)
        """Return keywords and results as a table of pandas, one row per case.

        Returns
        -------
        pandas.DataFrame
            One column per name.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return import_module("pandas").DataFrame(self.rows())

    def to_parquet(self, path: str | PathLike[str]) -> None:
        """Write keywords and results to a Parquet file, one row per case.

        Parameters
        ----------
        path : path
            The file.

        Raises
        ------
        ImportError
            If pyarrow is not installed.
        OSError
            If the file cannot be written.
        """
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        names = dict.fromkeys(name for row in self.rows() for name in row)
        columns = {name: [_listed(row.get(name)) for row in self.rows()] for name in names}
        parquet.write_table(arrow.table(columns), path)

    @property
    def digest(self) -> str:
        """SHA-256 of all results: equal exactly if they are the same bit by bit."""
        text = json.dumps([_listed(value) for value in self.values], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def __repr__(self) -> str:
        """Return the number of cases and the names."""
        names = ", ".join(dict.fromkeys(name for row in self.rows()[:1] for name in row))
        return f"SweepResult({len(self)} cases: {names})"

    def _repr_html_(self) -> str:
        """Return the first rows as a table, for a notebook."""
        rows = self.rows()
        names = list(dict.fromkeys(name for row in rows[:ROWS_SHOWN] for name in row))
        head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
        body = "".join(
            "<tr>" + "".join(f"<td>{_cell(row.get(name))}</td>" for name in names) + "</tr>"
            for row in rows[:ROWS_SHOWN]
        )
        rest = f"<p>{len(rows)} cases</p>" if len(rows) > ROWS_SHOWN else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{rest}"


def _column(values: list[Any]) -> NDArray[Any]:
    known = [value for value in values if value is not None]
    is_number = all(isinstance(value, (int, float, np.number)) for value in known)
    if known and is_number:
        if len(known) < len(values):
            return np.array([np.nan if v is None else v for v in values], dtype=np.float64)
        return np.array(values)
    shapes = {np.shape(value) for value in known if isinstance(value, np.ndarray)}
    if len(shapes) == 1 and len(known) == len(values) and () not in shapes:
        return np.stack(values)
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column


def _listed(value: object) -> Any:  # noqa: ANN401 (a value of JSON)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {name: _listed(part) for name, part in value.items()}
    return value.item() if isinstance(value, np.generic) else value


def _cell(value: object) -> str:
    return html.escape(f"{value:.6g}" if isinstance(value, float) else str(value)[:60])
