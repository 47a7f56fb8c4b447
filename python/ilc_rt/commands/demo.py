"""`ilc demo`: the main job on simulated drives, with nothing to set up."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import typer

from ilc_rt.campaign import Campaign
from ilc_rt.commands.options import REPORT_NAME, JsonFile, Lockstep, declared, given
from ilc_rt.commands.run import execute
from ilc_rt.commands.targets import report_target

RESTARTS = 3

ReportFile = Annotated[
    Path,
    typer.Option("--report", metavar="PATH", callback=report_target, help="The HTML report."),
]


@declared("run", "iterations", "bus", "library", "telemetry")
def demo(
    lockstep: Lockstep = None,
    json_file: JsonFile = None,
    report: ReportFile = Path(REPORT_NAME),
    **options: Any,  # noqa: ANN401 (those of `ilc-rt run`)
) -> None:
    """Let a simulated two-axis gantry learn its contour, and write a report.

    Example: ilc demo
    """
    with resources.as_file(resources.files("ilc_rt").joinpath("data/gantry.toml")) as cell:
        iterations = options.pop("iterations")
        campaign = Campaign(cell, lockstep=lockstep, drives="simulated", **given(options))
        # Nothing real moves here: only this computer can cause a fault, and it may recover.
        execute(campaign, iterations, json_file, report, restarts=RESTARTS)
