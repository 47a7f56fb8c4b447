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
# Widths of a terminal below which columns are left out.
WIDE, NARROW = 104, 60


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


def runs_table(
    comparison: Comparison, *, newest: int | None = None, width: int | None = None
) -> Table:
    """Return a table with one row per run.

    `newest` limits it to the first run and the last ones, `width` to the columns that fit so many
    characters: always the compared error, its change and the outcome.
    """
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    names = headings(comparison)
    kept = _fitting(comparison, names, width)
    for name in (names[k] for k in kept):
        if name:
            least = WIDTHS.get(name, ERROR_WIDTH) if width is None or width >= WIDE else None
            table.add_column(name, justify="right", min_width=least)
        else:
            table.add_column(name, no_wrap=width is not None)
    records = comparison.records
    if newest is not None and len(records) > newest:
        records = [records[0], *records[len(records) - newest + 1 :]]
    for record in records:
        style = "yellow" if record.rolled_back else ""
        cells = run_cells(comparison, record)
        table.add_row(*(cells[k] for k in kept), style=style)
    return table


def _fitting(comparison: Comparison, names: Sequence[str], width: int | None) -> list[int]:
    """Return the columns that are shown at a width."""
    kept = [k for k, name in enumerate(names) if name or any(map(note, comparison.records))]
    if width is not None and width < WIDE:
        kept = [k for k in kept if not names[k].startswith(("RMS", "learning"))]
    if width is not None and width < NARROW:
        what = "max contour" if comparison.by_contour else "max tracking"
        error = next(k for k, name in enumerate(names) if name.startswith(what))
        kept = [k for k in kept if k == error or names[k] in {"run", "change", ""}]
    return kept


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
