"""One leg of the mechanism: its motion, its stabilising controller, and its identification.

Sections 7.3.2, 7.3.3 and 8.1.1. The masses of table 7.3 are not printed. The leg here has the
inertia, damping and weight for which the exact linearisation about home is the printed model
(7.19), so that the correct result of the identification is known.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_papers.barton2010.delta_paths import DT_S, HOME_RAD
from ilc_rt import StateSpace, discretize, from_transfer_function
from ilc_rt.identify import Identification, swept_sine

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Gain, natural frequency and damping of the printed model (7.19).
GAIN_RAD_NM, NATURAL_RAD_S, DAMPING = 6.0, 9.0, 0.9
#: Gains of the stabilising controller, table 8.1.
KP, KD, KI = 2.3, 0.04, 0.3
#: Steps of the integration in a sample.
SUBSTEPS = 4
#: Resolution of the encoder: 14 bits per turn (not printed).
RESOLUTION_RAD = 2.0 * math.pi / 2**14

# alpha, c_d and beta of (7.13) with the sign of the weight corrected (D.4).
INERTIA = 1.0 / (GAIN_RAD_NM * NATURAL_RAD_S**2)
FRICTION = 2.0 * DAMPING * NATURAL_RAD_S * INERTIA
WEIGHT_NM = -1.0 / (GAIN_RAD_NM * math.sin(HOME_RAD))


def printed_model() -> StateSpace:
    """Return (7.19) behind a zero-order hold: torque in N m to angle in rad."""
    omega, zeta = NATURAL_RAD_S, DAMPING
    model = from_transfer_function([GAIN_RAD_NM * omega**2], [1.0, 2.0 * zeta * omega, omega**2])
    return discretize(model, DT_S)


def stabilised() -> StateSpace:
    """Return the leg with the controller (8.3): set point to angle, both in rad."""
    proportional = KP * np.array([1.0, -1.0, 0.0, 0.0])
    integral = KI * DT_S * np.array([0.0, 1.0, 0.0, 0.0])
    derivative = KD / DT_S * np.array([0.0, 1.0, -2.0, 1.0])
    controller = from_transfer_function(
        proportional + integral + derivative, [1.0, -1.0, 0.0, 0.0], DT_S
    )
    return printed_model().complementary_sensitivity(controller)


def stabilised_poles() -> tuple[float, float]:
    """Return natural frequency in rad/s and damping of the slowest pair of the stabilised leg."""
    poles = stabilised().poles()
    pairs = np.log(poles[poles.imag > 0.0]) / DT_S
    slowest = pairs[np.abs(pairs).argmin()]
    return float(abs(slowest)), float(-slowest.real / abs(slowest))


def pendulum(resolution_rad: float) -> Callable[[Array], Array]:
    """Return the leg of (7.13) about home: additional torque to change of angle.

    ``alpha theta'' + c_d theta' + beta cos(theta) = tau``, integrated with four Runge-Kutta steps
    a sample while the torque is held; the angle is read with a resolution (0 for none).
    """
    holding_nm = WEIGHT_NM * math.cos(HOME_RAD)
    step_s = DT_S / SUBSTEPS

    def acceleration(angle: float, rate: float, torque_nm: float) -> float:
        return (torque_nm - FRICTION * rate - WEIGHT_NM * math.cos(angle)) / INERTIA

    def respond(torque_nm: Array) -> Array:
        angle, rate = HOME_RAD, 0.0
        seen = np.empty(len(torque_nm))
        for k, on_top_nm in enumerate(torque_nm.tolist()):
            seen[k] = angle - HOME_RAD
            torque = holding_nm + on_top_nm
            for _ in range(SUBSTEPS):
                a1 = acceleration(angle, rate, torque)
                r2 = rate + 0.5 * step_s * a1
                a2 = acceleration(angle + 0.5 * step_s * rate, r2, torque)
                r3 = rate + 0.5 * step_s * a2
                a3 = acceleration(angle + 0.5 * step_s * r2, r3, torque)
                r4 = rate + step_s * a3
                a4 = acceleration(angle + step_s * r3, r4, torque)
                angle += step_s / 6.0 * (rate + 2.0 * r2 + 2.0 * r3 + r4)
                rate += step_s / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        return np.round(seen / resolution_rad) * resolution_rad if resolution_rad > 0.0 else seen

    return respond


def excite(system: Callable[[Array], Array], amplitude: float, *, reduced: bool) -> Identification:
    """Identify a leg with a swept sine, 0.2 to 10 Hz (section 7.3.3)."""
    return swept_sine(
        system, dt_s=DT_S, amplitude=amplitude, from_hz=0.2, to_hz=10.0, period_s=25.0,
        periods=2 if reduced else 3,
    )  # fmt: skip


def described(found: Identification) -> dict[str, Any]:
    """Return the identified parameters, as figures."""
    model = found.model
    return {
        "amplitude": found.experiment.amplitude,
        "gain": model.gain,
        "natural_frequency_rad_s": 2.0 * math.pi * model.natural_frequency_hz,
        "damping": model.damping,
        "delay_s": model.delay_s,
        "residual_rms": model.residual_rms,
        "coherence_median": float(np.median(found.coherence)),
    }


def bode_figures(found: Identification, count: int = 80) -> dict[str, list[float]]:
    """Return measured and fitted response at frequencies spaced evenly on a logarithmic axis."""
    wanted_hz = np.geomspace(found.frequency_hz[0], found.frequency_hz[-1], count)
    nearest = np.abs(found.frequency_hz[:, None] - wanted_hz).argmin(axis=0)
    index = np.unique(nearest)
    frequency_hz, measured = found.frequency_hz[index], found.response[index]
    fitted = found.model.response(frequency_hz)
    return {
        "frequency_hz": frequency_hz.tolist(),
        "measured_gain": np.abs(measured).tolist(),
        "measured_phase_deg": np.degrees(np.unwrap(np.angle(measured))).tolist(),
        "fitted_gain": np.abs(fitted).tolist(),
        "fitted_phase_deg": np.degrees(np.unwrap(np.angle(fitted))).tolist(),
    }


__all__ = [
    "DAMPING",
    "GAIN_RAD_NM",
    "NATURAL_RAD_S",
    "RESOLUTION_RAD",
    "WEIGHT_NM",
    "bode_figures",
    "described",
    "excite",
    "pendulum",
    "printed_model",
    "stabilised",
    "stabilised_poles",
]
