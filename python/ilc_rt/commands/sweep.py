"""`ilc sweep`: the robustness map of a cell over varied parameters."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from ilc_rt.commands.options import CellFile, JsonFile  # noqa: TC001 - typer reads them
from ilc_rt.commands.steps import Steps
from ilc_rt.commands.targets import check_file, write_picture
from ilc_rt.errors import BadInputError
from ilc_rt.text import printable

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from matplotlib.figure import Figure

Vary = Annotated[
    list[str],
    typer.Option(
        "--vary",
        metavar="KEY=LOW:HIGH[:log]",
        help="Key of the cell and its range, e.g. axis.x.simulation.mass_kg=20:200:log; several "
        "times for several keys, drawn together.",
    ),
]
Samples = Annotated[int, typer.Option("--samples", min=1, max=1_000_000, help="Cases drawn.")]
Iterations = Annotated[
    int, typer.Option("--iterations", min=2, max=10_000, help="Runs of each case.")
]
Below = Annotated[
    float,
    typer.Option(
        "--converged-below",
        min=0.0,
        max=1.0,
        help="Share of the first error that the last one must be below to count as converged.",
    ),
]
Where = Annotated[
    str,
    typer.Option(
        "--executor",
        metavar="WHERE",
        help="serial, processes, processes:N, or dask:tcp://HOST:PORT, the scheduler of a cluster.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the drawing.")]
Kept = Annotated[
    Path | None,
    typer.Option(
        "--file",
        metavar="FILE",
        help="Keeps every result at once; a sweep cut off resumes from it.",
    ),
]
Picture = Annotated[
    Path | None, typer.Option("--picture", metavar="FILE", help="The map as .png, .svg or .pdf.")
]
PICTURES = (".png", ".svg", ".pdf")


def sweep(
    cell: CellFile,
    vary: Vary,
    samples: Samples = 50,
    iterations: Iterations = 10,
    converged_below: Below = 0.5,
    executor: Where = "serial",
    seed: Seed = 0,
    file: Kept = None,
    picture: Picture = None,
    json_file: JsonFile = None,
) -> None:
    """Let a cell learn in simulation with varied parameters: the map of its robustness.

    Every case is a campaign on simulated drives, in lock-step: nothing moves.

    Example: ilc sweep examples/01_gantry.toml --vary axis.y.simulation.mass_kg=10:80 --samples 20
    """
    from ilc_rt.cell_sweep import robustness_map
    from ilc_rt.result import json_text, write_text

    if picture is not None:
        if picture.suffix not in PICTURES:
            message = f"--picture {picture}: allowed {', '.join(PICTURES)}"
            raise BadInputError(message)
        check_file("--picture", picture)
    try:
        with ExitStack() as stack:
            steps = stack.enter_context(Steps("cases"))
            found = robustness_map(
                cell, vary, samples, iterations, converged_below=converged_below, seed=seed,
                file=file, executor=_executor(executor, stack), progress=steps.tell,
            )  # fmt: skip
    except KeyboardInterrupt:
        if file is not None:
            typer.echo(f"ilc: {printable(file)} has every finished case; go on with it", err=True)
        raise
    typer.echo(found.sentence())
    for row in found.by_parameter():
        typer.echo(f"{printable(row['key'])}:")
        for part in row["parts"]:
            if part["cases"]:
                worst = part["worst_error_m"]
                said = "no run" if worst is None else f"worst {1e6 * worst:.4g} µm"
                typer.echo(
                    f"  {part['from']:10.4g} to {part['to']:10.4g}  {part['cases']:5d} cases  "
                    f"{100 * part['converged_share']:5.1f} % converge  {said}"
                )
    if json_file is not None:
        write_text(json_file, json_text(found.to_json()))
        typer.echo(f"figures: {printable(json_file)}")
    if picture is not None:
        write_picture(picture, cast("Figure", found.plot()[0].figure))
        typer.echo(f"picture: {printable(picture)}")


def _executor(where: str, stack: ExitStack) -> Executor | None:
    """Return the executor of this name; it ends with the stack."""
    kind, _, rest = where.partition(":")
    if where == "serial":
        return None
    if kind == "processes" and (not rest or (rest.isdigit() and 0 < int(rest) <= 1024)):
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        # A fork would copy threads of this process half-way through their work.
        pool = ProcessPoolExecutor(int(rest) if rest else None, mp_context=get_context("spawn"))
        # After Ctrl-C the cases that wait are not begun.
        stack.callback(pool.shutdown, cancel_futures=True)
        return pool
    if kind == "dask" and rest:
        try:
            from distributed import Client
        except ImportError as error:
            message = "--executor dask: needs the extra, pip install 'ilc-rt[cluster]'"
            raise BadInputError(message) from error
        try:
            connect: Any = Client
            client = stack.enter_context(connect(rest, timeout="10s"))
        except (OSError, ValueError, TimeoutError) as error:
            message = f"--executor {where}: no scheduler there: {error}"
            raise BadInputError(message) from error
        cluster: Executor = stack.enter_context(client.get_executor())
        return cluster
    message = f"--executor {where}: allowed serial, processes, processes:N or dask:tcp://HOST:PORT"
    raise BadInputError(message)
