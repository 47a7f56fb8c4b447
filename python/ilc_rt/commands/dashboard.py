"""`ilc dashboard`: a web page that watches cells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from ilc_rt.addresses import reached
from ilc_rt.commands.network import (
    Connect,
    Libraries,
    Router,
    Scouting,
    Timeout,
    described,
    tell_missing,
    tell_others,
)
from ilc_rt.commands.options import DEFAULT_LIBRARY_FILE
from ilc_rt.commands.steps import Steps
from ilc_rt.errors import BadInputError
from ilc_rt.monitor import EVERY_CELL

if TYPE_CHECKING:
    from types import ModuleType

PORT = 8460

Cells = Annotated[
    list[str] | None,
    typer.Argument(metavar="[CELL]...", help="Names of cells, or their TOML files; all if none."),
]


def dashboard(
    cells: Cells = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; 0.0.0.0 for every network.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for a free one.")
    ] = PORT,
    library: Libraries = None,
    connect: Connect = None,
    scouting: Scouting = True,
    router: Router = False,
    timeout: Timeout = None,
) -> None:
    """Serve a web page that watches cells and compares the runs of libraries; it commands nothing.

    Example: ilc dashboard gantry --library ilc-library.db
    """
    from ilc_rt.dashboard.archive import Archive
    from ilc_rt.dashboard.feed import Feed
    from ilc_rt.dashboard.fleet import Fleet

    server = _server()
    known = [described(cell) for cell in cells or () if cell != EVERY_CELL]
    fleet = Fleet(dict.fromkeys(name for name, _ in known))
    for name, cell in known:
        if cell is not None:
            fleet.cells[name].describe(cell)
    with Steps("libraries").clocked("reading the libraries"):
        opened = Archive(_libraries(library))
    with (
        opened as archive,
        server.listen(host, port) as listener,
        Feed(fleet, archive, connect or (), scouting=scouting, router=router),
    ):
        tell_missing(one.name for one in archive.sources if one.stamp() is None)
        typer.echo(f"dashboard: http://{reached(host, listener.getsockname()[1])}")
        tell_others(host)
        typer.echo("Ctrl-C ends this, not the machine", err=True)
        server.serve(fleet, archive, listener, host, timeout)


def _server() -> ModuleType:
    """Return the module of the server, whose framework is optional."""
    try:
        from ilc_rt.dashboard import server
    except ImportError as error:
        message = "the dashboard needs the package nicegui: pip install ilc-rt[dashboard]"
        raise BadInputError(message) from error
    return server


def _libraries(given: list[str] | None) -> list[str]:
    """Return the given libraries; else that of this folder, if there is one."""
    if given:
        return list(dict.fromkeys(given))
    return [str(DEFAULT_LIBRARY_FILE)] if DEFAULT_LIBRARY_FILE.is_file() else []
