"""One page of Markdown per paper: summary, printed figures beside ours, plots.

Made from an outcome alone, whether just computed or read from a file. The gallery imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure

from ilc_papers.quantity import pair, ratio, verdict
from ilc_rt.errors import BadInputError
from ilc_rt.pictures.themes import WIDTH_IN, style
from ilc_rt.result import write_text

if TYPE_CHECKING:
    from pathlib import Path

    from ilc_papers.outcome import Outcome
    from ilc_papers.paper import Claim


def write_page(outcome: Outcome, folder: Path) -> Path:
    """Write a paper's page and its plots.

    The folder must exist.
    """
    for picture in outcome.paper.pictures:
        target = folder / picture_name(outcome, picture.stem)
        with mpl.rc_context(style()):
            figure = Figure(figsize=(WIDTH_IN, 3.6))
            picture.draw(outcome.figures, figure)
            try:
                # Without program version or date, so that the same figures give the same file.
                figure.savefig(target, metadata={"Software": None})
            except OSError as error:
                message = f"{target}: cannot be written: {error.strerror}"
                raise BadInputError(message) from error
    target = folder / page_name(outcome)
    write_text(target, text(outcome))
    return target


def page_name(outcome: Outcome) -> str:
    """Return the name of a paper's page."""
    return f"{outcome.paper.name}.md"


def picture_name(outcome: Outcome, stem: str) -> str:
    """Return the name of one of a paper's plots."""
    return f"{outcome.paper.name}-{stem}.png"


def text(outcome: Outcome) -> str:
    """Return a paper's page as Markdown."""
    paper = outcome.paper
    reduced = " **Reduced sizes: for a look, not for comparison.**" if outcome.reduced else ""
    option = " --reduced" if outcome.reduced else ""
    lines = [
        f"# {paper.name}",
        "",
        f"{paper.title}.",
        "",
        paper.about.strip(),
        "",
        f"`ilc reproduce {paper.name}{option}` computes all of it again, in "
        f"{outcome.seconds:.0f} s where this page was made.{reduced}",
        "",
        "## What the paper says, and what comes out",
        "",
        "| | paper | here | ratio | holds | in the paper |",
        "|---|--:|--:|--:|:-:|---|",
    ]
    claims = outcome.claims
    notes = list(dict.fromkeys(claim.remark for claim in claims if claim.remark))
    lines += [_row(claim, notes) for claim in claims]
    lines.append("")
    lines += [f"{number}. {note}" for number, note in enumerate(notes, start=1)]
    if notes:
        lines.append("")
    for picture in paper.pictures:
        name = picture_name(outcome, picture.stem)
        lines += [f"![{picture.caption}]({name})", "", f"*{picture.caption}*", ""]
    return "\n".join(lines).rstrip() + "\n"


def _row(claim: Claim, notes: list[str]) -> str:
    ours, printed = pair(claim.ours, claim.printed, claim.unit)
    note = f" ({notes.index(claim.remark) + 1})" if claim.remark else ""
    cells = [claim.what + note, printed, ours, ratio(claim), verdict(claim.holds)]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in [*cells, claim.source]) + " |"
