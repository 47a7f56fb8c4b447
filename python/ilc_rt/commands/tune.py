"""`ilc tune`: propose the weights of learning for a cell, say why, and write them if asked."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from ilc_rt.commands.options import CellFile, JsonFile  # noqa: TC001 - typer reads them
from ilc_rt.commands.steps import Steps
from ilc_rt.errors import BadInputError
from ilc_rt.result import write_text

if TYPE_CHECKING:
    from ilc_rt.tuning import Proposal

Uncertainty = Annotated[
    list[float] | None,
    typer.Option(
        "--uncertainty",
        help="How far the axes may be from the model where it is known, 0.3 for 30 %, which is "
        "assumed; several times for gains at equally spaced frequencies up to half the cycle rate.",
    ),
]
KnownHz = Annotated[
    float | None,
    typer.Option(
        "--known-hz",
        help="Frequency up to which the model is known, as that of the first mode; 1.3 times the "
        "natural frequency of each axis if not given.",
    ),
]
NoiseStd = Annotated[
    float | None,
    typer.Option("--noise-m", help="Standard deviation of the measurement's noise in metres."),
]
Runs = Annotated[int, typer.Option("--runs", min=1, help="Runs in which learning should be done.")]
Write = Annotated[bool, typer.Option("--write", help="Put the weights into the cell description.")]


def tune(
    cell: CellFile,
    uncertainty: Uncertainty = None,
    known_hz: KnownHz = None,
    noise_m: NoiseStd = None,
    runs: Runs = 10,
    write: Write = False,
    json_file: JsonFile = None,
) -> None:
    """Propose weights of norm-optimal learning for a cell, with the reasons.

    They are tried on what the axes might be, by the cell description alone:
    nothing moves.

    Example: ilc tune examples/01_gantry.toml --uncertainty 0.3 --noise-m 1e-6
    """
    from ilc_rt.tuning import TUNED_LAWS, UNCERTAINTY, propose_weights

    with Steps("rates tried") as steps:
        found = propose_weights(
            cell,
            uncertainty=UNCERTAINTY if uncertainty is None else uncertainty,
            known_hz=known_hz,
            noise_m=0.0 if noise_m is None else noise_m,
            n_runs=runs,
            progress=steps.tell,
        )
    _show(found)
    if json_file is not None:
        write_text(json_file, json.dumps(found.to_json(), indent=2) + "\n")
        typer.echo(f"figures: {json_file}")
    if not write:
        return
    if found.law not in TUNED_LAWS:
        message = f"{cell}: left as it was: {found.notes[0]}"
        raise BadInputError(message)
    changed = found.write(cell)
    typer.echo(f"written: {cell}" if changed else f"{cell} has these weights already")


def _show(found: Proposal) -> None:
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 160
    why = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    why.add_column("weight", no_wrap=True)
    why.add_column("why")
    for reason in found.reasons:
        why.add_row(f"{reason.key} = {reason.value:g}", reason.why)
    console.print(why)
    expected = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    expected.add_column("axis", no_wrap=True)
    for title in ("RMS error at first", f"after {found.n_runs} runs", "at worst"):
        expected.add_column(title, justify="right", no_wrap=True)
    expected.add_column("which is with")
    for axis in dict.fromkeys(trial.axis for trial in found.trials):
        trials, unit = found.of(axis), found.units[axis]
        plain, worst = trials[-1], max(trials, key=lambda trial: trial.rms[-1])
        figures = [plain.rms[0], plain.rms[-1], worst.rms[-1]]
        expected.add_row(axis, *(f"{1e6 * value:.4g} µ{unit}" for value in figures), worst.what)
    console.print(expected)
    for note in found.notes:
        console.print(f"note: {note}", markup=False)
    console.print("for the cell:\n")
    console.print(found.toml(), markup=False, end="")
