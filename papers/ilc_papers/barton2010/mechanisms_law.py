"""The coordinated laws of section 8.2: joint inputs, errors at the tools, three objectives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ilc_papers.barton2010.delta_paths import HOME_RAD
from ilc_papers.barton2010.mechanisms_cell import N_AGENTS, N_LEGS, Machine, tools_m
from ilc_rt import NormOptimalIlc, StateSpace, ThroughJacobian, signal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt import Law

    Array = NDArray[np.float64]

Case = Literal["individual", "formation", "combined"]
CASES: tuple[Case, ...] = ("individual", "formation", "combined")
#: Tables 8.2 to 8.5, for errors in mm and inputs in rad, as the Jacobian (8.2) has them.
SIGMA_Q, SIGMA_S, SIGMA_R = np.array([1.0, 0.8, 1.0]), 1.0, 0.5
#: Share of tracking, X1, in the combined case; the rest is the formation's.
COMBINED = {"raster": 0.1, "spiral": 0.5}
#: Bandwidth of the Gaussian filter of the input (section 8.3.1).
BANDWIDTH_HZ = {"raster": 5.0, "spiral": 3.0}
#: From a weight of errors in mm to one of errors in m.
PER_MM2 = 1e6


class AtTheTools:
    """A law that learns from the tool positions, while the drives measure angles.

    ``e_tool[k] = p[k] - forward(theta[k])`` for each mechanism; the output of the wrapped law is
    smoothed, like the set points of the thesis (section 8.3.1).

    Parameters
    ----------
    law : object
        A law with joint inputs and errors of all tools, shape (n_samples, 9) both.
    machine : Machine
        The cell and the paths of its tools.
    bandwidth_hz : float or None
        Bandwidth of the Gaussian filter in Hz; None for no filter.
    """

    def __init__(self, law: Law, machine: Machine, bandwidth_hz: float | None) -> None:
        self.law = law
        self.machine = machine
        cycle_s = machine.cell.cycle_s
        self.smooth = None if bandwidth_hz is None else signal.gaussian(bandwidth_hz, cycle_s)

    def __repr__(self) -> str:
        return f"AtTheTools({self.law!r}, {self.smooth!r})"

    def update(self, u: Array, e: Array, disturbance: Array | None = None) -> Array:
        """Return the next input of all joints, from the errors of all joints."""
        angles = np.tile(self.machine.angle_rad, N_AGENTS) - e
        missed = self.machine.tool_m[:, None, :] - tools_m(self.machine.delta, angles)
        following = self.law.update(u, missed.reshape(len(e), -1), disturbance)
        return following if self.smooth is None else self.smooth.zero_phase(following)


def coordinated(path: str, case: Case, machine: Machine, *, is_smoothed: bool = True) -> AtTheTools:
    """Return the law (8.7) of a case: the model is the drives' with a constant Jacobian behind it.

    The formation (8.8) is that of x and y; z is tracked by the tracking term, and not at all if
    only the formation counts. The input passes the printed Gaussian filter if it `is_smoothed`.
    """
    jacobian = machine.delta.jacobian(np.full(N_LEGS, HOME_RAD))
    legs = one_mechanism(machine)
    at_tool = StateSpace(legs.a, legs.b, jacobian @ legs.c, jacobian @ legs.d, legs.dt_s)
    tracking = {"individual": 1.0, "formation": 0.0, "combined": COMBINED[path]}[case]
    law = NormOptimalIlc.formation(
        [at_tool] * N_AGENTS, machine.cell.n_samples, tracking=tracking,
        sigma=PER_MM2 * SIGMA_Q, s=SIGMA_S, r=SIGMA_R, axes=[0, 1],
    )  # fmt: skip
    return AtTheTools(law, machine, BANDWIDTH_HZ[path] if is_smoothed else None)


def through_jacobians(path: str, machine: Machine) -> AtTheTools:
    """Return the law of case 1 with the Jacobian of every sample in place of a constant one.

    The thesis leaves it open (section 7.2.3): a law of the joints, with weights J' Q J.
    """
    n_samples, n_joints = machine.cell.n_samples, N_AGENTS * N_LEGS
    jacobians = np.zeros((n_samples, n_joints, n_joints))
    own = machine.delta.jacobian(machine.angle_rad)
    for agent in range(N_AGENTS):
        place = slice(N_LEGS * agent, N_LEGS * (agent + 1))
        jacobians[:, place, place] = own
    weight = PER_MM2 * np.repeat(SIGMA_Q, N_LEGS)
    q = np.einsum("kia,i,kib->kab", jacobians, weight, jacobians)
    law = NormOptimalIlc(machine.cell.model(), n_samples, q=q, s=SIGMA_S, r=SIGMA_R)
    return AtTheTools(ThroughJacobian(law, jacobians), machine, BANDWIDTH_HZ[path])


def one_mechanism(machine: Machine) -> StateSpace:
    """Return the model of the first mechanism's drives, set point to angle."""
    whole = machine.cell.model()
    n_states = whole.n_states // N_AGENTS
    states, joints = slice(n_states), slice(N_LEGS)
    return StateSpace(
        whole.a[states, states], whole.b[states, joints],
        whole.c[joints, states], whole.d[joints, joints], whole.dt_s,
    )  # fmt: skip


__all__ = ["BANDWIDTH_HZ", "CASES", "COMBINED", "Case", "coordinated", "through_jacobians"]
