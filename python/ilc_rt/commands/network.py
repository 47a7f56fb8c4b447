"""Options of every verb that hears controllers on the network, and what they open.

Imported by the verbs that watch: `monitor`, `dashboard`, `bridge` and `library collect`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ilc_rt.addresses import is_local
from ilc_rt.campaign import load_cell
from ilc_rt.errors import BadInputError
from ilc_rt.monitor import EVERY_CELL, Monitor, checked_name
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ilc_rt import Cell
    from ilc_rt.sources import Memory

#: A year.
DURATION_MAX_S = 366 * 86_400.0

CellName = Annotated[
    str, typer.Argument(metavar="[CELL]", help="Name of a cell, or its TOML file; * for all.")
]
Connect = Annotated[
    list[str] | None,
    typer.Option(metavar="ENDPOINT", help="Zenoh endpoint, as tcp/192.168.1.5:7447; repeatable."),
]
Scouting = Annotated[
    bool, typer.Option("--scouting/--no-scouting", help="Look for controllers by multicast.")
]
Router = Annotated[
    bool, typer.Option("--router", help="Hear through a router, which --connect names.")
]


def _duration(context: typer.Context, value: float | None) -> float | None:
    """Refuse a time that never ends, or ended before."""
    if value is not None and not context.resilient_parsing and not 0.0 <= value <= DURATION_MAX_S:
        message = f"--timeout {value:g}: seconds from 0 to {DURATION_MAX_S:g}"
        raise BadInputError(message)
    return value


Timeout = Annotated[
    float | None,
    typer.Option("--timeout", metavar="SECONDS", callback=_duration, help="End after this time."),
]
Libraries = Annotated[
    list[str] | None,
    typer.Option(
        "--library",
        metavar="FILE",
        help="Library, a file or postgresql://USER@HOST/NAME, with what a late joiner has not "
        "heard: earlier runs, axes and units; repeatable.",
    ),
]


def listen(cell: str, connect: list[str] | None, *, scouting: bool, router: bool) -> Monitor:
    """Return a monitor of a cell, or of all, that hears as the options say."""
    return Monitor(cell, connect or (), scouting=scouting, router=router)


def remembering(libraries: list[str] | None) -> Memory:
    """Return the memory of some libraries; one that does not exist yet is reported.

    Raises
    ------
    BadInputError
        If a file is not a library, or a database cannot be read.
    """
    # Only here: `library` starts without NumPy, which a fleet database needs.
    from ilc_rt.sources import Memory

    memory = Memory(libraries or ())
    try:
        missing = memory.missing()
    except BadInputError:
        memory.close()
        raise
    tell_missing(missing)
    return memory


def tell_missing(names: Iterable[str]) -> None:
    """Say which libraries do not exist yet: a name may be mistyped."""
    for name in names:
        typer.echo(f"{printable(name)}: no such library yet", err=True)


def tell_others(host: str) -> None:
    """Say so if more than this computer reaches a server at this address."""
    if not is_local(host):
        typer.echo("anyone on that network can watch; nobody can command", err=True)


def described(cell: str) -> tuple[str, Cell | None]:
    """Return the name of a cell, and its description if a file was given."""
    if Path(cell).suffix != ".toml":
        return checked_name(cell), None
    found = load_cell(cell)
    return found.name, found


def whom(cell: str) -> str:
    """Return a cell, or all of them, in words.

    Examples
    --------
    >>> whom("gantry"), whom("*")
    ('gantry', 'every cell')
    """
    return "every cell" if cell == EVERY_CELL else cell
