"""Comparison of several results in a table: by how much, and after how many runs."""

from __future__ import annotations

import html
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.quantity import digits, signed, unit_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ilc_rt.result import CampaignResult

__all__ = ["Compared", "compare"]

# Share of the first error at which learning counts as nearly finished.
NEARLY = 0.1


@dataclass(frozen=True)
class Compared:
    """Figures of several results, one row each.

    Attributes
    ----------
    figure : str
        Figure that is compared.
    unit : str
        Its unit.
    rows : tuple of dict
        ``name``, ``runs``, ``first``, ``best``, ``last``, and ``runs_to_tenth``: number of the
        first run below a tenth of the first error, or None.

    Examples
    --------
    >>> print(Compared("tracking_rms_m", "m", ({"name": "P", "runs": 3, "first": 1e-3, "best": 1e-4,
    ...     "last": 1e-4, "runs_to_tenth": 2},)))
    result  runs  first in µm  best in µm  last in µm  change   run below 10 %
    P          3         1000         100         100  -90.0 %               2
    """

    figure: str
    unit: str
    rows: tuple[dict[str, Any], ...]

    def to_dataframe(self) -> Any:  # noqa: ANN401 (pandas is optional)
        """Return the rows as a table of pandas, by the name of the result.

        Returns
        -------
        pandas.DataFrame
            One row per result.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return import_module("pandas").DataFrame(list(self.rows)).set_index("name")

    def __str__(self) -> str:
        """Return the rows as a table of text."""
        lines = [self._head(), *map(self._cells, self.rows)]
        widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
        return "\n".join(
            "  ".join(
                cell.ljust(width) if column in {0, 5} else cell.rjust(width)
                for column, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        )

    def _repr_html_(self) -> str:
        """Return the rows as a table, for a notebook."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self._head())
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in self._cells(row)) + "</tr>"
            for row in self.rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def _scale(self) -> Any:  # noqa: ANN401 (a unit)
        return unit_for(self.unit, max((row["first"] for row in self.rows), default=0.0))

    def _head(self) -> list[str]:
        symbol = self._scale().symbol
        of = f" in {symbol}" if symbol else ""
        return [
            "result", "runs", *(f"{name}{of}" for name in ("first", "best", "last")), "change",
            f"run below {NEARLY:.0%}".replace("%", " %"),
        ]  # fmt: skip

    def _cells(self, row: dict[str, Any]) -> list[str]:
        scale = self._scale().scale
        errors = [digits(row[name] * scale) for name in ("first", "best", "last")]
        reached = "-" if row["runs_to_tenth"] is None else str(row["runs_to_tenth"])
        change = signed(row["first"], row["last"])
        return [str(row["name"]), str(row["runs"]), *errors, change, reached]


def compare(results: Mapping[str, CampaignResult], figure: str = "tracking_rms_m") -> Compared:
    """Compare several results by an error: first, best and last, and how fast it fell.

    Parameters
    ----------
    results : mapping of str to TrialResult or CampaignResult
        Results by their labels.
    figure : str
        Figure that is compared, of `ilc_rt.figures.Figures`.

    Returns
    -------
    Compared
        A row per result, in their order.

    Raises
    ------
    ValueError
        If there is no result, or one has no run with this figure.
    TypeError
        If the results are not a mapping of results.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, compare, simulate
    >>> results = {kp: simulate([0.0, 1.0], PdIlc(kp=kp), np.ones(9)) for kp in (0.5, 0.9)}
    >>> [row["runs_to_tenth"] for row in compare(results).rows]
    [None, None]
    """
    if not hasattr(results, "items"):
        message = f"results is a {type(results).__name__}; a mapping of labels to results is needed"
        raise TypeError(message)
    if not results:
        message = "results: at least one is needed"
        raise ValueError(message)
    rows = []
    units = set()
    for name, result in results.items():
        if not hasattr(result, "records"):
            message = f"{name}: a {type(result).__name__}; a result is needed"
            raise TypeError(message)
        # Runs that only measured something for the law are no results.
        counted = [r for r in result.records if not r.phase]
        errors = np.array(
            [np.nan if (v := getattr(r, str(figure), None)) is None else v for r in counted]
        )
        if not errors.size or errors.dtype.kind not in "iuf" or not np.isfinite(errors).all():
            message = f"{name}: not every run has the figure {figure!r}"
            raise ValueError(message)
        units.add(result.axis_unit(0))
        below = np.flatnonzero(errors < NEARLY * errors[0])
        rows.append(
            {
                "name": str(name),
                "runs": len(result.records),
                "first": float(errors[0]),
                "best": float(errors.min()),
                "last": float(errors[-1]),
                "runs_to_tenth": int(counted[below[0]].index) if below.size else None,
            }
        )
    if len(units) > 1:
        message = f"results: of different units, {', '.join(sorted(units))}"
        raise ValueError(message)
    return Compared(str(figure), units.pop(), tuple(rows))
