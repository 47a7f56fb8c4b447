"""`ilc library`: what past runs are kept, and how to take them out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

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
from ilc_rt.result import library_rows, micrometres

app = Typer(
    no_args_is_help=True,
    help="List, show and export the runs in a library.",
)

RunId = Annotated[int, typer.Argument(metavar="ID", help="Number of the run in the library.")]
CellName = Annotated[str | None, typer.Option("--cell", metavar="NAME", help="Only this cell's.")]
CampaignOption = Annotated[
    str | None, typer.Option("--campaign", metavar="ID", help="Only this campaign's.")
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
    for name in ("id", "campaign", "cell", "run", "law", "learned from", "max tracking µm",
                 "max contour µm", "created (UTC)"):  # fmt: skip
        right = name in {"id", "run"} or name.endswith("µm")
        table.add_column(name, justify="right" if right else "left", no_wrap=True)
    for row in rows:
        table.add_row(
            str(row["id"]), str(row["campaign"]), str(row["cell"]), str(row["index"]),
            str(row["law"]), str(row["measure"]), micrometres(row["tracking_inf_m"]),
            micrometres(row["contour_inf_m"]), str(row["created_utc"]),
        )  # fmt: skip
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 200
    console.print(table)
    console.print(f"{len(rows)} run{'' if len(rows) == 1 else 's'} in {library}")


@app.command("show")
def show(library: LibraryArgument, run_id: RunId) -> None:
    """Show everything that is kept of one run.

    Example: ilc library show ilc-library.db 12
    """
    for key, value in _load(library, run_id).items():
        if key == "disturbance" and value is not None:
            typer.echo(f"{key:22} {', '.join(f'{number:g}' for number in value)}")
        elif isinstance(value, np.ndarray):
            size = " x ".join(str(length) for length in value.shape)
            largest = float(np.abs(value).max()) if value.size else 0.0
            typer.echo(f"{key:22} {size} samples, largest {largest:.6g}")
        else:
            typer.echo(f"{key:22} {'-' if value is None else value}")


@app.command("export")
def export(library: LibraryArgument, run_id: RunId, file: ExportFile) -> None:
    """Write one run to a file: .npz and .json hold all, .csv the signals.

    Example: ilc library export ilc-library.db 12 run12.csv
    """
    export_run(_load(library, run_id), file)
    typer.echo(f"run {run_id} written to {file}")


def _load(library: Path, run_id: int) -> dict[str, Any]:
    known = {int(row["id"]) for row in library_rows(library)}
    if run_id not in known:
        there = f"{min(known)} to {max(known)}" if known else "none"
        message = f"{library}: no run {run_id}; there are {there}"
        raise BadInputError(message)
    return dict(Library(str(library)).load(run_id))
