"""Sums, products, inverses and channels of models, their views, and linearisation."""

from __future__ import annotations

import pickle

import control
import numpy as np
import pytest

from ilc_rt import (
    ModelError,
    NormOptimalIlc,
    StateSpace,
    TimeVarying,
    discretize,
    from_transfer_function,
    second_order,
    simulate,
)

DT_S = 0.002
W = np.geomspace(1.0, 1000.0, 7)
X = discretize(second_order(94.0, 0.7), DT_S)
Y = from_transfer_function([0.3, 0.1], [1.0, -0.6], DT_S)
MATRIX = np.array([[1.0, 0.2], [0.1, 1.0], [0.0, 2.0]])


def response(model: StateSpace) -> np.ndarray:
    return np.asarray(model.frequency_response(W))


def same(model: StateSpace, expected: np.ndarray) -> None:
    np.testing.assert_allclose(response(model), expected, rtol=1e-9, atol=1e-12)


def test_operators_are_those_of_the_responses() -> None:
    x, y = response(X), response(Y)
    same(X * Y, x * y)
    same(X + Y, x + y)
    same(X - Y, x - y)
    same(-X, -x)
    same(2 * X, 2 * x)
    same(X * 2.0, 2 * x)
    same(np.float64(2.0) * X, 2 * x)
    same(X / 4, x / 4)
    same(1 - X, 1 - x)
    same(X + 0.5, x + 0.5)
    same(Y**-1, 1 / y)
    same(Y**3, y**3)
    same(Y**-2, y**-2)


def test_operators_of_several_channels() -> None:
    both = X.append(Y)
    g = response(both)
    same(both * MATRIX[:2], g @ MATRIX[:2])
    same(MATRIX * both, MATRIX @ g)
    same(both + MATRIX[:2], g + MATRIX[:2])
    same(both[1, 1], response(Y))
    same(both[0, -1], np.zeros((7, 1, 1)))
    same(both[::-1, 0], g[:, ::-1, :1])
    same(both[[1, 0], :], g[:, [1, 0]])
    turned = (both + MATRIX[:2]) ** -1
    same(turned, np.linalg.inv(g + MATRIX[:2]))


def test_models_of_python_control_are_operands() -> None:
    same(X + Y.to_control(), response(X) + response(Y))
    same(X * Y.to_control(), response(X) * response(Y))
    assert isinstance(pickle.loads(pickle.dumps(X * Y)), StateSpace)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: X**-1, ModelError, "no proper inverse"),
        (lambda: X**0, ValueError, "exponent = 0"),
        (lambda: X.append(Y) ** 2 + X, ModelError, "cannot add"),
        (lambda: X * X.append(Y), ModelError, "cannot connect in series"),
        (lambda: X + second_order(94.0, 0.7), ModelError, "of different time"),
        (lambda: X * "2", TypeError, "operand"),
        (lambda: X[2, 0], IndexError, "output = 2: there are 1"),
        (lambda: X[0, 1.5], IndexError, "input = 1.5"),
        (lambda: X + 1j, TypeError, "gain"),
        (lambda: X * np.nan, ValueError, "finite"),
    ],
)
def test_what_does_not_fit_is_named(call, error, words: str) -> None:
    with pytest.raises(error, match=words):
        call()


def test_natural_frequencies_survive_sampling() -> None:
    frequency_hz, damping = X.natural_frequencies()
    np.testing.assert_allclose(frequency_hz, 94.0 / (2 * np.pi))
    np.testing.assert_allclose(damping, 0.7)
    # A delay adds poles at zero, which have no frequency.
    np.testing.assert_allclose(X.delayed(20).natural_frequencies()[0], 94.0 / (2 * np.pi))


def test_a_model_shows_matrices_poles_and_delay() -> None:
    text = str(X.delayed(2).append(Y))
    assert "poles: 14.96 Hz (damping 0.7)" in text
    assert "delay: 0 to 3 samples" in text
    assert "A = [[" in text
    page = Y._repr_html_()
    assert page.startswith("<table>")
    assert "0.6" in page
    assert "\n" not in repr(X)


def pendulum(x, u):
    return np.array([x[0] + 0.01 * x[1], x[1] + 0.01 * (u[0] * np.cos(x[0]) - 9.81 * np.sin(x[0]))])


