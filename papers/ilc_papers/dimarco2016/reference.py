"""The reference of the thesis: the program of its Appendix A, by the product's interpolator.

The reference of the learning in chapter 4. Read by the other modules of this package only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ilc_rt.trajectory import Trajectory

#: Sample time of the listing, in s.
DT_S = 0.01

#: m in an inch, the unit of the listing's positions.
INCH_M = 0.0254


def appendix_a() -> Trajectory:
    """Return the program of Appendix A, in the listing's own unit, the inch.

    60 at 10 per second with an oscillation of 2 at 10 rad/s, back 40 at 5 per second with 1 at
    20 rad/s; joined by sigmoids, started by an exponential.

    1,401 samples; what the trajectory calls m are inches.
    """
    return trajectory.sigmoid_pair(
        velocity_m_s=[10.0, -5.0],
        amplitude_m=[2.0, 1.0],
        omega_rad_s=[10.0, 20.0],
        phase_zero_s=[0.0, 6.0 + DT_S],
        corner_s=6.0,
        duration_s=14.0,
        start_alpha=5.0,
        transition_alpha=2.0,
        sine_alpha=3.0,
        sine_offset_s=1.0,
        dt_s=DT_S,
    )


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return `t_s` and `x` of the printed program; `x` in inches, as printed."""
    tell("the program of Appendix A")
    path = appendix_a()
    found = {
        "t_s": path.t_s.tolist(),
        "x": path.position_m[:, 0].tolist(),
        "programmed": path.programmed_m[:, 0].tolist(),
        "unit": "in",
    }
    return {"appendix_a": found}


def claims(figures: Figures) -> list[Claim]:
    """Return the listing's statements on itself."""
    found = figures["appendix_a"]
    return [
        Claim(
            "samples of the printed program",
            float(len(found["x"])),
            1401.0,
            source="Appendix A",
            holds=len(found["x"]) == 1401,
            remark="exponents of Eq. 2.12 and 2.13 of opposite signs, as the listing has them",
        ),
    ]


def draw(figures: Figures, figure: Figure) -> None:
    """Draw the program, and its two legs without start and transition."""
    found = figures["appendix_a"]
    axes = figure.subplots()
    axes.plot(found["t_s"], found["programmed"], color="0.7", label="legs as programmed")
    axes.plot(found["t_s"], found["x"], linewidth=1.0, label="exponential/sigmoid")
    axes.set(xlabel="time (s)", ylabel="position (in)", title="Program of Appendix A")
    axes.legend()


PICTURES = (
    Picture(
        "appendix-a",
        "The program of Appendix A: an exponential start, sigmoids at the corner, and oscillations "
        "that fade before it (as Fig. 2.5 and 2.7)",
        draw,
    ),
)
