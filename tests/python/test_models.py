"""Models against scipy.signal and python-control."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from ilc_rt import ModelError, StateSpace, discretize, from_transfer_function, second_order

DT_S = 0.002


def random_model(seed, n_states=3, n_inputs=2, n_outputs=2):
    """Return a stable random discrete model."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n_states, n_states))
    a *= 0.9 / max(abs(np.linalg.eigvals(a)))
    b = rng.normal(size=(n_states, n_inputs))
    c = rng.normal(size=(n_outputs, n_states))
    d = rng.normal(size=(n_outputs, n_inputs))
    return a, b, c, d


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(1, 3), st.integers(1, 3))
def test_simulation_agrees_with_scipy(seed, n_states, n_inputs, n_outputs):
    parts = random_model(seed, n_states, n_inputs, n_outputs)
    rng = np.random.default_rng(seed + 1)
    u, x0 = rng.normal(size=(50, n_inputs)), rng.normal(size=n_states)
    _, expected, _ = scipy_signal.dlsim((*parts, DT_S), u, x0=x0)
    found = StateSpace(*parts, DT_S).simulate(u, x0)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_lifted_matrix_holds_the_markov_parameters_and_maps_inputs():
    model = StateSpace(*random_model(1), DT_S)
    u = np.random.default_rng(2).normal(size=(20, 2))
    lifted = model.lifted(20)
    np.testing.assert_allclose(lifted @ u.ravel(), model.simulate(u).ravel(), atol=1e-12)
    np.testing.assert_array_equal(lifted[2 * 5 : 2 * 6, 2 * 3 : 2 * 4], model.markov(3)[2])


def test_markov_parameters_agree_with_control():
    parts = random_model(3)
    _, expected = control.impulse_response(control.ss(*parts, True), T=np.arange(10))
    found = StateSpace(*parts, DT_S).markov(10)
    np.testing.assert_allclose(found, np.moveaxis(expected, 2, 0), atol=1e-12)


def test_poles_agree_with_numpy():
    parts = random_model(4, n_states=6)
    found = np.sort_complex(StateSpace(*parts, DT_S).poles())
    np.testing.assert_allclose(found, np.sort_complex(np.linalg.eigvals(parts[0])), atol=1e-12)


@pytest.mark.parametrize("method", ["zoh", "tustin"])
def test_discretisation_agrees_with_scipy(method):
    a, b, c, d = random_model(5)
    continuous = (60.0 * (a - np.eye(3)), 60.0 * b, c, d)
    scipy_method = {"zoh": "zoh", "tustin": "bilinear"}[method]
    expected = scipy_signal.cont2discrete(continuous, DT_S, scipy_method)
    found = discretize(StateSpace(*continuous), DT_S, method)
    for ours, theirs in zip((found.a, found.b, found.c, found.d), expected[:4], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-13)
    assert found.dt_s == DT_S


def test_transfer_function_agrees_with_scipy():
    num, den = [0.5, -0.2, 0.1], [2.0, -1.0, 0.3, 0.05]
    _, expected = scipy_signal.dimpulse((num, den, DT_S), n=30)
    impulse = np.eye(30)[0]
    found = from_transfer_function(num, den, DT_S).simulate(impulse)
    np.testing.assert_allclose(found, expected[0].ravel(), atol=1e-14)


def test_feedback_agrees_with_control():
    plant, controller = random_model(6), random_model(7)
    expected = control.feedback(control.ss(*plant, DT_S), control.ss(*controller, DT_S))
    found = StateSpace(*plant, DT_S).feedback(StateSpace(*controller, DT_S))
    _, response = control.impulse_response(expected, T=DT_S * np.arange(12))
    ours = found.markov(12)
    np.testing.assert_allclose(
        ours, np.moveaxis(response, 2, 0) * DT_S, rtol=1e-9, atol=1e-9 * abs(ours).max()
    )


def test_models_of_other_packages_are_models():
    ours = discretize(second_order(157.0, 0.5), DT_S)
    parts = (ours.a, ours.b, ours.c, ours.d)
    unit = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0, DT_S)
    for foreign in (control.ss(*parts, DT_S), scipy_signal.StateSpace(*parts, dt=DT_S)):
        both = unit.series(foreign)
        np.testing.assert_allclose(both.markov(9), ours.markov(9), atol=1e-15)
    lag = scipy_signal.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    assert discretize(lag, 0.1).a[0, 0] == pytest.approx(np.exp(-0.1), abs=1e-15)


def test_a_delay_is_a_shift():
    axis = discretize(second_order(94.0, 1.0), 0.004)
    np.testing.assert_allclose(axis.delayed(3).markov(12)[3:], axis.markov(9), atol=1e-15)


GOOD = {"a": np.eye(2), "b": np.ones((2, 1)), "c": np.ones((1, 2)), "d": np.zeros((1, 1))}


@pytest.mark.parametrize("name", ["a", "b", "c", "d"])
@pytest.mark.parametrize(
    ("spoil", "error"),
    [
        (lambda m: np.ones((3, 3)), ValueError),
        (lambda m: m.ravel(), ValueError),
        (lambda m: np.full_like(m, np.nan), ValueError),
        (lambda m: np.full_like(m, -np.inf), ValueError),
        (lambda m: m.astype(np.complex128), TypeError),
        (lambda m: m.astype(np.longdouble), TypeError),
        (lambda m: m.astype(str), TypeError),
        (lambda m: m.astype(bool), TypeError),
        (lambda m: None, TypeError),
    ],
    ids=["size", "axes", "nan", "inf", "complex", "longdouble", "text", "bool", "none"],
)
def test_each_bad_matrix_is_refused_by_name(name, spoil, error):
    bad = GOOD | {name: spoil(GOOD[name])}
    with pytest.raises(error, match=r"\b[abcd]\b"):
        StateSpace(**bad, dt_s=DT_S)


def test_bad_requests_are_refused_in_a_sentence():
    continuous = second_order(157.0, 0.5)
    sampled = discretize(continuous, DT_S)
    with pytest.raises(ModelError, match="simulate needs a discrete model"):
        continuous.simulate(np.zeros(5))
    with pytest.raises(ModelError, match="discretize needs a continuous model"):
        discretize(sampled, DT_S)
    with pytest.raises(ModelError, match="dt_s = -1 s"):
        discretize(continuous, -1.0)
    with pytest.raises(ValueError, match="method = 'euler'"):
        discretize(continuous, DT_S, "euler")
    with pytest.raises(TypeError, match="model is a list"):
        discretize([1.0], DT_S)
    with pytest.raises(ValueError, match=r"model\.dt = True"):
        discretize(control.ss(*GOOD.values(), True), DT_S)
    with pytest.raises(ModelError, match="x0 holds 3 values"):
        sampled.simulate(np.zeros(5), np.zeros(3))
    with pytest.raises(ValueError, match=r"u has shape \(5, 2\)"):
        sampled.simulate(np.zeros((5, 2)))
    with pytest.raises(ModelError, match="different time"):
        sampled.series(continuous)
    with pytest.raises(ModelError, match="numerator of degree 1"):
        from_transfer_function([1.0, 0.0], [1.0])
