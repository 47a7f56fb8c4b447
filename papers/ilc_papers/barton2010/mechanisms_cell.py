"""Three delta mechanisms as one cell: nine rotary drives on a bus, and their table of set points.

A drive's own position loop represents a leg with its stabilising controller: it has the natural
frequency and damping that (8.3) with table 8.1 gives the leg (7.19).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.barton2010 import delta_leg
from ilc_papers.barton2010.delta_paths import DT_S, tool_path_m
from ilc_rt import Campaign, Cell
from ilc_rt.kinematics import Delta

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ilc_rt import Law

    Array = NDArray[np.float64]

#: Mechanisms, and legs of each.
N_AGENTS, N_LEGS = 3, 3
#: Encoder counts of the drives per radian: 20 bits per turn.
COUNTS_PER_RAD = 2**20 / (2.0 * math.pi)
#: Noise of the encoders: standard deviation.
NOISE_RAD = 1e-5
#: Natural frequency of each mechanism's legs over the nominal one: "dynamically similar".
SIMILAR = (1.0, 0.96, 1.03)

_AXIS = """
[[axis]]
name = "{name}"
node = {node}
interface = "csp"
unit = "rad"
counts_per_m = {counts}

[axis.limits]
position_min_m = -1.2
position_max_m = 1.2
velocity_max_m_s = 6.0
acceleration_max_m_s2 = 200.0
jerk_max_m_s3 = 8000.0
following_error_max_m = 0.5

[axis.model]
natural_frequency_hz = {model_hz}
damping = {model_damping}
delay_samples = 1

[axis.simulation]
mass_kg = {inertia}
natural_frequency_hz = {natural_hz}
damping = {damping}
force_max_n = 5.0
coulomb_n = {coulomb}
static_n = {static}
stribeck_m_s = 0.02
position_start_m = {start}
"""

_HEAD = """[cell]
name = "mechanisms"
cycle_us = {cycle_us}

[bus]
address = "loopback:"
"""

_JOB = """
[simulation]
step_us = 500
encoder_noise_m = {noise}
seed = {seed}

[program]
kind = "table"
file = "set_points.csv"
start_m = {start}
feed_m_s = 1.0

[learning]
law = "none"
measure = "encoder"
input_max_m = 0.5
rollback_ratio = 1000.0

[telemetry]
enabled = false
"""


@dataclass(frozen=True)
class Agent:
    """Deviations of one mechanism's legs from the nominal ones."""

    #: Natural frequency of its loops over the nominal one.
    natural: float
    #: Coulomb friction in N m; static friction is twice that.
    coulomb_nm: float = 0.002
    #: Damping of its loops over the nominal one.
    damping: float = 1.0


def agents(*, is_disturbed: bool) -> list[Agent]:
    """Return the three mechanisms; the first one with another end effector and friction or not."""
    found = [Agent(natural) for natural in SIMILAR]
    if is_disturbed:
        found[0] = Agent(natural=0.75, coulomb_nm=0.01, damping=0.8)
    return found


def nominal_leg() -> tuple[float, float]:
    """Return natural frequency in rad/s and damping of a leg under its controller."""
    return delta_leg.stabilised_poles()


@dataclass(frozen=True)
class Machine:
    """A cell on disk, and the references of its tools."""

    cell: Cell
    library: Path
    #: Set points of one mechanism, rests included, shape (n_samples, 3).
    angle_rad: Array
    #: Reference of its tool in the meantime, shape (n_samples, 3).
    tool_m: Array
    delta: Delta

    def run(self, law: Law | None, iterations: int) -> list[Array]:
        """Run a campaign in lock-step; return the tool positions, (n_samples, 3, 3) per run."""
        campaign = Campaign(self.cell, law, self.library)
        return [tools_m(self.delta, record.encoder_m) for record in campaign.run(iterations)]


def tools_m(delta: Delta, angles_rad: Array) -> Array:
    """Return the tool positions, shape (n_samples, n_agents, 3), from all joints of a run."""
    poses = np.ascontiguousarray(angles_rad).reshape(-1, N_LEGS)
    return delta.forward(poses).reshape(len(angles_rad), -1, 3)


def build(folder: Path, path: str, *, is_disturbed: bool, seed: int = 1) -> Machine:
    """Write the cell and its table into a folder, and load it.

    `path` is a reference, `raster` or `spiral`. If disturbed, the first mechanism differs from the
    model used for learning; `seed` is that of the encoders' noise.
    """
    delta = Delta()
    angle_rad = delta.inverse(tool_path_m(delta, path))
    table = np.tile(angle_rad, N_AGENTS)
    names = [f"s{m}l{i}" for m in range(1, N_AGENTS + 1) for i in range(1, N_LEGS + 1)]
    rows = [",".join(names), *(",".join(repr(float(v)) for v in row) for row in table)]
    (folder / "set_points.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    natural_rad_s, damping = nominal_leg()
    natural_hz = natural_rad_s / (2.0 * math.pi)
    drives = ""
    for number, name in enumerate(names):
        agent = agents(is_disturbed=is_disturbed)[number // N_LEGS]
        drives += _AXIS.format(
            name=name, node=number + 1, counts=COUNTS_PER_RAD,
            model_hz=natural_hz, model_damping=damping, inertia=delta_leg.INERTIA,
            natural_hz=agent.natural * natural_hz, damping=agent.damping * damping,
            coulomb=agent.coulomb_nm, static=2.0 * agent.coulomb_nm,
            start=float(table[0, number]),
        )  # fmt: skip
    start = [float(value) for value in table[0]]
    text = (
        _HEAD.format(cycle_us=round(DT_S * 1e6))
        + drives
        + _JOB.format(noise=NOISE_RAD, seed=seed, start=start)
    )
    file = folder / "cell.toml"
    file.write_text(text, encoding="utf-8")
    cell = Cell.load(file)
    angles = cell.reference()[:, :N_LEGS]
    return Machine(cell, folder / "library.db", angles, delta.forward(angles), delta)


__all__ = ["DT_S", "N_AGENTS", "N_LEGS", "Machine", "agents", "build", "nominal_leg", "tools_m"]
