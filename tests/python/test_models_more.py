"""Zeros, responses, sensitivities and foreign models against scipy.signal and python-control."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal
from test_models import random_model

from ilc_rt import ModelError, StateSpace, discretize, from_transfer_function, second_order

DT_S = 0.002
W = np.geomspace(0.1, 1500.0, 60)
NUM, DEN = [0.5, -0.2, 0.1], [2.0, -1.0, 0.3, 0.05]


def same_response(ours, theirs, w=W):
    found = ours.frequency_response(w)
    expected = np.moveaxis(np.atleast_3d(theirs), 2, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(1, 3), st.integers(1, 3))
def test_frequency_response_agrees_with_control(seed, n_states, n_inputs, n_outputs):
    parts = random_model(seed, n_states, n_inputs, n_outputs)
    for ours, theirs in (
        (StateSpace(*parts, DT_S), control.ss(*parts, DT_S)),
        (StateSpace(*parts), control.ss(*parts)),
    ):
        expected = control.frequency_response(theirs, W, squeeze=False).frdata
        np.testing.assert_allclose(
            ours.frequency_response(W), np.moveaxis(expected, 2, 0), rtol=1e-9, atol=1e-9
        )


def test_bode_agrees_with_scipy_and_has_no_jumps():
    late = discretize(second_order(157.0, 0.3), DT_S).delayed(4)
    f = np.linspace(0.5, 249.0, 500)
    magnitude, phase_rad = late.bode(2 * np.pi * f)
    expected = late.to_control()(np.exp(2j * np.pi * f * DT_S))
    np.testing.assert_allclose(magnitude, np.abs(expected), rtol=1e-9)
    np.testing.assert_allclose(phase_rad, np.unwrap(np.angle(expected)), atol=1e-9)
    assert phase_rad[-1] < -10.0
    with pytest.raises(ModelError, match="output = 1"):
        late.bode([1.0], output=1)
    with pytest.raises(ValueError, match="w_rad_s"):
        late.frequency_response([[1.0]])


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 3), st.booleans())
def test_zeros_of_random_square_models_cancel_the_rank(seed, n_states, n_channels, has_direct):
    a, b, c, d = random_model(seed, n_states, n_channels, n_channels)
    d = d if has_direct else 0.0 * d
    zeros = StateSpace(a, b, c, d, DT_S).zeros()
    assert len(zeros) == (n_states if has_direct else max(n_states - n_channels, 0))
    for zero in zeros:
        pencil = np.block([[a - zero * np.eye(n_states), b], [c, d]])
        sizes = np.linalg.svd(pencil, compute_uv=False)
        assert sizes[-1] < 1e-9 * sizes[0] * max(1.0, abs(zero))


def test_zeros_poles_and_gain_agree_with_scipy():
    z, p, k = [-3.0, -20.0 + 4j, -20.0 - 4j], [-1.0, -5.0, -2 + 9j, -2 - 9j, -50.0], 7.0
    model = StateSpace(*scipy_signal.zpk2ss(z, p, k))
    np.testing.assert_allclose(np.sort_complex(model.zeros()), np.sort_complex(z), rtol=1e-9)
    np.testing.assert_allclose(np.sort_complex(model.poles()), np.sort_complex(p), rtol=1e-9)
    expected = control.dcgain(control.zpk(z, p, k))
    np.testing.assert_allclose(model.dc_gain(), [[expected]], rtol=1e-9)
    with pytest.raises(ModelError, match="integrates"):
        from_transfer_function([1.0], [1.0, 0.0]).dc_gain()


def test_sensitivities_agree_with_control():
    plant, controller = random_model(6), random_model(7)
    ours = StateSpace(*plant, DT_S), StateSpace(*controller, DT_S)
    p, k = control.ss(*plant, DT_S), control.ss(*controller, DT_S)
    one = control.ss([], [], [], np.eye(2), DT_S)
    for found, expected in (
        (ours[0].sensitivity(ours[1]), control.feedback(one, p * k)),
        (ours[0].complementary_sensitivity(ours[1]), control.feedback(p * k, one)),
        (ours[0].process_sensitivity(ours[1]), control.feedback(p, k)),
    ):
        same_response(found, control.frequency_response(expected, W, squeeze=False).frdata)


@pytest.mark.parametrize("dt_s", [None, DT_S])
def test_models_of_every_kind_come_in_and_go_out(dt_s):
    own = from_transfer_function(NUM, DEN, dt_s)
    timed = {} if dt_s is None else {"dt": dt_s}
    z, p, k = scipy_signal.tf2zpk(NUM, DEN)
    foreign = [
        scipy_signal.TransferFunction(NUM, DEN, **timed),
        scipy_signal.ZerosPolesGain(z, p, k, **timed),
        scipy_signal.StateSpace(*scipy_signal.tf2ss(NUM, DEN), **timed),
        scipy_signal.lti(NUM, DEN) if dt_s is None else scipy_signal.dlti(NUM, DEN, dt=dt_s),
        control.tf(NUM, DEN, dt_s or 0),
        control.ss(control.tf(NUM, DEN, dt_s or 0)),
        own.to_scipy(),
        own.to_control(),
    ]
    expected = own.frequency_response(W)
    for model in foreign:
        # Every function that takes a model accepts foreign models.
        found = own.append(model).frequency_response(W)[:, 1:, 1:]
        np.testing.assert_allclose(found, expected, rtol=1e-9, err_msg=repr(type(model)))
    assert own.to_control().dt == (dt_s or 0)
    assert own.to_scipy().dt == dt_s


def test_transfer_matrices_of_control_lose_superfluous_states():
    matrix = control.tf(
        [[[1.0], [3.0]], [[2.0], [1.0]]],
        [[[1.0, 1.0], [1.0, 5.0]], [[1.0], [1.0, 1.0]]],
    )
    gain = StateSpace([[0.0]], [[0.0, 0.0]], [[0.0], [0.0]], np.eye(2))
    read = gain.series(matrix).minimal()
    assert read.n_states == 3
    same_response(read, control.frequency_response(matrix, W, squeeze=False).frdata)


def test_what_is_no_model_is_refused_by_name():
    own = from_transfer_function(NUM, DEN, DT_S)
    with pytest.raises(TypeError, match="next is a float"):
        own.series(3.0)
    with pytest.raises(ValueError, match="does not say how long"):
        own.series(control.tf(NUM, DEN, True))


def test_relative_degrees_count_delays():
    axis = discretize(second_order(157.0, 0.5), DT_S)
    both = axis.delayed(3).append(from_transfer_function([1.0, 0.2], [1.0, 0.5], DT_S))
    assert both.relative_degrees() == [4, 0]
    assert both.delays() == [[4, None], [None, 0]]


def test_minimal_keeps_the_response():
    parts = random_model(11, n_states=4)
    own = StateSpace(*parts, DT_S)
    doubled = StateSpace(
        np.kron(np.eye(2), own.a), np.vstack([own.b, own.b]), np.hstack([own.c, own.c]) / 2,
        own.d, DT_S,
    )  # fmt: skip
    found = doubled.minimal()
    assert found.n_states == 4
    np.testing.assert_allclose(
        found.frequency_response(W), own.frequency_response(W), rtol=1e-8, atol=1e-9
    )
