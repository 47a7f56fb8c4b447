"""The three agents of two axes of chapter 6 and appendix I.

Sections `appendix_i` and `formation` import it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_papers.barton2010.servo_system import gain
from ilc_rt import StateSpace, discretize, from_transfer_function

if TYPE_CHECKING:
    from collections.abc import Sequence

#: Sample time, appendix I.
DT_S = 1.0
#: Masses and dampings of x1, y1, x2, y2, x3, y3; sampled they are (B.1).
MASSES_KG = (1.55, 1.51, 0.75, 0.80, 0.91, 0.89)
DAMPINGS_N_S_M = (0.62, 0.60, 0.52, 0.58, 0.90, 0.88)
#: Proportional controller, eq. (6.17).
CONTROLLER_GAIN = 0.425
#: Channels in the order of inputs and errors, and of formation errors.
AXES = ("x1", "y1", "x2", "y2", "x3", "y3")
FORMATION = ("d1", "d2", "d3", "h1", "h2", "h3")


def agents() -> list[StateSpace]:
    """Return a model of each agent, from its two inputs to its two positions in m.

    `G = 1/(m s^2 + b s)` with zero-order hold, `P = G / (1 + 0.425 G)`: the learned input goes
    straight into the plant, and the reference does not pass through the controller.

    References
    ----------
    Barton 2010, eq. (6.16), (6.17), (B.1), appendix I.1.
    """
    controller = gain(CONTROLLER_GAIN, DT_S)
    axes = [
        discretize(from_transfer_function([1.0], [mass, damping, 0.0]), DT_S).feedback(controller)
        for mass, damping in zip(MASSES_KG, DAMPINGS_N_S_M, strict=True)
    ]
    return [x.append(y) for x, y in zip(axes[::2], axes[1::2], strict=True)]


def together(models: Sequence[StateSpace]) -> StateSpace:
    """Return the agents stacked into one model."""
    whole = models[0]
    for model in models[1:]:
        whole = whole.append(model)
    return whole
