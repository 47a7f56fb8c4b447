"""The pages of several papers in one folder, and their index page.

Only the command imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_papers.page import page_name, picture_name, write_page
from ilc_rt.errors import BadInputError
from ilc_rt.result import write_text

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ilc_papers.outcome import Outcome

INDEX = "index.md"


def write_gallery(outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Write a page for each paper, and for several an index.

    The index comes first; a missing folder is created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"{folder}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error
    pages = [write_page(outcome, folder) for outcome in outcomes]
    if len(outcomes) > 1:
        index = folder / INDEX
        write_text(index, index_text(outcomes))
        pages.insert(0, index)
    return pages


def index_text(outcomes: Sequence[Outcome]) -> str:
    """Return the index of the papers' pages."""
    lines = [
        "# Papers, reproduced",
        "",
        "Each paper is run through the product: its laws, filters and trajectories, and where the",
        "paper has a machine, the controller in lock-step with simulated drives. Every figure here",
        "is computed; what a paper prints stands beside it, and where a statement does not follow",
        "from the print, the page says so.",
        "",
    ]
    for outcome in outcomes:
        paper = outcome.paper
        lines += [f"## [{paper.name}]({page_name(outcome)})", "", f"{paper.title}.", ""]
        lines += [counted(outcome), ""]
        if paper.pictures:
            first = paper.pictures[0]
            lines += [f"[![{first.caption}]({picture_name(outcome, first.stem)})]"
                      f"({page_name(outcome)})", ""]  # fmt: skip
    return "\n".join(lines).rstrip() + "\n"


def counted(outcome: Outcome) -> str:
    """Return the number of a paper's statements that hold, as a sentence."""
    judged = [claim.holds for claim in outcome.claims if claim.holds is not None]
    compared = sum(claim.printed is not None for claim in outcome.claims)
    return (
        f"{sum(judged)} of {len(judged)} statements hold; {compared} printed figures are compared."
    )