def height(x, u):
    return np.array([-np.cos(x[0]) + 0.1 * u[0]])


def jacobian(x, u):
    return (
        [[1.0, 0.01], [0.01 * (-u[0] * np.sin(x[0]) - 9.81 * np.cos(x[0])), 1.0]],
        [[0.0], [0.01 * np.cos(x[0])]],
        [[np.sin(x[0]), 0.0]],
        [[0.1]],
    )


def trajectory(u):
    states = [np.array([0.4, 0.0])]
    for value in u[:-1]:
        states.append(pendulum(states[-1], np.array([value])))
    return np.array(states)


U = np.sin(0.05 * np.arange(120))


def test_differences_are_the_jacobian() -> None:
    x = trajectory(U)
    found = TimeVarying.linearize(pendulum, x, U, 0.01, height)
    given = TimeVarying.linearize(pendulum, x, U, 0.01, height, jacobian=jacobian)
    for name in "abcd":
        np.testing.assert_allclose(getattr(found, name), getattr(given, name), atol=1e-8)
    assert found.n_samples == 120
    # Without an output function the states are the outputs.
    np.testing.assert_allclose(
        TimeVarying.linearize(pendulum, x, U, 0.01).c[5], np.eye(2), atol=1e-9
    )


def test_the_model_predicts_small_deviations() -> None:
    x, small = trajectory(U), 1e-5 * np.cos(0.1 * np.arange(120))
    model = TimeVarying.linearize(pendulum, x, U, 0.01)
    moved = trajectory(U + small) - x
    np.testing.assert_allclose(model.simulate(small), moved, atol=1e-3 * np.abs(moved).max())


def test_relinearising_each_trial_learns_a_swing_that_one_model_does_not() -> None:
    """Up to 1.3 rad, where the pendulum is far from the model of its rest."""
    reference = 0.4 + 0.9 * np.hanning(240)[:120] ** 2

    def plant(u):
        return trajectory(u)[:, 0]

    class Relinearized:
        def update(self, u, e, disturbance=None):
            model = TimeVarying.linearize(pendulum, trajectory(u), u, 0.01, lambda x, v: x[:1])
            return NormOptimalIlc(model, 120, r=1e-7).update(u, e)

    result = simulate(plant, Relinearized(), reference, trials=8)
    assert result.records[-1].tracking_rms_m < 1e-3 * result.records[0].tracking_rms_m


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"f": lambda x, u: x[:1]}, r"sample 0: f returned shape \(1,\); \(2,\) is needed"),
        ({"f": lambda x, u: x * np.nan}, "sample 0: f returned a number that is not finite"),
        ({"h": lambda x, u: [[1.0]]}, "sample 0: h returned shape"),
        ({"jacobian": lambda x, u: (np.eye(2),)}, "jacobian returned 1 matrices"),
        ({"jacobian": lambda x, u: (np.eye(3),) * 4}, "jacobian returned A of shape"),
        ({"u": U[:-1]}, "x has 120 samples, u has 119"),
        ({"step": 0.0}, "step = 0.0"),
        ({"f": 3}, "f = 3"),
        ({"dt_s": -1.0}, "sample time"),
    ],
)
def test_an_unusable_function_is_named(change, words: str) -> None:
    arguments = {"f": pendulum, "x": trajectory(U), "u": U, "dt_s": 0.01, **change}
    with pytest.raises((ValueError, TypeError), match=words):
        TimeVarying.linearize(**arguments)


def test_frequency_responses_go_to_python_control_and_back() -> None:
    from ilc_rt.identify import FrequencyResponse

    f = np.linspace(1.0, 60.0, 30)
    measured = FrequencyResponse(f, np.asarray(X.frequency_response(2 * np.pi * f)).reshape(-1))
    frd = measured.to_control()
    assert isinstance(frd, control.FrequencyResponseData)
    np.testing.assert_allclose(frd(2j * np.pi * f[4]), measured.response[4])
    back = FrequencyResponse.from_control(frd)
    np.testing.assert_allclose(back.frequency_hz, f)
    np.testing.assert_array_equal(back.response, measured.response)
    with pytest.raises(ValueError, match="one input and one output"):
        FrequencyResponse.from_control(control.frd(np.ones((2, 2, 3)), [1.0, 2.0, 3.0]))
