"""`ilc repeatability`: repeatable and non-repeatable error of a cell."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from ilc_rt.commands.options import (
    CellFile,
    DriveChoice,
    DriveOption,
    JsonFile,
    KeepIn,
    Lockstep,
    declared,
    given,
)
from ilc_rt.commands.steps import Steps
from ilc_rt.comparison import Comparison
from ilc_rt.events import Event, IterationEvent, ProgressEvent, StartEvent
from ilc_rt.quantity import axis_unit, digits, unit_for
from ilc_rt.record import IterationRecord
from ilc_rt.repeatable import check_repeatability
from ilc_rt.text import NAME_MAX, printable


@declared("run", "measure", "bus", "telemetry")
def repeatability(
    cell: CellFile,
    runs: Annotated[int, typer.Option("--runs", "-n", help="Runs without learning.")] = 5,
    lockstep: Lockstep = None,
    library: KeepIn = None,
    json_file: JsonFile = None,
    drives: DriveOption = DriveChoice.auto,
    **options: Any,  # noqa: ANN401 (those of `ilc-rt run`)
) -> None:
    """Run a program without learning and tell what of its error repeats.

    Example: ilc repeatability examples/01_gantry.toml --runs 10
    """
    units: list[str] = []
    steps = Steps("runs")

    def tell(event: Event) -> None:
        if isinstance(event, StartEvent):
            units[:] = map(axis_unit, event.input_units)
        elif isinstance(event, ProgressEvent):
            steps.tell(round(event.iteration + event.sample / max(1, event.n_samples), 1), runs)
        elif isinstance(event, IterationEvent):
            steps.close()
            comparison = Comparison([IterationRecord.from_event(event, "")], units)
            errors = [c for c in comparison.tracking() if c.name.startswith("RMS")]
            said = ", ".join(column.unit.text(column.of(comparison.first)) for column in errors)
            typer.echo(f"run {event.index}: RMS error {said}")

    with steps:
        found = check_repeatability(
            cell, runs, lockstep=lockstep, drives=drives.value, library=library, observe=tell,
            **given(options),
        )  # fmt: skip
    names = [printable(axis.axis, NAME_MAX) for axis in found.axes]
    width = max(8, *map(len, names))
    typer.echo(f"{'axis':<{width}} {'repeats':>12} {'does not':>12} {'ratio':>8}  learning applies")
    for name, axis, unit in zip(names, found.axes, units, strict=True):
        shown = unit_for(unit, max(axis.repeatable_rms_m, axis.non_repeatable_rms_m))
        same, other = axis.repeatable_rms_m, axis.non_repeatable_rms_m
        ratio = "-" if axis.ratio is None else digits(axis.ratio)
        typer.echo(
            f"{name:<{width}} {shown.text(same):>12} {shown.text(other):>12} {ratio:>8}  "
            f"{axis.verdict}"
        )
    if json_file is not None:
        found.write_json(json_file)
        typer.echo(f"figures: {json_file}")
