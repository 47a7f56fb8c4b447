"""`ilc library`: the stored runs, and their export."""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table
from typer import Typer

from ilc_rt.commands.options import (
    DEFAULT_LIBRARY_FILE,
    LibraryArgument,
)
from ilc_rt.errors import BadInputError
from ilc_rt.library import Library
from ilc_rt.quantity import axis_unit, unit_for
from ilc_rt.result import STANDARD_OUTPUT, json_text, library_rows, write_text
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Mapping

# The last columns are shown if there is space; the campaign's name is its start time.
COLUMNS = (
    "id", "campaign", "run", "cell", "law", "max tracking", "max contour",
    "note", "learned from", "created (UTC)",
)  # fmt: skip
N_NARROW = 8
RIGHT = ("id", "run", "max tracking", "max contour")
# Columns that may be shortened, and their minimum widths.
SHORTENED = {COLUMNS.index("note"): 11, COLUMNS.index("cell"): 6, COLUMNS.index("law"): 6}
WIDE = 140

app = Typer(
    no_args_is_help=True,
    help="List, show, export and trim the runs in a library.",
)

# Displayed characters of a program or of a law's parameters; `export` writes them completely.
LENGTH_SHOWN = 2000

RunId = Annotated[int, typer.Argument(metavar="ID", help="Number of the run in the library.")]
CellName = Annotated[str | None, typer.Option("--cell", metavar="NAME", help="Only this cell's.")]
CampaignOption = Annotated[
    str | None, typer.Option("--campaign", metavar="ID", help="Only this campaign's.")
]
Keep = Annotated[
    int, typer.Argument(min=0, max=2**63 - 1, metavar="KEEP", help="How many runs stay.")
]
JsonRows = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Write the runs as JSON; - is standard output."),
]
CsvRows = Annotated[
    Path | None,
    typer.Option("--csv", metavar="FILE", help="Write the runs as CSV; - is standard output."),
]
ExportFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="The file; .npz, .csv or .json says the format.")
]


@app.command("list")
def list_runs(
    library: LibraryArgument = DEFAULT_LIBRARY_FILE,
    cell: CellName = None,
    campaign: CampaignOption = None,
    json_file: JsonRows = None,
    csv_file: CsvRows = None,
) -> None:
    """List the runs, one per line.

    Example: ilc library list ilc-library.db --cell gantry
    """
    rows = library_rows(library, cell)
    if campaign is not None:
        rows = [row for row in rows if str(row["campaign"]).startswith(campaign)]
    if json_file is not None:
        write_text(json_file, json_text(rows))
    if csv_file is not None:
        write_text(csv_file, _csv(rows))
    if STANDARD_OUTPUT in {json_file, csv_file}:
        return
    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = WIDE
    console.print(_table(rows, console.width))
    console.print(f"{len(rows)} run{'' if len(rows) == 1 else 's'} in {library}", soft_wrap=True)


def _table(rows: list[dict[str, Any]], width: int) -> Table:
    """Return the runs as a table with the columns that `show` and `export` need at any width."""
    texts = [
        (
            str(row["id"]), printable(row["campaign"]), str(row["index"]), printable(row["cell"]),
            printable(row["law"]), error_text(row, "tracking_inf_m"),
            error_text(row, "contour_inf_m"), note(row), printable(row["measure"]),
            printable(row["created_utc"]),
        )
        for row in rows
    ]  # fmt: skip
    count = len(COLUMNS) if width >= WIDE else N_NARROW
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 0))
    names = COLUMNS[:count]
    wanted = [
        max([len(name), *(len(text[column]) for text in texts)])
        for column, name in enumerate(names)
    ]
    # Names are shortened, the longest first; a column is followed by two blanks.
    excess = sum(wanted) + 2 * count - width
    for column in sorted(SHORTENED, key=lambda column: -wanted[column]):
        cut = max(0, min(excess, wanted[column] - SHORTENED[column]))
        wanted[column] -= cut
        excess -= cut
    for name, size in zip(names, wanted, strict=True):
        right = name in RIGHT
        table.add_column(
            name, justify="right" if right else "left", no_wrap=True, width=size,
            overflow="ellipsis",
        )  # fmt: skip
    for text in texts:
        table.add_row(*text[:count])
    return table


def _csv(rows: list[dict[str, Any]]) -> str:
    """Return the runs as CSV; lists within a field are JSON."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = list(rows[0]) if rows else ["id"]
    writer.writerow(names)
    for row in rows:
        writer.writerow(
            json.dumps(row[name]) if isinstance(row[name], list) else row[name] for name in names
        )
    return text.getvalue()


@app.command("show")
def show(library: LibraryArgument, run_id: RunId) -> None:
    """Show everything that is kept of one run.

    Example: ilc library show ilc-library.db 12
    """
    import numpy as np  # only here: the program starts without it

    row = _load(library, run_id)
    for key, value in row.items():
        if key == "disturbance" and value is not None:
            typer.echo(f"{key:22} {', '.join(f'{number:g}' for number in value)}")
        elif isinstance(value, float) and key.endswith(("_inf_m", "_rms_m")):
            typer.echo(f"{key:22} {value:.6g}, {error_text(row, key)}")
        elif isinstance(value, np.ndarray):
            size = " x ".join(str(length) for length in value.shape)
            largest = float(np.abs(value).max(initial=0.0))
            typer.echo(f"{key:22} {size} samples, largest {largest:.6g}")
        else:
            shown = "-" if value is None else printable(value, LENGTH_SHOWN)
            typer.echo(f"{key:22} {shown}")


@app.command("export")
def export(library: LibraryArgument, run_id: RunId, file: ExportFile) -> None:
    """Write one run to a file: .npz and .json hold all, .csv the signals.

    Example: ilc library export ilc-library.db 12 run12.csv
    """
    from ilc_rt.export import export_run

    export_run(_load(library, run_id), file)
    typer.echo(f"run {run_id} written to {printable(file)}")


@app.command("trim")
def trim(library: LibraryArgument, keep: Keep, cell: CellName = None) -> None:
    """Delete all but the most relevant runs: small errors, spread over disturbances.

    Example: ilc library trim ilc-library.db 500 --cell gantry
    """
    n_runs = len(library_rows(library))
    try:
        deleted = Library(str(library)).trim(min(keep, n_runs), cell)
    except OSError as error:
        raise BadInputError(str(error)) from error
    typer.echo(f"{deleted} run{'' if deleted == 1 else 's'} deleted from {library}")


def error_text(row: Mapping[str, Any], figure: str) -> str:
    """Return a figure of a run in the unit of its axes: angles if all axes are rotary."""
    units = {axis_unit(str(unit)) for unit in row["input_units"]}
    base = "rad" if units == {"rad"} else "m"
    return unit_for(base, row[figure]).text(row[figure])


def note(row: Mapping[str, Any]) -> str:
    """Return the outcome of a run in a few words."""
    said = ("rolled back", row["rolled_back"]), ("learning off", row["learning_off"])
    words = [str(row["phase"])] if row["phase"] else []
    return ", ".join(words + [outcome for outcome, holds in said if holds])


def _load(library: Path, run_id: int) -> dict[str, Any]:
    known = {int(row["id"]) for row in library_rows(library)}
    if run_id not in known:
        there = f"{min(known)} to {max(known)}" if known else "none"
        message = f"{library}: no run {run_id}; there are {there}"
        raise BadInputError(message)
    return dict(Library(str(library)).load(run_id))
