"""Learning in joint space from errors at the tool."""

import numpy as np
import pytest

from ilc_rt import (
    LearningError,
    NormOptimalIlc,
    PdIlc,
    StateSpace,
    ThroughJacobian,
    discretize,
    second_order,
)
from ilc_rt.kinematics import Delta

DT_S = 0.005
N_SAMPLES = 40


def three_legs() -> StateSpace:
    leg = discretize(second_order(40.0, 0.6), DT_S)
    return leg.append(leg).append(leg)


def signals(n_joints: int = 3, n_coordinates: int = 3):
    rng = np.random.default_rng(3)
    return rng.normal(size=(N_SAMPLES, n_joints)), rng.normal(size=(N_SAMPLES, n_coordinates))


def test_it_is_the_law_of_the_model_seen_at_the_tool():
    """[barton2010], Eq. (8.7): the law of J P, and that of P with weights J' Q J."""
    model, jacobian = three_legs(), Delta().jacobian([-0.2, 0.1, 0.0])
    weight = np.diag([3.0, 1.0, 2.0])
    at_tool = StateSpace(model.a, model.b, jacobian @ model.c, jacobian @ model.d, DT_S)
    # The Jacobian is in m/rad, so effort and change of input weigh little in comparison.
    direct = NormOptimalIlc(at_tool, N_SAMPLES, q=weight, s=1e-7, r=1e-5)
    joints = NormOptimalIlc(model, N_SAMPLES, q=jacobian.T @ weight @ jacobian, s=1e-7, r=1e-5)
    through = ThroughJacobian(joints, jacobian)
    u, e = signals()
    assert np.allclose(through.update(u, e), direct.update(u, e), rtol=1e-6, atol=1e-8)


def test_each_sample_may_have_its_own_jacobian():
    rng = np.random.default_rng(5)
    jacobians = np.eye(2) + 0.2 * rng.normal(size=(N_SAMPLES, 2, 2))
    through = ThroughJacobian(PdIlc(kp=0.7, kd=0.0, lead_samples=0), jacobians)
    u, e = signals(2, 2)
    expected = u + 0.7 * np.linalg.solve(jacobians, e[:, :, None])[:, :, 0]
    assert np.allclose(through.update(u, e), expected, rtol=1e-12, atol=1e-12)
    with pytest.raises(LearningError, match="input holds"):
        through.update(u[1:], e[1:])


def test_more_joints_than_coordinates_move_as_little_as_they_can():
    jacobian = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]])
    through = ThroughJacobian(PdIlc(kp=1.0, kd=0.0, lead_samples=0), jacobian)
    assert (through.n_joints, through.n_coordinates) == (3, 2)
    for length in (N_SAMPLES, 7):
        u, e = (signal[:length] for signal in signals(3, 2))
        assert np.allclose(through.update(u, e), u + e @ np.linalg.pinv(jacobian).T, rtol=1e-12)


def test_the_law_inside_is_told_everything_and_its_exceptions_come_out():
    class Own:
        def __init__(self):
            self.told, self.forgotten = None, False

        def update(self, u, e, disturbance=None):
            if disturbance is None:
                message = "no temperature"
                raise KeyError(message)
            self.told = (u.shape, e.shape, disturbance)
            return u + e

        def reset(self):
            self.forgotten = True

    own = Own()
    through = ThroughJacobian(own, 2.0 * np.eye(3)[:2])
    assert through.law is own
    assert repr(through).endswith("jacobian=array of shape (2, 3))")
    assert (through.n_coordinates, through.n_joints) == (2, 3)
    u, e = signals(3, 2)
    with pytest.raises(KeyError, match="no temperature"):
        through.update(u, e)
    through.update(u, e, 21.5)
    assert own.told == ((N_SAMPLES, 3), (N_SAMPLES, 3), 21.5)
    through.reset()
    assert own.forgotten


def test_one_wrong_thing_at_a_time_is_refused():
    law = PdIlc(kp=1.0, kd=0.0)
    with pytest.raises(TypeError, match="update"):
        ThroughJacobian(object(), np.eye(3))
    with pytest.raises(LearningError, match="condition"):
        ThroughJacobian(law, np.ones((3, 3)))
    with pytest.raises(ValueError, match="jacobian has shape"):
        ThroughJacobian(law, np.ones(3))
    with pytest.raises(ValueError, match="jacobian holds NaN"):
        ThroughJacobian(law, np.full((2, 2), np.nan))
    through = ThroughJacobian(law, np.eye(3))
    u, e = signals()
    with pytest.raises(ValueError, match="u has shape"):
        through.update(u[:, :2], e)
    with pytest.raises(ValueError, match="e has shape"):
        through.update(u, e[:, :2])
