"""Barton 2010: norm-optimal, coupled and coordinated iterative learning control."""

from __future__ import annotations

from ilc_rt.reproduce.barton2010 import (
    appendix_i,
    robustness,
    servo,
)
from ilc_rt.reproduce.paper import Claim, Figures, Paper, Tell

#: Modules of the sections; each makes the figures under its own name.
SECTIONS = (
    servo,
    robustness,
    appendix_i,
)

ABOUT = """
todo
"""


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return the figures of every section under its name."""
    return {_name(section): section.compute(reduced, tell) for section in SECTIONS}


def claims(figures: Figures) -> list[Claim]:
    """Set what every section prints beside its figures."""
    return [claim for section in SECTIONS for claim in section.claims(figures[_name(section)])]


def _name(section: object) -> str:
    return str(getattr(section, "__name__", "")).rpartition(".")[2]


PAPER = Paper(
    name="barton2010",
    title="K. L. Barton, Precision coordination and motion control of multiple systems via "
    "iterative learning control, dissertation, University of Illinois, 2010",
    about=ABOUT,
    compute=compute,
    claims=claims,
    pictures=[picture for section in SECTIONS for picture in section.PICTURES],
)
