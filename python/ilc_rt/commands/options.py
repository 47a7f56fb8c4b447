"""Options and arguments that several verbs share."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from ilc_rt.campaign import DEFAULT_LIBRARY, ITERATIONS_MAX
from ilc_rt.commands.targets import json_target
from ilc_rt.transports import SYNTAXES


class Measure(str, Enum):
    """Which measurement to learn from."""

    encoder = "encoder"
    tcp = "tcp"


class DriveChoice(str, Enum):
    """Whether to start simulated drives."""

    auto = "auto"
    simulated = "simulated"
    external = "external"


CellFile = Annotated[Path, typer.Argument(metavar="CELL", help="Cell description, a TOML file.")]
Iterations = Annotated[
    int,
    typer.Option(
        "--iterations",
        "-n",
        max=ITERATIONS_MAX,
        help="Runs in the whole campaign; the first is without learning.",
    ),
]
Bus = Annotated[
    str | None,
    typer.Option(
        metavar="ADDR",
        help=f"Bus in place of the cell's: {SYNTAXES}",
    ),
]
MeasureOption = Annotated[
    Measure | None, typer.Option(help="What to learn from, in place of the cell's.")
]
Lockstep = Annotated[
    bool | None,
    typer.Option(
        "--lockstep/--realtime",
        help="Advance on the drives' answers, with no wall clock; loopback: does so by itself.",
    ),
]
LibraryFile = Annotated[
    Path, typer.Option("--library", metavar="FILE", help="Where the runs are kept.")
]
KeepIn = Annotated[
    Path | None, typer.Option("--library", metavar="FILE", help="Keep the runs in this library.")
]
JsonFile = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        callback=json_target,
        help="Write the figures to this file; - for standard output.",
    ),
]
DriveOption = Annotated[
    DriveChoice, typer.Option(help="Start simulated drives; auto never does on a can: bus.")
]
LibraryArgument = Annotated[Path, typer.Argument(metavar="LIBRARY", help="Library file.")]
REPORT_NAME = "ilc-report.html"
DEFAULT_LIBRARY_FILE = Path(DEFAULT_LIBRARY)
