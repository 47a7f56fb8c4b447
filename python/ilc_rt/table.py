"""The table of runs in the terminal, and its plain lines for a file or a pipe."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from ilc_rt.comparison import Comparison, note
from ilc_rt.quantity import digits, signed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ilc_rt.comparison import Column
    from ilc_rt.record import IterationRecord

# Minimum widths of columns, so that the layout stays fixed while runs arrive.
WIDTHS = {"run": 3, "change": 8, "overruns": 8, "learning ms": 8}
ERROR_WIDTH = 8


def headings(comparison: Comparison) -> tuple[str, ...]:
    """Return the headings of the columns of a run; the last one, for the outcome, is empty."""
    errors = (column.heading for column in _errors(comparison))
    return ("run", *errors, "change", "overruns", "learning ms", "")


def run_cells(comparison: Comparison, record: IterationRecord) -> tuple[str, ...]:
    """Return the cells of one run."""
    first = comparison.first
    compared = comparison.compared(first), comparison.compared(record)
    return (
        str(record.index),
        *(column.cell(record) for column in _errors(comparison)),
        "" if record.index == first.index or record.phase else signed(*compared),
        str(record.overruns),
        "-" if record.update_ms is None else digits(record.update_ms),
        note(record),
    )


def runs_table(comparison: Comparison) -> Table:
    """Return a table with one row per run."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in headings(comparison):
        if name:
            table.add_column(name, justify="right", min_width=WIDTHS.get(name, ERROR_WIDTH))
        elif any(map(note, comparison.records)):
            table.add_column(name)
    width = len(table.columns)
    for record in comparison.records:
        style = "yellow" if record.rolled_back else ""
        table.add_row(*run_cells(comparison, record)[:width], style=style)
    return table


def plain_line(cells: Sequence[str], names: Sequence[str]) -> str:
    """Return cells as a line of fixed columns, for a file or a pipe.

    Examples
    --------
    >>> plain_line(("0", "812", "rolled back"), ("run", "max tracking µm", ""))
    '  0              812  rolled back'
    """
    widths = [max(WIDTHS.get(name, ERROR_WIDTH), len(name)) for name in names]
    *numbers, last = (cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
    return "  ".join((*numbers, cells[-1] if names[-1] == "" else last)).rstrip()


def _errors(comparison: Comparison) -> list[Column]:
    """Of linear and rotary axes the largest only, for lack of space."""
    columns = comparison.errors(rms=not comparison.is_mixed)
    return [column for column in columns if column.name != "RMS contour"]
