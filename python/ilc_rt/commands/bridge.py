"""`ilc bridge`: a running controller in PlotJuggler or Foxglove."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ilc_rt.bridge import foxglove as foxglove_bridge
from ilc_rt.bridge import plotjuggler as plotjuggler_bridge
from ilc_rt.commands.network import (
    CellName,
    Connect,
    Libraries,
    Router,
    Scouting,
    Timeout,
    described,
    listen,
    remembering,
    tell_others,
    whom,
)
from ilc_rt.commands.targets import check_file
from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from ilc_rt import Cell
    from ilc_rt.monitor import Message, Monitor

app = typer.Typer(
    no_args_is_help=True, help="Show a running controller in PlotJuggler or Foxglove."
)


def _layout_target(context: typer.Context, path: Path | None) -> Path | None:
    """Check the file of the layout before anything is opened."""
    if path is not None and not context.resilient_parsing:
        check_file("--layout", path)
    return path


Layout = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        callback=_layout_target,
        help="Write a layout for the cell, given as its TOML file.",
    ),
]


@app.command("plotjuggler")
def plotjuggler(
    cell: CellName = "*",
    to: Annotated[
        str, typer.Option(metavar="HOST[:PORT]", help="Where PlotJuggler's UDP server listens.")
    ] = f"127.0.0.1:{plotjuggler_bridge.PORT}",
    layout: Layout = None,
    connect: Connect = None,
    scouting: Scouting = True,
    router: Router = False,
    library: Libraries = None,
    timeout: Timeout = None,
) -> None:
    """Send every servo cycle to PlotJuggler, as JSON over UDP.

    In PlotJuggler start the UDP Server with the protocol json and the time field `timestamp`.

    Example: ilc bridge plotjuggler gantry.toml --layout gantry-plotjuggler.xml
    """
    name, known = described(cell)
    _write(layout, known, plotjuggler_bridge.layout)
    host, port = _address(to)
    with (
        remembering(library) as memory,
        plotjuggler_bridge.PlotJuggler(host, port, known, memory.campaign) as bridge,
        listen(name, connect, scouting=scouting, router=router) as watching,
    ):
        _follow(name, f"{host}:{port}", bridge.show, watching, timeout)


@app.command("foxglove")
def foxglove(
    cell: CellName = "*",
    host: Annotated[
        str, typer.Option(help="Address to listen on; 0.0.0.0 for every network.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to listen on; 0 for a free one.")
    ] = foxglove_bridge.PORT,
    layout: Layout = None,
    connect: Connect = None,
    scouting: Scouting = True,
    router: Router = False,
    library: Libraries = None,
    timeout: Timeout = None,
) -> None:
    """Serve every servo cycle to Foxglove, over its WebSocket.

    In Foxglove choose "Open connection" and the address that is printed.

    Example: ilc bridge foxglove gantry.toml --layout gantry-foxglove.json
    """
    name, known = described(cell)
    _write(layout, known, foxglove_bridge.layout)
    with (
        remembering(library) as memory,
        foxglove_bridge.Foxglove(host, port, known, memory.campaign) as bridge,
        listen(name, connect, scouting=scouting, router=router) as watching,
    ):
        tell_others(host)
        _follow(name, bridge.address, bridge.show, watching, timeout)


def _write(layout: Path | None, cell: Cell | None, text: Callable[[Cell], str]) -> None:
    if layout is None:
        return
    if cell is None:
        message = f"--layout {layout}: needs the TOML file of the cell, for the names of its axes"
        raise BadInputError(message)
    layout.write_text(text(cell), encoding="utf-8")
    typer.echo(f"wrote {layout}", err=True)


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":") if ":" in text else (text, "", "")
    if not host or (port and not (port.isdecimal() and 0 < int(port) < 65536)):
        message = f"--to {text}: HOST or HOST:PORT, with a port from 1 to 65535"
        raise BadInputError(message)
    return host, int(port) if port else plotjuggler_bridge.PORT


def _follow(
    cell: str,
    address: str,
    show: Callable[[Message], object],
    watching: Monitor,
    timeout: float | None,
) -> None:
    typer.echo(f"{whom(cell)} to {address}; Ctrl-C ends this, not the machine", err=True)
    for message in watching.messages(timeout):
        show(message)
    if watching.lost:
        typer.echo(f"{watching.lost} messages came too fast and were left out", err=True)
