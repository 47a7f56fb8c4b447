"""`ilc identify`: excite an axis and fit a model to its response."""

from __future__ import annotations

from pathlib import Path
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
from ilc_rt.commands.targets import make_folder, report_target, write_picture
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.events import Event, ProgressEvent, StartEvent
from ilc_rt.text import file_name, printable

PICTURE = "identify-{axis}.png"

PictureFolder = Annotated[
    Path | None,
    typer.Option("--report", metavar="DIR", callback=report_target, help="Folder for the picture."),
]


@declared("identify")
def identify(
    cell: CellFile,
    lockstep: Lockstep = None,
    library: KeepIn = None,
    drives: DriveOption = DriveChoice.auto,
    json_file: JsonFile = None,
    report: PictureFolder = None,
    **options: Any,  # noqa: ANN401 (those of `ilc-rt identify`)
) -> None:
    """Excite one axis while the others hold still, and fit a model to its response.

    Example: ilc identify examples/01_gantry.toml --axis y --report pictures/
    """
    from ilc_rt.identify import identify as identify_axis

    steps = Steps("samples")
    asked = {name: value for name, value in given(options).items() if value is not None}

    def tell(event: Event) -> None:
        if isinstance(event, ProgressEvent):
            steps.tell(event.sample, event.n_samples)
        elif isinstance(event, StartEvent):
            steps.begin()
            seconds = event.n_samples * event.cycle_s
            axis = f"axis {printable(asked['axis'])}" if "axis" in asked else "the axis"
            typer.echo(f"exciting {axis} of {event.cell} for {seconds:.1f} s, {event.bus}")

    def say(sentence: str) -> None:
        steps.close()
        typer.echo(sentence)

    try:
        with steps:
            found = identify_axis(
                cell, lockstep=lockstep, library=library, drives=drives.value, observe=tell,
                tell=say, **asked,
            )  # fmt: skip
    except (KeyboardInterrupt, SystemExit):
        kept = "" if library is None else f"; {printable(library)} has what was measured before"
        typer.echo(f"ilc: stopped on request; the axes are at rest{kept}", err=True)
        raise
    except ValueError as error:
        raise BadInputError(str(error)) from error
    name = found.experiment.axis
    _tell(found)
    if json_file is not None:
        found.write_json(json_file)
        typer.echo(f"figures: {json_file}")
    if report is not None:
        picture = _draw(found, report, PICTURE.format(axis=file_name(name)))
        typer.echo(f"picture: {printable(picture)}")

    if found.doubt is not None:
        # The measurement is written anyway: it shows the problem.
        message = f"no model for axis {name}: {found.doubt}; try a larger amplitude or another band"
        raise CampaignError(message)


def _tell(found: object) -> None:
    from ilc_rt.identify import Identification

    assert isinstance(found, Identification)
    count, worst = len(found.frequency_hz), float(found.coherence.min())
    typer.echo(
        f"{count} frequencies, amplitude {found.experiment.amplitude:.4g} {found.input_unit}, "
        f"coherence at least {worst:.4f}"
    )
    for name, value, deviation in found.rows() if found.followed else []:
        typer.echo(f"  {name:<24} {value:>10}{f'  +- {deviation}' if deviation else ''}")
    if found.doubt is None:
        typer.echo(f"\n{found.section()}")


def _draw(found: object, folder: Path, name: str) -> Path:
    # Imported here, as matplotlib is slow to import, and bad input should be reported before.
    from ilc_rt.identify import Identification

    assert isinstance(found, Identification)
    make_folder(folder)
    write_picture(folder / name, found.figure())
    return folder / name
