"""Dummy papers: quick, broken, silent. Workers load them in separate processes."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from ilc_papers.paper import Claim, Figures, Paper, Picture, Tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Halve an error in each run."""
    tell("halving")
    return {"halved": {"error_m": [2e-3 * 0.5**run for run in range(3 if reduced else 6)]}}


def claims(figures: Figures) -> list[Claim]:
    """Return one figure to compare, one statement that holds and one that does not."""
    error_m = figures["halved"]["error_m"]
    return [
        Claim(
            "error after 2 runs [max]", error_m[2], 4e-4, "m", "Table 9", remark="Ours | is more."
        ),
        Claim("error falls", None, source="Fig. 9", holds=error_m[-1] < error_m[0]),
        Claim("error vanishes", None, source="section 9", holds=error_m[-1] == 0.0),
    ]


def draw(figures: Figures, figure: Figure) -> None:
    """Draw the error against the run."""
    figure.subplots().semilogy(figures["halved"]["error_m"])


def fail(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Fail as a paper does whose law does not fit its model."""
    tell("failing")
    message = f"reduced = {reduced}: cannot be"
    raise ValueError(message)


def vanish(_reduced: bool, _tell: Tell) -> Figures:  # noqa: FBT001
    """End the process without a word."""
    os._exit(7)


def load(name: str) -> Paper:
    """Return the paper of that name."""
    run = {"broken": fail, "silent": vanish}.get(name, compute)
    pictures = [Picture("error", "The error against the run.", draw)]
    return Paper(name, f"A. Author: On {name}. 2020", "Nothing but halves.", run, claims, pictures)
