"""Jerk-limited moves: plans of `MovePlan` and of Ruckig, in one process."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import ruckig
from problem import median_s

from ilc_rt.trajectory import MovePlan

if TYPE_CHECKING:
    from collections.abc import Callable

N_MOVES = 1000
LIMITS = {"velocity_max_m_s": 0.5, "acceleration_max_m_s2": 10.0, "jerk_max_m_s3": 800.0}


def compare(n_axes: int) -> dict[str, float]:
    """Return the median seconds of a plan, from motion to rest, and per move of a program."""
    random = np.random.default_rng(7)
    start_m, end_m = random.uniform(-0.1, 0.1, (2, n_axes))
    velocity_m_s = random.uniform(-0.3, 0.3, n_axes)
    points_m = np.vstack([start_m, end_m])
    program_m = random.uniform(-0.1, 0.1, (N_MOVES + 1, n_axes))

    def one() -> MovePlan:
        return MovePlan(points_m, feed_m_s=0.5, start_velocity_m_s=velocity_m_s, **LIMITS)

    def program(setting: str) -> MovePlan:
        return MovePlan(program_m, feed_m_s=0.5, setting=setting, **LIMITS)

    generator = ruckig.Ruckig(n_axes)
    start, end, at_start = start_m.tolist(), end_m.tolist(), velocity_m_s.tolist()
    zeros = [0.0] * n_axes
    highest = [[limit] * n_axes for limit in LIMITS.values()]

    def given() -> ruckig.InputParameter:
        wanted = ruckig.InputParameter(n_axes)
        wanted.current_position, wanted.target_position = start, end
        wanted.current_velocity, wanted.target_velocity = at_start, zeros
        wanted.current_acceleration = wanted.target_acceleration = zeros
        wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = highest
        return wanted

    def by_ruckig() -> ruckig.Trajectory:
        found = ruckig.Trajectory(n_axes)
        generator.calculate(given(), found)
        return found

    agree(one(), by_ruckig(), n_axes)
    kept, found = given(), ruckig.Trajectory(n_axes)
    return {
        "ilc-rt": median_s(one),
        "ilc-rt, program of 1,000 moves, completed, per move": per_move_s(program, "complete"),
        "ilc-rt, the same on time, per move": per_move_s(program, "on_time"),
        "Ruckig, inputs set and calculated": median_s(by_ruckig),
        "Ruckig, calculated again": median_s(lambda: generator.calculate(kept, found)),
    }


def per_move_s(program: Callable[[str], object], setting: str) -> float:
    """Return the median seconds of a program divided by its moves."""
    seconds = []
    for _ in range(21):
        begun = time.perf_counter()
        program(setting)
        seconds.append(time.perf_counter() - begun)
    return float(np.median(seconds)) / N_MOVES


def agree(plan: MovePlan, found: ruckig.Trajectory, n_axes: int) -> None:
    """Require the same duration on one axis, and none longer on several."""
    excess = plan.duration_s / found.duration - 1.0
    if excess > 1e-9 or (n_axes == 1 and excess < -1e-9):
        message = f"{plan.duration_s} s, and {found.duration} s by Ruckig, on {n_axes} axes"
        raise AssertionError(message)
