"""Barton 2010: norm-optimal, coupled and coordinated iterative learning control."""

from __future__ import annotations

from ilc_papers.barton2010 import (
    appendix_i,
    bursts,
    delta,
    dissimilar,
    formation,
    mechanisms,
    raster,
    robustness,
    servo,
    uncertain,
)
from ilc_papers.paper import Claim, Figures, Paper, Tell

#: Modules of the sections; each makes the figures under its own name.
SECTIONS = (
    servo,
    robustness,
    raster,
    uncertain,
    bursts,
    formation,
    delta,
    mechanisms,
    appendix_i,
    dissimilar,
)

ABOUT = """
Norm-optimal learning and what its weights do: a servo axis (section 3.4), time-varying weights on
a stage for micro-robotic deposition (chapter 5), three agents that keep a formation (chapter 6),
the kinematics of a delta mechanism (chapter 7), three such mechanisms as nine drives on the bus of
the real controller (chapter 8), a small worked example with printed tables (appendix I), and a fast
axis that helps a slow one (appendix J).

Left open by the print, and chosen here: size, speed and limits of the rasters; the x axis of the
stage (taken like the y axis); high and low weights that are shown in graphs alone; the
uncertainty of section 5.5, said to be in appendix B and not there; the size of noise bursts, of the
agents' uncertainty and of the disturbance of agent 1; speed and flow of appendix J; the masses
of a leg, the size of the mechanisms' paths, how alike the mechanisms are, and the units of the
weights of chapter 8 (errors in mm, inputs in rad, as the Jacobian has them). Read
differently from the print: the controller (5.13), unstable as it stands; table I.3, whose E_h2
lacks a power of ten; the listings, of which H.1 filters a doubled vector (twice the bandwidth),
case 1 never assigns its weight and case 4 takes I/3 for K. Values that are only drawn are not
compared.
"""


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return the figures of every section under its name."""
    return {_name(section): section.compute(reduced, tell) for section in SECTIONS}


def claims(figures: Figures) -> list[Claim]:
    """Compare every section with the print."""
    return [claim for section in SECTIONS for claim in section.claims(figures[_name(section)])]


def _name(section: object) -> str:
    return str(getattr(section, "__name__", "")).rpartition(".")[2]


PAPER = Paper(
    name="barton2010",
    title="K. L. Barton, Precision coordination and motion control of multiple systems via "
    "iterative learning control, dissertation, University of Illinois, 2010",
    about=ABOUT,
    compute=compute,
    parts=(27, 27),
    claims=claims,
    pictures=[picture for section in SECTIONS for picture in section.PICTURES],
)
