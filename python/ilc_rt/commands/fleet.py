"""`ilc library sync`, `collect` and `fetch`: the libraries of many cells in one database."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ilc_rt.commands.network import Connect, Router, Scouting, Timeout, listen
from ilc_rt.commands.options import JsonFile  # noqa: TC001 - typer reads it
from ilc_rt.commands.steps import Steps
from ilc_rt.errors import BadInputError
from ilc_rt.result import json_text, write_text
from ilc_rt.text import printable, runs_counted

FROM = "Library file (sqlite:///cell.db, or its path), or database (postgresql://USER@HOST/NAME)."
Source = Annotated[str, typer.Argument(metavar="FROM", help=FROM)]
Target = Annotated[str, typer.Argument(metavar="TO", help="The other of the two.")]
Database = Annotated[
    str, typer.Argument(metavar="DATABASE", help="Database, as postgresql://USER@HOST/NAME.")
]
CellOption = Annotated[str | None, typer.Option("--cell", metavar="NAME", help="Only this cell's.")]
CellFile = Annotated[
    Path, typer.Option("--cell", metavar="FILE", help="Description of the cell (TOML).")
]
Into = Annotated[Path, typer.Option("--into", metavar="FILE", help="Library of the cell.")]
FromCell = Annotated[
    str | None,
    typer.Option("--from-cell", metavar="NAME", help="Only campaigns of the cell of this name."),
]
OtherDrives = Annotated[
    bool,
    typer.Option(
        "--other-drives",
        help="Accept a cell with other limits, models or position loops; see docs/fleet.md.",
    ),
]


def sync(
    source: Source, target: Target, cell: CellOption = None, json_file: JsonFile = None
) -> None:
    """Store the runs of a library in a database, or the runs of a cell back in a library.

    May be repeated and interrupted: what is there is not stored again.

    Example: ilc library sync sqlite:///ilc-library.db postgresql://ilc@fleet.local/ilc
    """
    from ilc_rt.fleet import pull, push
    from ilc_rt.fleet.database import file_of, is_database

    if is_database(source) == is_database(target):
        message = f"{source} {target}: one is a library file, the other a database"
        raise BadInputError(message)
    if cell is None and not is_database(target):
        message = "--cell NAME: the cell whose runs the library is to have"
        raise BadInputError(message)
    try:
        with Steps("new runs") as steps:
            if is_database(target):
                done = push(file_of(source), target, cell, steps.tell)
            else:
                done = pull(source, file_of(target), cell or "", steps.tell)
    except KeyboardInterrupt:
        typer.echo("ilc: stopped; what was stored stays, and the next sync goes on", err=True)
        raise
    if json_file is not None:
        counts = {"stored": done.stored, "renewed": done.renewed, "present": done.present}
        write_text(json_file, json_text({**counts, "damaged": list(done.damaged)}))
    was = "was" if done.present == 1 else "were"
    typer.echo(
        f"{runs_counted(done.stored)} stored, {done.renewed} renewed, {done.present} {was} there"
    )
    if done.damaged:
        ids = ", ".join(map(str, done.damaged))
        message = f"{source}: runs left out, as their arrays do not match their digest: {ids}"
        raise BadInputError(message)


def collect(
    database: Database,
    cell: Annotated[str, typer.Option("--cell", metavar="NAME", help="Only this cell's.")] = "*",
    connect: Connect = None,
    scouting: Scouting = True,
    router: Router = False,
    timeout: Timeout = None,
    json_file: JsonFile = None,
) -> None:
    """Store the figures of every run as it ends; the arrays follow by `ilc library sync`.

    Example: ilc library collect postgresql://ilc@fleet.local/ilc --timeout 3600
    """
    from ilc_rt.fleet import Collector

    with (
        Collector(database) as collector,
        listen(cell, connect, scouting=scouting, router=router) as seen,
    ):
        typer.echo("collecting; Ctrl-C ends this, not the machines", err=True)
        warned: set[str] = set()
        was_waiting, was_refused = False, None
        try:
            for message in seen.messages(timeout):
                collector.take(message)
                for name in collector.unknown - warned:
                    warned.add(name)
                    typer.echo(
                        f"{printable(name)}: its campaign began before; sync brings its runs",
                        err=True,
                    )
                if collector.refused != was_refused:
                    was_refused = collector.refused
                    typer.echo(f"left out: {printable(was_refused)}", err=True)
                if bool(collector.n_waiting) != was_waiting:
                    was_waiting = not was_waiting
                    state = "cannot be reached: runs wait" if was_waiting else "is there again"
                    typer.echo(f"the database {state}", err=True)
        finally:
            typer.echo(f"{runs_counted(collector.stored)} stored")
            if json_file is not None:
                write_text(json_file, json_text({"stored": collector.stored}))


def fetch(
    database: Database,
    cell: CellFile,
    into: Into,
    from_cell: FromCell = None,
    other_drives: OtherDrives = False,
    json_file: JsonFile = None,
) -> None:
    """Start a cell from the best campaign that another one learned, if it fits.

    Example: ilc library fetch postgresql://ilc@fleet.local/ilc --cell gantry-2.toml --into two.db
    """
    from ilc_rt.fleet import fetch as fetch_campaign
    from ilc_rt.quantity import unit_for

    with Steps("campaigns compared") as steps:
        got = fetch_campaign(
            database, cell, str(into), from_cell=from_cell, other_drives=other_drives,
            progress=steps.tell,
        )  # fmt: skip
    if json_file is not None:
        told = ("from_cell", "campaign", "runs", "stored", "best_tracking_rms_m")
        write_text(json_file, json_text({name: getattr(got, name) for name in told}))
    error = unit_for("m", got.best_tracking_rms_m).text(got.best_tracking_rms_m)
    typer.echo(
        f"{got.stored} of {runs_counted(got.runs)} of {printable(got.from_cell)} stored as "
        f"campaign {printable(got.campaign)}; smallest RMS error {error}\n"
        f"go on: ilc run {printable(cell)} --library {printable(into)} --resume "
        f"--iterations {got.runs + 5}"
    )
