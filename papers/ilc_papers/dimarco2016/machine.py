"""The machine of chapter 4: a motor with PD control, and the effects of temperature.

Units are the thesis's: the tool position counts as the angle of the motor, in inches as the
reference does. Read by the other modules of this package only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.dimarco2016.reference import DT_S
from ilc_rt import StateSpace, discretize
from ilc_rt.control import Pid

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Table 4.1: rotor inertia, viscous friction, torque and back-EMF constant, resistance, inductance.
_INERTIA, _FRICTION, _CONSTANT, _RESISTANCE, _INDUCTANCE = 0.01, 1.0, 1.0, 1.0, 0.005

#: Thermal coefficient of the resistance in 1/K (Eq. 4.16).
ALPHA_R = 3.9e-3

#: Coefficients of the expansion in 1/K and 1/K² (Eq. 4.17).
ALPHA_1, ALPHA_2 = 3e-6, 5e-7

# Random temperature: white noise through a first-order low-pass, mapped so that every temperature
# within 100 K is as likely. Printed is "filtered random" and "up to 100 °C in either direction".
_POLE, _LARGEST_K, _SETTLING = 0.3, 100.0, 100


@dataclass(frozen=True)
class System:
    """One of the two examples of section 4.2.

    Parameters
    ----------
    name : str
        Its key in the figures.
    loop : callable
        `loop(temperature_k)` returns the closed PD loop, from reference to tool position.
    expansion : callable
        `expansion(temperature_k)` returns the tool position over the position relative to the part.
    disturbance_weight : float
        N_d of the relevance (Eq. 4.12).
    """

    name: str
    loop: Callable[[float], StateSpace]
    expansion: Callable[[float], float]
    disturbance_weight: float


def motor(resistance_ohm: float) -> StateSpace:
    """Return the motor from voltage to angle, sampled with a zero-order hold (Eq. 4.15).

    ``J dw/dt + B w = K i``, ``L di/dt + R i = V - K w``; states: current, speed, angle.
    """
    a = [
        [-resistance_ohm / _INDUCTANCE, -_CONSTANT / _INDUCTANCE, 0.0],
        [_CONSTANT / _INERTIA, -_FRICTION / _INERTIA, 0.0],
        [0.0, 1.0, 0.0],
    ]
    continuous = StateSpace(a, [[1.0 / _INDUCTANCE], [0.0], [0.0]], [[0.0, 0.0, 1.0]], [[0.0]])
    return discretize(continuous, DT_S)


#: PD control with a filtered derivative (Table 4.2), exact for an error held over the sample.
CONTROLLER = Pid(10.0, kd_s=1.0, dt_s=DT_S, derivative="filtered", filter_s=0.01).model().minimal()


def closed_loop(resistance_ohm: float) -> StateSpace:
    """Return the PD loop around the motor, from the reference, to which the ILC signal is added."""
    return motor(resistance_ohm).complementary_sensitivity(CONTROLLER)


def resistance_ohm(temperature_k: float) -> float:
    """Return the resistance at a temperature above T_0 (Eq. 4.16)."""
    return _RESISTANCE * (1.0 + ALPHA_R * temperature_k)


def expansion(temperature_k: float) -> float:
    """Return the tool position over the position relative to the part (Eq. 4.17)."""
    return 1.0 + ALPHA_1 * temperature_k + ALPHA_2 * temperature_k**2


_COLD = closed_loop(_RESISTANCE)

#: Case I: the resistance follows the temperature.
MOTOR = System("motor", lambda kelvin: closed_loop(resistance_ohm(kelvin)), lambda _: 1.0, 0.5)

#: Case II: the part expands; time-domain feedback does not see it, learning does.
EXPANSION = System("expansion", lambda _: _COLD, expansion, 1e-4)


def temperatures_k(seed: int, n_runs: int) -> NDArray[np.float64]:
    """Return the temperature above T_0 of every run, constant within it."""
    noise = np.random.default_rng(seed).standard_normal(_SETTLING + n_runs)
    filtered = np.zeros_like(noise)
    for run in range(1, len(noise)):
        filtered[run] = _POLE * filtered[run - 1] + math.sqrt(1.0 - _POLE**2) * noise[run]
    return np.array([_LARGEST_K * math.erf(x / math.sqrt(2.0)) for x in filtered[_SETTLING:]])
