"""`ilc tune`: propose the weights of learning for a cell, and say why."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from ilc_rt._native import tune as propose
from ilc_rt.campaign import load_cell
from ilc_rt.commands.options import CellFile, JsonFile  # noqa: TC001 - typer reads them
from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from pathlib import Path

    from ilc_rt._native import Analysis, Tuning

Uncertainty = Annotated[
    list[float] | None,
    typer.Option(
        "--uncertainty",
        help="How far the axes may be from the model, 0.2 for 20 %; several times for gains "
        "at equally spaced frequencies up to half the cycle rate.",
    ),
]
NoiseStd = Annotated[
    float | None,
    typer.Option("--noise-m", help="Standard deviation of the measurement's noise in metres."),
]
# More say nothing that these do not.
RUNS_MAX = 1_000_000
Runs = Annotated[
    int, typer.Option("--runs", min=1, max=RUNS_MAX, help="Runs in which learning should be done.")
]


def tune(
    cell: CellFile,
    uncertainty: Uncertainty = None,
    noise_m: NoiseStd = None,
    runs: Runs = 10,
    json_file: JsonFile = None,
) -> None:
    """Propose weights of norm-optimal learning for a cell, with the reasons.

    Example: ilc tune examples/01_gantry.toml --uncertainty 0.3 --noise-m 1e-6
    """
    # Weights are asked for because those in the file may be wrong.
    description = load_cell(cell, allow_divergent=True)
    gains: Any = uncertainty
    if uncertainty is not None and len(uncertainty) == 1:
        gains = uncertainty[0]
    try:
        tuning = propose(
            description.model(),
            description.n_samples,
            uncertainty=gains,
            noise_std=noise_m,
            reference=description.first_error(),
            n_runs=runs,
        )
    except ValueError as error:
        raise BadInputError(" ".join(str(error).split())) from error
    _show(tuning)
    if json_file is not None:
        _write(json_file, description.name, tuning)
        typer.echo(f"figures: {json_file}")


def _show(tuning: Tuning) -> None:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("step", no_wrap=True)
    table.add_column("choice", no_wrap=True)
    table.add_column("why")
    for step in tuning.steps:
        value = step["value"]
        choice = step["what"] if value is None else f"{step['what']} = {value:.4g}"
        table.add_row(step["name"], choice, step["why"])
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 160
    console.print(table)
    for line in _figures(tuning.analysis):
        console.print(line)
    console.print("for the cell:\n")
    console.print("[learning.norm_optimal]", markup=False)
    console.print(f"q = {tuning.q}\ns = {tuning.s:.6g}\nr = {tuning.r:.6g}\nrate = 0.0")


def _figures(analysis: Analysis) -> list[str]:
    named = {
        "error before learning, RMS": analysis.initial_error_rms,
        "error that stays, RMS": analysis.converged_error_rms,
        "expected with the noise, RMS": analysis.expected_rms_limit,
    }
    return [f"{name:30} {1e6 * value:.3f} µm" for name, value in named.items() if value is not None]


def _write(path: Path, name: str, tuning: Tuning) -> None:
    figures = {
        "cell": name,
        "q": tuning.q,
        "s": tuning.s,
        "r": tuning.r,
        "smoothing_hz": tuning.smoothing_hz,
        "steps": tuning.steps,
        "analysis": tuning.analysis.to_dict(),
    }
    try:
        path.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        message = f"{path}: {error.strerror}"
        raise BadInputError(message) from error
