"""`ilc library`: the stored runs, and their export."""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.cells import cell_len, set_cell_size
from rich.console import Console
from typer import Typer

from ilc_rt.commands import fleet
from ilc_rt.commands.options import (
    DEFAULT_LIBRARY_FILE,
    JsonFile,
    LibraryArgument,
)
from ilc_rt.commands.steps import Steps
from ilc_rt.errors import BadInputError
from ilc_rt.library import Library
from ilc_rt.quantity import axis_unit, unit_for
from ilc_rt.result import STANDARD_OUTPUT, existing, json_text, write_text
from ilc_rt.text import printable, runs_counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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

app.command("sync")(fleet.sync)
app.command("collect")(fleet.collect)
app.command("fetch")(fleet.fetch)

# Displayed characters of a program or of a law's parameters; `export` writes them completely.
LENGTH_SHOWN = 2000

RunId = Annotated[int, typer.Argument(metavar="ID", help="Number of the run in the library.")]
CellName = Annotated[str | None, typer.Option("--cell", metavar="NAME", help="Only this cell's.")]
CampaignOption = Annotated[
    str | None, typer.Option("--campaign", metavar="ID", help="Only this campaign's.")
]
Keep = Annotated[
    int | None,
    typer.Argument(min=0, max=2**63 - 1, metavar="[KEEP]", help="How many runs stay."),
]
Newest = Annotated[
    int | None, typer.Option(min=0, metavar="N", help="In place of KEEP: the N newest runs stay.")
]
Days = Annotated[
    float | None,
    typer.Option(min=0, metavar="DAYS", help="In place of KEEP: runs of the last DAYS stay."),
]
Best = Annotated[
    int | None,
    typer.Option(
        min=0, metavar="N", help="In place of KEEP: of each campaign the N best runs stay."
    ),
]
Limit = Annotated[
    int | None,
    typer.Option("--limit", min=1, max=2**31, metavar="N", help="List this many runs at most."),
]
Offset = Annotated[
    int,
    typer.Option("--offset", min=0, max=2**31, metavar="N", help="Leave out the N oldest runs."),
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
    limit: Limit = None,
    offset: Offset = 0,
    json_file: JsonRows = None,
    csv_file: CsvRows = None,
) -> None:
    """List the runs, one per line; --limit and --offset list a part of many.

    Example: ilc library list ilc-library.db --cell gantry --limit 50
    """
    if offset and limit is None:
        message = f"--offset {offset}: needs --limit, the number of runs to list"
        raise BadInputError(message)
    if json_file == csv_file == STANDARD_OUTPUT:
        message = "--json - --csv -: one of them on standard output"
        raise BadInputError(message)
    total = len(existing(library))
    with Steps("runs").clocked(f"reading {total} runs"):
        rows = _rows(library, cell, campaign, limit, offset)
        files = {json_file: json_text, csv_file: _csv}
        texts = {file: text(rows) for file, text in files.items() if file is not None}
    for file, text in texts.items():
        write_text(file, text)
    if STANDARD_OUTPUT in texts:
        return
    console = Console(highlight=False, markup=False, emoji=False)
    width = console.width if console.is_terminal or "COLUMNS" in os.environ else WIDE
    typer.echo("\n".join(["", *_lines(rows, width), ""]))
    part = "" if len(rows) == total else f"{len(rows)} of "
    typer.echo(f"{part}{runs_counted(total)} in {printable(library)}")


def _rows(
    library: Path, cell: str | None, campaign: str | None, limit: int | None, offset: int
) -> list[dict[str, Any]]:
    try:
        return existing(library).page(cell, campaign, limit, offset)
    except OSError as error:
        raise BadInputError(str(error)) from error


