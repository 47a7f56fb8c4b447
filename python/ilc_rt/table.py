"""The table of runs that the terminal shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from ilc_rt.result import micrometres, reduction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ilc_rt.record import IterationRecord

HEAD = (
    ("run", 3),
    ("max tracking µm", 8),
    ("RMS tracking µm", 8),
    ("max contour µm", 8),
    ("reduced by", 7),
    ("overruns", 8),
    ("learning ms", 8),
)


def run_cells(record: IterationRecord, first: IterationRecord) -> tuple[str, ...]:
    """Return the cells of one run; `first` is what it is compared with."""
    if first.contour_inf_m and record.contour_inf_m:
        change = reduction(first.contour_inf_m, record.contour_inf_m)
    else:
        change = reduction(first.tracking_inf_m, record.tracking_inf_m)
    return (
        str(record.index),
        micrometres(record.tracking_inf_m),
        micrometres(record.tracking_rms_m),
        micrometres(record.contour_inf_m),
        "" if record.index == first.index else f"{change:.1f} %",
        str(record.overruns),
        "-" if record.update_ms is None else f"{record.update_ms:.2f}",
    )


def runs_table(records: Sequence[IterationRecord]) -> Table:
    """Return a table with one row a run."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name, width in HEAD:
        table.add_column(name, justify="right", min_width=width)
    for record in records:
        style = "yellow" if record.rolled_back else ""
        table.add_row(*run_cells(record, records[0]), style=style)
    return table


def plain_line(cells: Sequence[str]) -> str:
    """Return cells as one line of fixed columns, for a file or a pipe.

    Examples
    --------
    >>> plain_line(("0", "812", "303", "97.1", "", "0", "0.12"))
    '  0              812              303            97.1                     0         0.12'
    """
    widths = [max(width, len(name)) for name, width in HEAD]
    return "  ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()
