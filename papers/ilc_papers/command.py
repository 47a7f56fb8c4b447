"""`ilc reproduce`: the papers that the product stands on, run through it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ilc_papers.outcome import Outcome, compute, read_json, write_json
from ilc_papers.papers import chosen, load
from ilc_papers.progress import ReproductionView
from ilc_papers.quantity import pair, ratio, verdict
from ilc_papers.workers import compute_side_by_side
from ilc_rt.commands.options import JsonFile  # noqa: TC001 - typer reads it
from ilc_rt.commands.targets import make_folder, report_target
from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

PaperName = Annotated[
    str,
    typer.Argument(
        metavar="PAPER", help="haas2016, dimarco2016, barton2010, filter-ilc, or all of them: all."
    ),
]
ReportFolder = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="DIR",
        callback=report_target,
        help="Write a page and pictures for each paper.",
    ),
]
FromFile = Annotated[
    Path | None,
    typer.Option(
        "--from", metavar="FILE", help="Take the figures from what --json wrote; compute nothing."
    ),
]
Reduced = Annotated[
    bool, typer.Option("--reduced", help="Fewer runs and samples: quick, not for comparison.")
]


def reproduce(
    paper: PaperName,
    json_file: JsonFile = None,
    report: ReportFolder = None,
    from_file: FromFile = None,
    reduced: Reduced = False,
) -> None:
    """Compute a paper's figures again, and set them beside the printed ones.

    Example: ilc reproduce haas2016

    Example: ilc reproduce all --json figures.json --report gallery

    Example: ilc reproduce all --from figures.json --report gallery
    """
    names = chosen(paper)
    if from_file is not None and reduced:
        message = f"--reduced: nothing is computed with --from {from_file}; give one of them"
        raise BadInputError(message)
    if report is not None and report.exists() and not report.is_dir():
        message = f"{report}: is a file; a folder is needed"
        raise BadInputError(message)
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 160
    if from_file is not None:
        outcomes = read_json(from_file, names)
    else:
        done: dict[str, Outcome] = {}
        try:
            outcomes = _compute(names, console, done, reduced=reduced)
        except KeyboardInterrupt:
            if json_file is not None and done:
                write_json([*done.values()], json_file)
                typer.echo(f"ilc: {json_file} has the figures of {', '.join(done)}", err=True)
            raise
    for outcome in outcomes:
        _print(outcome, console)
    if json_file is not None:
        write_json(outcomes, json_file)
        typer.echo(f"figures: {json_file}")
    if report is not None:
        # Imported here: matplotlib is slow to import, and bad input should not wait for it.
        from ilc_papers.gallery import write_gallery

        make_folder(report)
        typer.echo(f"report:  {write_gallery(outcomes, report)[0]}")


def _compute(
    names: Sequence[str], console: Console, done: dict[str, Outcome], *, reduced: bool
) -> list[Outcome]:
    parts = {name: load(name).parts[reduced] for name in names}
    with ReproductionView(console, parts) as view:
        if len(names) > 1:
            return compute_side_by_side(names, reduced=reduced, tell=view.tell, done=done)
        name = names[0]
        paper = load(name)
        return [compute(paper, reduced=reduced, tell=lambda what: view.tell(name, what))]


def _print(outcome: Outcome, console: Console) -> None:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title=escape(outcome.paper.title),
                  title_justify="left", title_style="bold")  # fmt: skip
    table.add_column(outcome.paper.name)
    for name in ("paper", "here", "ratio"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("holds", justify="center", no_wrap=True)
    table.add_column("in the paper")
    claims = outcome.claims
    for claim in claims:
        ours, printed = pair(claim.ours, claim.printed, claim.unit)
        style = "yellow" if claim.holds is False else ""
        cells = (claim.what, printed, ours, ratio(claim), verdict(claim.holds), claim.source)
        table.add_row(*map(escape, cells), style=style)
    console.print(table)
    for remark in dict.fromkeys(claim.remark for claim in claims if claim.remark):
        about = "; ".join(claim.what for claim in claims if claim.remark == remark)
        console.print(f"{about}: {remark}", style="dim", markup=False)
    sizes = " on reduced sizes" if outcome.reduced else ""
    console.print(f"{outcome.paper.name}: computed in {outcome.seconds:.1f} s{sizes}")
