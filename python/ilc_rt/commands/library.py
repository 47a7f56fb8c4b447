"""`ilc library`: what past runs are kept, and how to take them out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.table import Table
from typer import Typer

from ilc_rt._native import Library
from ilc_rt.commands.options import (
    DEFAULT_LIBRARY_FILE,
    LibraryArgument,
)
from ilc_rt.errors import BadInputError
from ilc_rt.export import export_run
from ilc_rt.quantity import unit_for
from ilc_rt.result import library_rows
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Mapping

app = Typer(
    no_args_is_help=True,
    help="List, show, export and trim the runs in a library.",
)

# Characters of a program or of a law's parameters that are shown; `export` gives all of them.
LENGTH_SHOWN = 2000

RunId = Annotated[int, typer.Argument(metavar="ID", help="Number of the run in the library.")]
CellName = Annotated[str | None, typer.Option("--cell", metavar="NAME", help="Only this cell's.")]
CampaignOption = Annotated[
    str | None, typer.Option("--campaign", metavar="ID", help="Only this campaign's.")
]
Keep = Annotated[
    int, typer.Argument(min=0, max=2**63 - 1, metavar="KEEP", help="How many runs stay.")
]
ExportFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="The file; .npz, .csv or .json says the format.")
]


@app.command("list")
def list_runs(
    library: LibraryArgument = DEFAULT_LIBRARY_FILE,
    cell: CellName = None,
    campaign: CampaignOption = None,
) -> None:
    """List the runs, one a line.

    Example: ilc library list ilc-library.db --cell gantry
    """
    rows = library_rows(library, cell)
    if campaign is not None:
        rows = [row for row in rows if str(row["campaign"]).startswith(campaign)]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("id", "campaign", "cell", "run", "law", "learned from", "max tracking",
                 "max contour", "note", "created (UTC)"):  # fmt: skip
        right = name in {"id", "run"} or name.startswith("max")
        table.add_column(name, justify="right" if right else "left", no_wrap=True)
    for row in rows:
        table.add_row(
            str(row["id"]), printable(row["campaign"]), printable(row["cell"]), str(row["index"]),
            printable(row["law"]), printable(row["measure"]), error_text(row, "tracking_inf_m"),
            error_text(row, "contour_inf_m"), note(row), printable(row["created_utc"]),
        )  # fmt: skip
    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = 200
    console.print(table)
    console.print(f"{len(rows)} run{'' if len(rows) == 1 else 's'} in {library}")


@app.command("show")
def show(library: LibraryArgument, run_id: RunId) -> None:
    """Show everything that is kept of one run.

    Example: ilc library show ilc-library.db 12
    """
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
    export_run(_load(library, run_id), file)
    typer.echo(f"run {run_id} written to {file}")


@app.command("trim")
def trim(library: LibraryArgument, keep: Keep, cell: CellName = None) -> None:
    """Delete all but the most relevant runs: small errors, spread over disturbances.

    Example: ilc library trim ilc-library.db 500 --cell gantry
    """
    library_rows(library)
    try:
        deleted = Library(str(library)).trim(keep, cell)
    except OSError as error:
        raise BadInputError(str(error)) from error
    typer.echo(f"{deleted} run{'' if deleted == 1 else 's'} deleted from {library}")


def error_text(row: Mapping[str, Any], figure: str) -> str:
    """Return a figure of a run in the unit of its axes: angles where all axes are rotary."""
    units = {str(unit).removesuffix("/s") for unit in row["input_units"]}
    base = "rad" if units == {"rad"} else "m"
    return unit_for(base, row[figure]).text(row[figure])


def note(row: Mapping[str, Any]) -> str:
    """Return what became of a run in a few words."""
    said = ("rolled back", row["rolled_back"]), ("learning off", row["learning_off"])
    return ", ".join(words for words, holds in said if holds)


def _load(library: Path, run_id: int) -> dict[str, Any]:
    known = {int(row["id"]) for row in library_rows(library)}
    if run_id not in known:
        there = f"{min(known)} to {max(known)}" if known else "none"
        message = f"{library}: no run {run_id}; there are {there}"
        raise BadInputError(message)
    return dict(Library(str(library)).load(run_id))
