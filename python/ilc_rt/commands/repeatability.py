"""`ilc repeatability`: whether learning applies to a cell."""

from __future__ import annotations

from typing import Annotated

import typer

from ilc_rt.commands.options import (
    Bus,
    CellFile,
    DriveChoice,
    DriveOption,
    JsonFile,
    KeepIn,
    Lockstep,
    MeasureOption,
)
from ilc_rt.events import Event, IterationEvent
from ilc_rt.repeatable import check_repeatability
from ilc_rt.result import micrometres


def repeatability(
    cell: CellFile,
    runs: Annotated[int, typer.Option("--runs", "-n", help="Runs without learning.")] = 5,
    measure: MeasureOption = None,
    bus: Bus = None,
    lockstep: Lockstep = None,
    library: KeepIn = None,
    json_file: JsonFile = None,
    drives: DriveOption = DriveChoice.auto,
) -> None:
    """Run a program without learning and tell what of its error repeats.

    Example: ilc repeatability examples/01_gantry.toml --runs 10
    """

    def tell(event: Event) -> None:
        if isinstance(event, IterationEvent):
            typer.echo(f"run {event.index}: RMS error {micrometres(event.tracking_rms_m)} µm")

    found = check_repeatability(
        cell, runs, bus=bus, measure=measure.value if measure else None, lockstep=lockstep,
        drives=drives.value, library=library, observe=tell,
    )  # fmt: skip
    typer.echo(f"{'axis':<8} {'repeats µm':>12} {'does not µm':>12} {'ratio':>8}  learning applies")
    for axis in found.axes:
        ratio = "-" if axis.ratio is None else f"{axis.ratio:.1f}"
        same, other = axis.repeatable_rms_m, axis.non_repeatable_rms_m
        typer.echo(
            f"{axis.axis:<8} {micrometres(same):>12} {micrometres(other):>12} {ratio:>8}  "
            f"{axis.verdict}"
        )
    if json_file is not None:
        found.write_json(json_file)
        typer.echo(f"figures: {json_file}")
