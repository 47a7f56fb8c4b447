"""Filters against scipy.signal."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from ilc_rt import SignalError, signal

DT_S = 0.002


@pytest.mark.parametrize("order", range(1, 13))
@pytest.mark.parametrize("cutoff_hz", [2.0, 10.0, 50.0, 130.0, 200.0, 240.0])
def test_sections_are_those_of_scipy(order, cutoff_hz):
    expected = scipy_signal.butter(order, cutoff_hz, fs=1.0 / DT_S, output="sos")
    found = signal.butterworth(order, cutoff_hz, DT_S).sos
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    assert found[0, 0] == pytest.approx(expected[0, 0], rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("cutoff_hz", [10.0, 50.0, 200.0])
def test_filtering_is_that_of_scipy(order, cutoff_hz):
    x = np.random.default_rng(order).normal(size=(300, 2)).cumsum(axis=0)
    low_pass = signal.butterworth(order, cutoff_hz, DT_S)
    expected = scipy_signal.sosfiltfilt(low_pass.sos, x, axis=0)
    tolerance = 1e-10 * abs(expected).max()
    np.testing.assert_allclose(signal.zero_phase(low_pass, x), expected, atol=tolerance)
    np.testing.assert_allclose(low_pass.zero_phase(x[:, 1]), expected[:, 1], atol=tolerance)
    forward = scipy_signal.sosfilt(low_pass.sos, x, axis=0)
    np.testing.assert_allclose(low_pass.filter(x), forward, atol=tolerance)


def test_the_shortest_signal_is_that_of_scipy():
    low_pass = signal.butterworth(3, 50.0, DT_S)
    for n_samples in range(1, 20):
        x = np.arange(n_samples) ** 2.0
        try:
            expected = scipy_signal.sosfiltfilt(low_pass.sos, x)
        except ValueError:
            with pytest.raises(SignalError, match=f"the signal has {n_samples} samples"):
                low_pass.zero_phase(x)
        else:
            np.testing.assert_allclose(low_pass.zero_phase(x), expected, rtol=1e-10, atol=1e-10)


def test_a_view_is_read_in_its_own_order():
    x = np.random.default_rng(1).normal(size=(2, 300))
    low_pass = signal.butterworth(2, 50.0, DT_S)
    np.testing.assert_array_equal(low_pass.filter(x.T), low_pass.filter(x.T.copy()))
    np.testing.assert_array_equal(low_pass.filter(x[0, ::-2]), low_pass.filter(x[0, ::-2].copy()))


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ((0, 50.0, DT_S), "order = 0"),
        ((13, 50.0, DT_S), "order = 13"),
        ((2, 0.0, DT_S), "cutoff_hz = 0 Hz"),
        ((2, 250.0, DT_S), "cutoff_hz = 250 Hz"),
        ((2, float("nan"), DT_S), "cutoff_hz = NaN Hz"),
        ((2, 50.0, 0.0), "dt_s = 0 s"),
        ((2, 50.0, float("inf")), "dt_s = inf s"),
    ],
)
def test_a_filter_that_cannot_be_is_refused(arguments, match):
    with pytest.raises(SignalError, match=match):
        signal.butterworth(*arguments)


@pytest.mark.parametrize(
    ("x", "error", "match"),
    [
        (np.zeros((4, 4, 4)), ValueError, r"x has shape \(4, 4, 4\)"),
        (np.zeros(0), ValueError, r"x has shape \(0,\)"),
        (np.array([0.0, np.nan]), ValueError, r"x holds NaN at \[1\]"),
        (np.zeros(50, dtype=np.longdouble), TypeError, "x has dtype float128"),
        (np.zeros(50, dtype=complex), TypeError, "x has dtype complex128"),
        ("text", TypeError, "x has dtype"),
    ],
)
def test_a_bad_signal_is_refused_by_name(x, error, match):
    with pytest.raises(error, match=match):
        signal.butterworth(2, 50.0, DT_S).zero_phase(x)
