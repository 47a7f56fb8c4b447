"""The reference problem of IterativeLearningControl2.jl, with the error that its own test expects.

A motor drives a load through a spring, in a position loop; the true load is half as heavy again as
the modelled one. The learned input is added to the motor's torque.
"""

from __future__ import annotations

import numpy as np
import pytest

from ilc_rt import NormOptimalIlc, StateSpace, discretize, from_transfer_function, simulate

DT_S = 0.02
N_SAMPLES = 472


def loops(load_kg_m2: float) -> tuple[StateSpace, StateSpace]:
    """Return the discrete responses of the motor's angle to reference and torque."""
    stiffness, damping, motor_kg_m2 = 100.0, 1.0, 1.0
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-stiffness, -2.0 * damping, stiffness, damping],
            [0.0, 0.0, 0.0, 1.0],
            [stiffness, damping, -stiffness, -2.0 * damping],
        ]
    )
    a[1] /= motor_kg_m2
    a[3] /= load_kg_m2
    plant = StateSpace(
        a, np.array([[0.0], [1.0 / motor_kg_m2], [0.0], [0.0]]), [[1.0, 0.0, 0.0, 0.0]], [[0.0]]
    )
    # A PID in series form, (10 + 10/s) (s + 1), behind a filter of 20 ms.
    controller = from_transfer_function([10.0, 20.0, 10.0], [0.02, 1.0, 0.0])
    torque = plant.feedback(controller)
    return discretize(torque * controller, DT_S), discretize(torque, DT_S)


def reference() -> np.ndarray:
    """Return a sine with flattened tops."""
    sine = np.sin(np.arange(N_SAMPLES) * DT_S)
    return np.sign(sine) * ((np.abs(sine) + 0.01) ** 0.2 - 0.01**0.2)


def test_the_error_is_the_published_one() -> None:
    _, model = loops(1.0)
    to_reference, to_torque = loops(1.5)
    r = reference()
    law = NormOptimalIlc(model, N_SAMPLES, q=1.0, s=1e-5, r=1e-4)
    result = simulate(
        to_torque, law, r, trials=5, output_disturbance=to_reference.simulate(r), unit="rad"
    )
    norms = np.linalg.norm(result.error[:, :, 0], axis=1)
    assert norms[0] == pytest.approx(2.6333743, abs=5e-8)
    assert norms[-1] == pytest.approx(0.5615131021547797, rel=1e-9)
    assert (np.diff(norms) < 0).all()
