"""`ilc identify`: excite an axis and fit a model to what it does."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
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
from ilc_rt.commands.targets import make_folder, report_target
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.events import Event, StartEvent
from ilc_rt.text import file_name, printable

PICTURE = "identify-{axis}.png"
PERIODS_MAX = 10_000
COHERENCE_MIN = 0.7
"""Median coherence below which the output does not follow the input."""

PictureFolder = Annotated[
    Path | None,
    typer.Option("--report", metavar="DIR", callback=report_target, help="Folder for the picture."),
]


class Method(str, Enum):
    """What the axis is excited with."""

    sweep = "sweep"
    linear_sweep = "linear-sweep"
    multisine = "multisine"


def identify(
    cell: CellFile,
    axis: Annotated[str | None, typer.Option(metavar="NAME", help="Which axis.")] = None,
    method: Annotated[Method, typer.Option(help="What to excite it with.")] = Method.multisine,
    amplitude_m: Annotated[
        float | None, typer.Option(help="Peak for a csp axis; half of what the limits allow.")
    ] = None,
    amplitude_m_s: Annotated[float | None, typer.Option(help="Peak for a csv axis.")] = None,
    from_hz: Annotated[
        float | None, typer.Option(help="Lowest frequency; 1 Hz, or less for a slow axis.")
    ] = None,
    to_hz: Annotated[
        float | None, typer.Option(help="Highest frequency; tried out if not given.")
    ] = None,
    duration_s: Annotated[
        float | None, typer.Option(help="Length of one period; 8 s, or more for a slow axis.")
    ] = None,
    periods: Annotated[
        int, typer.Option(max=PERIODS_MAX, help="Periods to evaluate, at least 2.")
    ] = 5,
    at_m: Annotated[
        float | None, typer.Option(help="Where to excite it; the program's start if not given.")
    ] = None,
    measure: MeasureOption = None,
    bus: Bus = None,
    lockstep: Lockstep = None,
    library: KeepIn = None,
    json_file: JsonFile = None,
    report: PictureFolder = None,
    drives: DriveOption = DriveChoice.auto,
) -> None:
    """Excite one axis while the others hold still, and fit a model to it.

    Example: ilc identify examples/01_gantry.toml --axis y --report pictures/
    """
    from ilc_rt import identify as steps
    from ilc_rt.campaign import load_cell

    described = load_cell(cell)
    name = axis or (described.axis_names[0] if described.n_axes == 1 else "")
    if name not in described.axis_names:
        message = f"--axis {axis or ''}: {cell} has {', '.join(described.axis_names)}"
        raise BadInputError(message)
    amplitude = _amplitude(described.interfaces[described.axis_names.index(name)],
                           amplitude_m, amplitude_m_s)  # fmt: skip

    def tell(event: Event) -> None:
        if isinstance(event, StartEvent):
            seconds = event.n_samples * event.cycle_s
            typer.echo(f"exciting axis {name} of {event.cell} for {seconds:.1f} s, {event.bus}")

    options: dict[str, Any] = {
        "axis": name, "amplitude": amplitude, "from_hz": from_hz, "to_hz": to_hz,
        "duration_s": duration_s, "periods": periods, "at_m": at_m,
        "measure": measure.value if measure else None, "bus": bus, "lockstep": lockstep,
        "drives": drives.value, "library": library, "observe": tell, "tell": typer.echo,
    }  # fmt: skip
    try:
        if method is Method.multisine:
            found = steps.multisine(described, **options)
        else:
            spacing: Literal["linear", "logarithmic"]
            spacing = "linear" if method is Method.linear_sweep else "logarithmic"
            found = steps.swept_sine(described, spacing=spacing, **options)
    except ValueError as error:
        raise BadInputError(str(error)) from error
    _tell(found)
    if json_file is not None:
        found.write_json(json_file)
        typer.echo(f"figures: {json_file}")
    if report is not None:
        picture = _draw(found, report, PICTURE.format(axis=file_name(name)))
        typer.echo(f"picture: {printable(picture)}")

    if found.doubt is not None:
        # What was measured is written all the same: it shows what is wrong.
        message = f"no model for axis {name}: {found.doubt}; try a larger amplitude or another band"
        raise CampaignError(message)


def _amplitude(interface: str, in_m: float | None, in_m_s: float | None) -> float | None:
    """Return the one amplitude that fits the interface of the axis."""
    right, wrong = (in_m, in_m_s) if interface == "csp" else (in_m_s, in_m)
    if wrong is not None:
        name = "--amplitude-m" if interface == "csp" else "--amplitude-m-s"
        message = f"the axis has interface {interface}: give its amplitude as {name}"
        raise BadInputError(message)
    return right


def _tell(found: object) -> None:
    from ilc_rt.identify import Identification

    assert isinstance(found, Identification)
    count, worst = len(found.frequency_hz), float(found.coherence.min())
    typer.echo(
        f"{count} frequencies, amplitude {found.experiment.amplitude:.4g}, "
        f"coherence at least {worst:.4f}"
    )
    # Figures of an output that does not follow its input say nothing.
    followed = float(np.median(found.coherence)) >= COHERENCE_MIN
    for name, value, deviation in found.rows() if followed else []:
        typer.echo(f"  {name:<24} {value:>10}{f'  +- {deviation}' if deviation else ''}")
    if found.doubt is None:
        typer.echo(f"\n{found.section()}")


def _draw(found: object, folder: Path, name: str) -> Path:
    # Here and not above: matplotlib takes its time, and bad input should not wait for it.
    import io

    import matplotlib as mpl

    from ilc_rt import plots
    from ilc_rt.identify import Identification

    assert isinstance(found, Identification)
    picture = io.BytesIO()
    with mpl.rc_context(plots.STYLE):
        found.figure().savefig(picture, format="png")
    make_folder(folder)
    try:
        (folder / name).write_bytes(picture.getvalue())
    except OSError as error:
        message = f"{folder}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error
    return folder / name
