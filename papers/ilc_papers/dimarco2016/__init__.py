"""DiMarco 2016: exponential/sigmoid interpolation and DPW-ILC, for modulated tool paths.

`ilc_papers.papers` imports it by name.
"""

from __future__ import annotations

from ilc_papers.dimarco2016 import (
    condition,
    corner,
    index,
    learning,
    pictures,
    reference,
    settings,
)
from ilc_papers.paper import Claim, Figures, Paper, Tell

_ABOUT = """
A modulated tool path is a feed with an oscillation along it that breaks chips. Linear interpolation
with limited jerk loses its frequency or its amplitude, whichever way the machine is set;
exponential/sigmoid interpolation (E/S, `trajectory.exponential_sigmoid`) keeps both. The index J
weighs tracking error and acceleration.

Then a motor under PD control repeats the program of Appendix A while the temperature changes from
run to run: its resistance follows it, or the part expands. Compared are PD control alone, PD-ILC
(`PdIlc`), Flexible ILC (`FlexibleIlc`), and DPW-ILC (`RelevanceIlc`), which weighs all past runs by
how well they went and how near their temperature was, and its trimmed form.

The thesis leaves open, and this takes: "2 Hz" as 2 rad/s, a run of 10 s and a jerk limit of 1000/s
times that of acceleration for J; a Q filter of 25 taps, without which PD-ILC diverges; the ILC
signal added to the reference of the PD loop (Fig. 4.1 is missing) and stored as it is; the law of
the text (one sample of lead, kp = kd = 1.284), not of the listing; EPSILON = 1 as listed;
temperatures as white noise through a first-order low-pass (pole 0.3), mapped so that all within
100 K are as likely; 1 K as the resolution of Flexible ILC's table. Lengths of chapter 4 are inches,
as printed: the weights of the relevance depend on them.

The thesis says of the temperatures only that they are random, filtered, and within 100 K either
way. The outcome for the expansion depends on which are taken. Gaussian ones with a standard
deviation of 40 K and a pole of 0.9, tried first, left DPW-ILC at 0.72 of the error of PD-ILC (0.12
for the motor), and temperatures that are all as likely and wander slowly left it at about 0.25,
without further improvement: how far DPW-ILC lies below PD-ILC, and whether it goes on improving
there, is not robust. For the motor both held in every trial, and trimming to the 30 most relevant
hurt in none.
"""


def _compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    return {
        **reference.compute(reduced, tell),
        "interpolation": {
            **settings.compute(reduced, tell),
            **index.compute(reduced, tell),
            **corner.compute(reduced, tell),
        },
        **condition.compute(reduced, tell),
        **learning.compute(reduced, tell),
    }


def _claims(figures: Figures) -> list[Claim]:
    sections = (reference, settings, index, corner, condition, learning)
    return [claim for section in sections for claim in section.claims(figures)]


PAPER = Paper(
    name="dimarco2016",
    title="C. S. DiMarco: Robust interpolation and iterative learning strategies for modulated "
    "tool path planning. Thesis, 2016",
    about=_ABOUT,
    compute=_compute,
    parts=(45, 11),
    claims=_claims,
    pictures=[
        *settings.PICTURES,
        *index.PICTURES,
        *corner.PICTURES,
        *reference.PICTURES,
        *condition.PICTURES,
        *pictures.PICTURES,
    ],
)
