"""Haas et al. 2016: CO-ILC against PD-ILC, on a positioning axis and on a gantry.

`ilc_papers.papers` imports it by name.
"""

from __future__ import annotations

from ilc_papers.haas2016 import constrained, gantry, positioning
from ilc_papers.paper import Claim, Figures, Paper, Tell

_ABOUT = """
A second-order axis (157 rad/s, damping 0.5) makes two positioning moves; convex-optimisation
learning (CO-ILC, `NormOptimalIlc(rate=3)`) is compared with PD-ILC (`PdIlc`). Then a two-axis
gantry learns a contour, from its encoders (ENC) or from the tool centre point (KGM), run by the
controller in lock-step with simulated drives.

The paper prints no sample time: 1, 2 and 4 ms are shown. Nor does it print acceleration and jerk
of the moves (2 m/s² and 50 m/s³ here), or of the bench more than masses, 15 Hz and 20 Hz: friction,
the crossbeam's mode and an orthogonality error of 2.5 mrad are chosen so that it behaves like the
bench ([bench.toml](../../papers/ilc_papers/haas2016/bench.toml)). The bench runs at 4 ms with
d = 3; what counts is the product of the two. The model knows neither friction nor mode.

Its outlook is delivered: the optimisation runs on the controller, between the runs, and set points,
inputs and outputs can be bounded (`ConstrainedIlc`).
"""


def _compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    return {
        **positioning.compute(reduced, tell),
        **constrained.compute(reduced, tell),
        **gantry.compute(reduced, tell),
    }


def _claims(figures: Figures) -> list[Claim]:
    return positioning.claims(figures) + gantry.claims(figures) + constrained.claims(figures)


PAPER = Paper(
    name="haas2016",
    title="T. Haas, N. Lanz, R. Keller, S. Weikert, K. Wegener: Iterative learning for machine "
    "tools using a convex optimisation approach. Procedia CIRP 46 (2016)",
    about=_ABOUT,
    compute=_compute,
    parts=(15, 15),
    claims=_claims,
    pictures=[*positioning.PICTURES, *gantry.PICTURES, *constrained.PICTURES],
)
