"""Options of every verb that hears controllers on the network, and what they open.

Imported by the verbs that watch: `monitor`, `dashboard`, `bridge` and `library collect`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ilc_rt.campaign import load_cell
from ilc_rt.monitor import Monitor

if TYPE_CHECKING:
    from ilc_rt import Cell

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
Timeout = Annotated[
    float | None, typer.Option("--timeout", metavar="SECONDS", help="End after this time.")
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


def described(cell: str) -> tuple[str, Cell | None]:
    """Return the name of a cell, and its description if a file was given."""
    if Path(cell).suffix != ".toml":
        return cell, None
    found = load_cell(cell)
    return found.name, found


def whom(cell: str) -> str:
    """Return a cell, or all of them, in words.

    Examples
    --------
    >>> whom("gantry"), whom("*")
    ('gantry', 'every cell')
    """
    return "every cell" if cell == "*" else cell
