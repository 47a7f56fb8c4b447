"""`ilc demo`: the main job on simulated drives, with nothing to set up."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from ilc_rt.campaign import Campaign
from ilc_rt.commands.options import (
    DEFAULT_LIBRARY_FILE,
    REPORT_NAME,
    Bus,
    Iterations,
    JsonFile,
    LibraryFile,
    Lockstep,
)
from ilc_rt.commands.run import carry_out
from ilc_rt.commands.targets import report_target

RESTARTS = 3

ReportFile = Annotated[
    Path,
    typer.Option("--report", metavar="PATH", callback=report_target, help="The HTML report."),
]


def demo(
    iterations: Iterations = 10,
    bus: Bus = None,
    lockstep: Lockstep = None,
    library: LibraryFile = DEFAULT_LIBRARY_FILE,
    json_file: JsonFile = None,
    report: ReportFile = Path(REPORT_NAME),
) -> None:
    """Let a simulated two-axis gantry learn its contour, and write a report.

    Example: ilc demo
    """
    with resources.as_file(resources.files("ilc_rt").joinpath("data/gantry.toml")) as cell:
        campaign = Campaign(cell, library=library, bus=bus, lockstep=lockstep, drives="simulated")
        # Nothing real moves here: what stops the axes is this computer, and it may recover.
        carry_out(campaign, iterations, json_file, report, restarts=RESTARTS)
