"""`ilc run`: run a cell's program and learn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ilc_rt.campaign import Campaign
from ilc_rt.commands.options import (
    CellFile,
    DriveChoice,
    DriveOption,
    JsonFile,
    Lockstep,
    declared,
    given,
)
from ilc_rt.commands.targets import make_folder, report_target
from ilc_rt.errors import EXIT_FAULT, CampaignError
from ilc_rt.progress import CampaignView
from ilc_rt.text import printable

ReportFile = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="PATH",
        callback=report_target,
        help="Write an HTML report: a .html file, or a folder in one that exists.",
    ),
]


@declared("run")
def run(
    cell: CellFile,
    lockstep: Lockstep = None,
    drives: DriveOption = DriveChoice.auto,
    json_file: JsonFile = None,
    report: ReportFile = None,
    **options: Any,  # noqa: ANN401 (those of `ilc-rt run`)
) -> None:
    """Run a cell's program again and again, each run better than the last.

    Example: ilc run examples/01_gantry.toml --iterations 10 --report report.html
    """
    iterations = options.pop("iterations")
    campaign = Campaign(cell, lockstep=lockstep, drives=drives.value, **given(options))
    execute(campaign, iterations, json_file, report)


def execute(
    campaign: Campaign,
    iterations: int,
    json_file: Path | None,
    report: Path | None,
    *,
    restarts: int = 0,
) -> None:
    """Run a campaign in the terminal, then write the requested files.

    Files are also written after a fault or a requested stop, for the completed runs. After a fault
    of the machine the campaign is resumed, at most `restarts` times.
    """
    try:
        _show(campaign, iterations, restarts)
    except (CampaignError, KeyboardInterrupt, SystemExit) as stopped:
        if campaign.result.records:
            typer.echo(campaign.result.sentence())
            _write(campaign, json_file, report)
        if not isinstance(stopped, CampaignError):
            typer.echo("ilc: stopped on request; the axes are at rest", err=True)
        raise
    typer.echo(campaign.result.sentence())
    _write(campaign, json_file, report)


def _show(campaign: Campaign, iterations: int, restarts: int) -> None:
    try:
        with CampaignView() as view:
            for event in campaign.events(iterations):
                view.show(event, campaign.result)
    except CampaignError as stopped:
        # A run that could not be stored could not be stored the next time either.
        if stopped.exit_code != EXIT_FAULT or restarts == 0 or campaign.result.unkept:
            raise
        n_runs = len(campaign.result.records)
        campaign.resume = n_runs > 0
        onward = f"going on after run {n_runs - 1}" if n_runs else "beginning again"
        typer.echo(f"ilc: {printable(stopped.reason)}; {onward}", err=True)
    else:
        return
    _show(campaign, iterations, restarts - 1)


def _write(campaign: Campaign, json_file: Path | None, report: Path | None) -> None:
    result = campaign.result
    typer.echo(f"library: {printable(campaign.library)} (campaign {printable(result.campaign)})")
    if json_file is not None:
        result.write_json(json_file)
        typer.echo(f"figures: {printable(json_file)}")
    if report is not None:
        # Imported here, as matplotlib is slow to import, and bad input should be reported before.
        from ilc_rt.report import write_report

        if not report.suffix:
            make_folder(report)
        typer.echo(f"report:  {printable(write_report(result, report))}")
