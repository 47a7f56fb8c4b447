"""Controllers against SciPy."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from ilc_rt import discretize, second_order
from ilc_rt.control import Cascade, CrossCoupled, Pid


def test_filtered_derivative_is_the_exact_discretisation() -> None:
    dt_s, filter_s = 0.01, 0.01
    pid = Pid(10.0, kd_s=1.0, dt_s=dt_s, derivative="filtered", filter_s=filter_s)
    error = np.random.default_rng(1).normal(size=300)
    num, den, _ = scipy_signal.cont2discrete(([1.0, 0.0], [filter_s, 1.0]), dt_s, method="zoh")
    wanted = 10.0 * error + scipy_signal.lfilter(np.ravel(num), den, error)
    np.testing.assert_allclose(pid.run(error), wanted, rtol=1e-9, atol=1e-9)


def test_delayed_form_is_the_printed_transfer_function() -> None:
    kp, ki, kd, dt_s = 3.0, 5.0, 0.02, 0.004
    pid = Pid(kp, ki, kd, dt_s=dt_s, derivative="delayed")
    error = np.random.default_rng(2).normal(size=200)
    integral = scipy_signal.lfilter([0.0, ki * dt_s], [1.0, -1.0], error)
    derivative = scipy_signal.lfilter([0.0, kd / dt_s, -kd / dt_s], [1.0], error)
    np.testing.assert_allclose(pid.run(error), kp * error + integral + derivative, rtol=1e-9)


@pytest.mark.parametrize("derivative", ["difference", "delayed", "filtered"])
def test_model_and_steps_agree(derivative: str) -> None:
    pid = Pid(2.0, 10.0, 0.1, dt_s=0.01, derivative=derivative)  # type: ignore[arg-type]
    error = np.random.default_rng(3).normal(size=100)
    np.testing.assert_allclose(pid.model().simulate(error), pid.run(error), rtol=1e-9, atol=1e-12)
    pid.reset()
    assert pid.step(error[0]) == pytest.approx(pid.model().simulate(error[:1])[0])


def test_model_closes_a_loop() -> None:
    plant = discretize(second_order(60.0, 0.4), 0.001)
    pid = Pid(0.5, 20.0, dt_s=0.001)
    closed = plant.feedback(pid.model())
    assert np.all(np.abs(closed.poles()) < 1.0)


def test_limits_hold_and_do_not_wind_up() -> None:
    pid = Pid(1.0, 100.0, dt_s=0.01, output_max=0.5)
    assert np.all(pid.run(np.ones(1000)) == 0.5)
    assert pid.step(-0.4) < 0.5
    cascade = Cascade(50.0, 100.0, 0.1, dt_s=0.001, force_max_n=3.0)
    for _ in range(100):
        assert cascade.step(1.0, 0.0, 0.0) == 3.0
    assert cascade.step(0.0, 0.1, 0.0) == -3.0


def test_cross_coupling_corrects_across_and_not_along() -> None:
    coupled = CrossCoupled(Pid(4.0, dt_s=0.001))
    gains = np.array([-np.sqrt(0.5), np.sqrt(0.5)])
    along, contour_m = coupled.step([1.0, 1.0], gains)
    np.testing.assert_allclose(along, 0.0, atol=1e-15)
    assert contour_m == pytest.approx(0.0, abs=1e-15)
    across, _ = coupled.step([-1.0, 1.0], gains)
    np.testing.assert_allclose(across, [-4.0, 4.0])
    _, curved_m = coupled.step([0.0, 0.1], [0.0, 1.0], curvature_per_m=2.0)
    assert curved_m == pytest.approx(0.1 + 0.01)


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: Pid(float("nan"), dt_s=0.1), "kp"),
        (lambda: Pid(1.0, dt_s=0.0), "dt_s"),
        (lambda: Pid(1.0, dt_s=0.1, derivative="other"), "derivative"),
        (lambda: Pid(1.0, dt_s=0.1, output_max=-1.0), "output_max"),
        (lambda: Pid(1.0, dt_s=0.1).step(float("inf")), "error"),
        (lambda: Pid(1.0, dt_s=0.1).run(np.zeros((3, 2))), "error"),
        (lambda: Cascade(1.0, float("inf"), dt_s=0.1), "velocity_gain_n_s_m"),
        (lambda: Cascade(1.0, 1.0, 0.0, dt_s=0.1), "integral_time_s"),
        (lambda: Cascade(1.0, 1.0, dt_s=0.1).step(float("nan"), 0.0, 0.0), "position_m"),
        (lambda: CrossCoupled(Pid(1.0, dt_s=0.1)).step([1.0], [0.0, 1.0]), "error_m"),
    ],
)
def test_one_wrong_thing_at_a_time(call: object, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        call()  # type: ignore[operator]
