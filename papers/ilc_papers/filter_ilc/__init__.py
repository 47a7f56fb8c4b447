"""Filter-based open-loop ILC: the parallel P-type law with filters and mechanisms.

`ilc_papers.papers` imports it by name.
"""

from __future__ import annotations

from ilc_papers.filter_ilc import convergence, disturbance, filters, mechanisms
from ilc_papers.paper import Claim, Figures, Paper, Tell

_ABOUT = """
One axis with an integrator, its position loop closed by gain (kp = 2), learns the X axis of the
butterfly contour at 2 ms. The learned signal is added to the controller's output:
`u = w + C e`, `w' = w + 0.5 Q e[k + lead]` (`ErrorFeedforwardIlc`), and the encoder has white noise
of 0.3 µm. Without a filter the error falls and then rises; a zero-phase low-pass keeps it down, a
switched one opens where the motion is fast, and a gate, a ladder and a bound do what the paper's
mechanisms do. `analyze` says before the first run which cut-off is possible.

The print leaves open the axis's limits (1 m/s², 100 m/s³ here), the size of the disturbance, and
the order of the filter (fourth is said, third printed). Eq. 2 lacks the lead of one sample that
eq. 9 has, and eq. 3 has a misprint in C.
"""

_SECTIONS = (convergence, filters, mechanisms, disturbance)


def _compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    figures: Figures = {}
    for section in _SECTIONS:
        figures |= section.compute(reduced, tell)
    return figures


def _claims(figures: Figures) -> list[Claim]:
    return [claim for section in _SECTIONS for claim in section.claims(figures)]


PAPER = Paper(
    name="filter-ilc",
    title="Filter-based open-loop iterative learning control of a machine tool's axis",
    about=_ABOUT,
    compute=_compute,
    parts=(26, 16),
    claims=_claims,
    pictures=[picture for section in (filters, convergence, mechanisms, disturbance)
              for picture in section.PICTURES],
)  # fmt: skip