def _lines(rows: list[dict[str, Any]], width: int) -> list[str]:
    """Return the runs as lines with the columns that `show` and `export` need at any width.

    Plain text, as a table of rich takes a millisecond for each line.
    """
    texts = [
        (
            str(row["id"]), printable(row["campaign"]), str(row["index"]), printable(row["cell"]),
            printable(row["law"]), error_text(row, "tracking_inf_m"),
            error_text(row, "contour_inf_m"), note(row), printable(row["measure"]),
            printable(row["created_utc"]),
        )
        for row in rows
    ]  # fmt: skip
    names = COLUMNS[: len(COLUMNS) if width >= WIDE else N_NARROW]
    wanted = [
        max([len(name), *(cell_len(text[column]) for text in texts)])
        for column, name in enumerate(names)
    ]
    # Names are shortened, always the longest; columns are a blank apart.
    for _ in range(sum(wanted) + len(names) + 1 - width):
        longer = [column for column, least in SHORTENED.items() if wanted[column] > least]
        if not longer:
            break
        wanted[max(longer, key=wanted.__getitem__)] -= 1
    is_right = [name in RIGHT for name in names]

    def line(text: Sequence[str]) -> str:
        return "".join(map(_filled, text, wanted, is_right)).rstrip()

    return [line(names), " " + "─" * (sum(wanted) + len(names) - 1), *map(line, texts)]


def _filled(text: str, size: int, is_right: bool) -> str:  # noqa: FBT001 (a column of a map)
    """Return a text of a given width in a terminal, after a blank."""
    length = len(text) if text.isascii() else cell_len(text)
    if length > size:
        return f" {set_cell_size(text, size - 1)}…"
    blanks = " " * (size - length)
    return f" {blanks}{text}" if is_right else f" {text}{blanks}"


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
def show(library: LibraryArgument, run_id: RunId, json_file: JsonFile = None) -> None:
    """Show everything that is kept of one run; of its signals the size and the largest value.

    Example: ilc library show ilc-library.db 12
    """
    import numpy as np  # only here: the program starts without it

    row = _load(library, run_id)
    if json_file is not None:
        kept = {
            key: {"shape": value.shape, "largest": float(np.abs(value).max(initial=0.0))}
            if isinstance(value, np.ndarray)
            else value
            for key, value in row.items()
        }
        write_text(json_file, json_text(kept))
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
def trim(
    library: LibraryArgument,
    keep: Keep = None,
    cell: CellName = None,
    newest: Newest = None,
    days: Days = None,
    best: Best = None,
    json_file: JsonFile = None,
) -> None:
    """Delete all but the most relevant runs (KEEP), or all that no rule keeps.

    The most relevant have small errors, spread over disturbances. A run that one of --newest,
    --days and --best keeps stays; so does the newest run of each campaign.

    Example: ilc library trim ilc-library.db 500 --cell gantry
    """
    rules = {"newest": newest, "days": days, "best": best}
    has_rule = any(rule is not None for rule in rules.values())
    if has_rule == (keep is not None):
        message = "KEEP or rules: the number of runs that stay, or some of --newest, --days, --best"
        raise BadInputError(message)
    n_runs = len(existing(library))
    try:
        with Steps("runs deleted") as steps:
            if keep is not None:
                deleted = Library(str(library)).trim(min(keep, n_runs), cell, progress=steps.tell)
            else:
                deleted = Library(str(library)).retain(
                    newest=newest, days=days, best=best, cell=cell, progress=steps.tell
                )
    except OSError as error:
        raise BadInputError(str(error)) from error
    except KeyboardInterrupt:
        left = len(existing(library))
        typer.echo(f"ilc: stopped; {n_runs - left} runs are deleted, {left} are there", err=True)
        raise
    if json_file is not None:
        write_text(json_file, json_text({"deleted": deleted}))
    typer.echo(f"{runs_counted(deleted)} deleted from {printable(library)}")


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
    there = existing(library)
    try:
        return dict(there.load(run_id))
    except (OSError, ValueError) as error:
        reason = str(error)
    try:
        known = [int(row["id"]) for row in there.page()]
    except OSError as error:
        raise BadInputError(str(error)) from error
    if run_id not in known:
        ids = f"{min(known)} to {max(known)}" if known else "none"
        reason = f"{library}: no run {run_id}; there are {ids}"
    raise BadInputError(reason)
