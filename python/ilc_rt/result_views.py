"""Views of a result: figures as arrays, a table of pandas, a page of a notebook, pictures.

The base of every result with runs; imported by `ilc_rt.result` alone.
"""

from __future__ import annotations

import html
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt.record import IterationRecord

# Figures that are neither numbers nor truth values, or one per axis.
TEXTS = ("digest", "remark")


class Views:
    """Views of the runs in `records`, whichever way they were made."""

    __slots__ = ()
    records: list[IterationRecord]

    def figures(self) -> dict[str, NDArray[Any]]:
        """Return the figures of the runs as arrays by name.

        Returns
        -------
        dict of ndarray
            Shape (n_runs,), or (n_runs, n_axes) for a figure of each axis; NaN where there is none.

        Examples
        --------
        >>> import numpy as np
        >>> from ilc_rt import PdIlc, simulate
        >>> figures = simulate([0.0, 1.0], PdIlc(kp=0.5), np.ones(4), trials=2).figures()
        >>> figures["index"], figures["tracking_inf_m"]
        (array([0, 1]), array([1., 1.]))
        """
        rows = [record.figures() for record in self.records]
        return {name: _column([row[name] for row in rows]) for name in (rows[0] if rows else {})}

    def to_dataframe(self) -> Any:  # noqa: ANN401 (pandas is optional)
        """Return the figures as a table of pandas, one row per run.

        Returns
        -------
        pandas.DataFrame
            Figures of each axis in a column each, ``axes_tracking_inf_m[0]`` ...

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        pandas = import_module("pandas")
        columns: dict[str, NDArray[Any]] = {}
        for name, values in self.figures().items():
            if values.ndim == 1:
                columns[name] = values
            else:
                columns |= {f"{name}[{axis}]": part for axis, part in enumerate(values.T)}
        return pandas.DataFrame(columns).set_index("index")

    def plot(self, ax: Any = None, **options: Any) -> Any:  # noqa: ANN401 (matplotlib is slow to import)
        """Draw the errors against the number of the run.

        Parameters
        ----------
        ax : matplotlib.axes.Axes or None
            Axes to draw into; None for new ones.
        **options
            As for `ilc_rt.pictures.errors`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn into.
        """
        return import_module("ilc_rt.pictures").errors(self, ax=ax, **options)

    def _repr_html_(self) -> str:
        """Return the sentence and the table of the runs, for a notebook."""
        shown: Any = self
        said = html.escape(shown.sentence())
        if not self.records:
            return f"<p>{said}</p>"
        comparison = shown.comparison
        columns = comparison.errors()
        head = "".join(f"<th>{html.escape(column.heading)}</th>" for column in columns)
        body = "".join(
            f"<tr><td>{record.index}</td>"
            + "".join(f"<td>{column.cell(record)}</td>" for column in columns)
            + "</tr>"
            for record in self.records
        )
        return (
            f"<p>{said}</p><table><thead><tr><th>run</th>{head}</tr></thead>"
            f"<tbody>{body}</tbody></table>"
        )


def _column(values: list[Any]) -> NDArray[Any]:
    import numpy as np  # only here: the program `ilc` starts without it

    if any(isinstance(value, str) for value in values):
        return np.array(["" if value is None else value for value in values], dtype=object)
    if any(isinstance(value, (tuple, list)) for value in values):
        width = max(len(value) for value in values)
        rows = [[*value, *[np.nan] * (width - len(value))] for value in values]
        return np.array(rows, dtype=np.float64)
    if any(value is None for value in values):
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
    return np.array(values)
