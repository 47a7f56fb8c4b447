"""Gaussian, symmetric and switched filters and the frequency against SciPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy import signal as scipy_signal

from ilc_rt import PdIlc, SignalError, signal

DT_S = 0.002


def walk(seed, *shape):
    """Return a random walk, as rough as a machine's signal gets."""
    return np.random.default_rng(seed).normal(size=shape).cumsum(axis=0)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.floats(1.0, 240.0), st.integers(40, 400))
def test_zero_phase_is_that_of_scipy_at_any_size(seed, order, cutoff_hz, n_samples):
    x = walk(seed, n_samples, 2)
    low_pass = signal.butterworth(order, cutoff_hz, DT_S)
    expected = scipy_signal.sosfiltfilt(low_pass.sos, x, axis=0)
    # A narrow filter of high order amplifies rounding; the factor follows from its step response.
    tolerance = 1e-10 if cutoff_hz > 5.0 else 1e-6
    np.testing.assert_allclose(
        low_pass.zero_phase(x), expected, atol=tolerance * (1.0 + abs(expected).max())
    )


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(2.0, 100.0), st.integers(130, 500))
def test_gaussian_is_that_of_scipy(seed, bandwidth_hz, n_samples):
    x = walk(seed, n_samples, 3)
    low_pass = signal.gaussian(bandwidth_hz, DT_S)
    sigma = np.sqrt(np.log(2.0)) / (2.0 * np.pi * bandwidth_hz * DT_S)
    assert low_pass.sigma_samples == pytest.approx(sigma, rel=1e-14)
    reach = int(np.ceil(3.8906 * sigma))
    expected = ndimage.gaussian_filter1d(x, sigma, axis=0, mode="reflect", radius=reach)
    tolerance = 1e-12 * (1.0 + abs(x).max())
    np.testing.assert_allclose(low_pass.zero_phase(x), expected, rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(
        signal.zero_phase(low_pass, x[:, 1]), expected[:, 1], rtol=0.0, atol=tolerance
    )


def test_gaussian_bandwidth_is_where_the_gain_is_one_over_root_two():
    for bandwidth_hz in [3.0, 15.0, 40.0]:
        pulse = np.zeros(2001)
        pulse[1000] = 1.0
        response = signal.gaussian(bandwidth_hz, DT_S).zero_phase(pulse)
        t_s = DT_S * (np.arange(2001) - 1000)
        gain = response @ np.cos(2.0 * np.pi * bandwidth_hz * t_s)
        assert gain == pytest.approx(np.sqrt(0.5), abs=2e-4)
        assert response.sum() == pytest.approx(1.0, abs=1e-14)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(0, 8), st.integers(1, 5), st.integers(1, 120))
def test_fir_is_that_of_numpy(seed, reach, repeats, n_samples):
    half = np.random.default_rng(seed).normal(size=reach + 1)
    taps = np.concatenate([half[:0:-1], half])
    product = taps
    for _ in range(repeats - 1):
        product = np.convolve(product, taps)
    smoother = signal.fir(taps, repeats)
    scale = abs(taps).sum() ** repeats
    np.testing.assert_allclose(smoother.taps, product, rtol=0.0, atol=1e-13 * scale)
    x = walk(seed, n_samples)
    extended = np.pad(x, len(product) // 2, mode="edge")
    expected = np.convolve(extended, product, mode="valid")
    np.testing.assert_allclose(
        smoother.zero_phase(x), expected, rtol=0.0, atol=1e-12 * scale * (1.0 + abs(x).max())
    )


def test_the_smoother_with_twenty_five_taps():
    smoother = signal.fir(np.array([-1.0, 4.0, 10.0, 4.0, -1.0]) / 16.0, repeats=6)
    assert smoother.taps.shape == (25,)
    x = walk(5, 300)
    expected = np.convolve(np.pad(x, 12, mode="edge"), smoother.taps, mode="valid")
    np.testing.assert_allclose(signal.zero_phase(smoother, x), expected, atol=1e-12)
    np.testing.assert_array_equal(signal.zero_phase(smoother.taps, x), smoother.zero_phase(x))


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(2, 300))
def test_instantaneous_frequency_is_that_of_scipy(seed, n_samples):
    x = np.random.default_rng(seed).normal(size=n_samples)
    angle = np.unwrap(np.angle(scipy_signal.hilbert(x)))
    expected = np.diff(angle) / (2.0 * np.pi * DT_S)
    found = signal.instantaneous_frequency(x, DT_S)
    # Half a turn is ambiguous: the two then differ by the sampling rate.
    turns = (found - expected) * DT_S
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-10)
    assert (abs(np.round(turns[abs(abs(expected) * DT_S - 0.5) > 1e-9])) == 0).all()


def test_the_frequency_of_a_chirp_is_followed():
    t_s = np.arange(4000) * DT_S
    x = scipy_signal.chirp(t_s, 2.0, t_s[-1], 40.0)
    found = signal.instantaneous_frequency(x, DT_S)
    expected = 2.0 + 38.0 * (t_s[:-1] + 0.5 * DT_S) / t_s[-1]
    np.testing.assert_allclose(found[300:-300], expected[300:-300], rtol=0.03)


def test_switched_is_a_cross_fade_of_scipy_filters():
    x = walk(3, 1000, 2)
    filtered = {
        hz: scipy_signal.sosfiltfilt(
            scipy_signal.butter(2, hz, fs=1.0 / DT_S, output="sos"), x, axis=0
        )
        for hz in (10.0, 50.0)
    }
    k = np.arange(1000) + 0.5
    blend = 60

    def begun(start):
        return 0.5 + 0.5 * np.sin(np.pi * np.clip((k - start) / blend, -0.5, 0.5))

    high = (begun(300) - begun(600))[:, None]
    expected = (1.0 - high) * filtered[10.0] + high * filtered[50.0]
    switched = signal.SwitchedFilter([10.0, 50.0, 10.0], [0, 300, 600], DT_S, blend=blend)
    np.testing.assert_allclose(switched.zero_phase(x), expected, atol=1e-10 * (1.0 + abs(x).max()))


def test_segments_are_found_where_the_motion_is_fast():
    t_s = np.arange(5000) * DT_S
    slow = np.sin(2.0 * np.pi * 0.5 * t_s)
    burst = np.exp(-(((t_s - 5.0) / 0.3) ** 2)) * np.sin(2.0 * np.pi * 12.0 * t_s)
    found = signal.SwitchedFilter.from_signal(slow + 3.0 * burst, DT_S, 10.0, 50.0, 6.0)
    assert found.cutoffs_hz == [10.0, 50.0, 10.0]
    assert 4.0 < found.starts[1] * DT_S < 4.9
    assert 5.1 < found.starts[2] * DT_S < 6.0
    both = signal.SwitchedFilter.from_signal(
        np.stack([slow, slow + 3.0 * burst], axis=1), DT_S, 10.0, 50.0, 6.0
    )
    assert both.starts == found.starts
    calm = signal.SwitchedFilter.from_signal(slow, DT_S, 10.0, 50.0, 6.0)
    assert calm.cutoffs_hz == [10.0]


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (lambda: signal.gaussian(0.0, DT_S), SignalError, "bandwidth_hz = 0 Hz"),
        (lambda: signal.gaussian(250.0, DT_S), SignalError, "bandwidth_hz = 250 Hz"),
        (lambda: signal.gaussian(15.0, 0.0), SignalError, "dt_s = 0 s"),
        (lambda: signal.gaussian(1.0, DT_S).zero_phase(np.zeros(9)), SignalError, "has 9 samples"),
        (lambda: signal.fir([0.5, 0.5]), SignalError, "2 taps"),
        (lambda: signal.fir([0.2, 0.5, 0.3]), SignalError, "tap 0 = 0.2"),
        (lambda: signal.fir([1.0], repeats=0), SignalError, "0 taps"),
        (lambda: signal.fir([np.nan]), ValueError, r"taps holds NaN at \[0\]"),
        (lambda: signal.fir([[1.0]]), ValueError, r"taps has shape \(1, 1\)"),
        (lambda: signal.SwitchedFilter([10.0], [0, 5], DT_S), SignalError, "1 cutoffs_hz for 2"),
        (lambda: signal.SwitchedFilter([], [], DT_S), SignalError, "0 segments"),
        (lambda: signal.SwitchedFilter([10.0], [3], DT_S), SignalError, "starts at sample 3"),
        (lambda: signal.SwitchedFilter([300.0], [0], DT_S), SignalError, "cutoff_hz = 300 Hz"),
        (
            lambda: signal.SwitchedFilter([9.0, 8.0], [0, 90], DT_S).zero_phase(np.zeros(50)),
            SignalError,
            "segment 1 starts at sample 90",
        ),
        (
            lambda: signal.SwitchedFilter.from_signal(np.zeros(99), DT_S, 50.0, 10.0, 5.0),
            SignalError,
            "low_hz = 50 Hz and high_hz = 10 Hz",
        ),
        (
            lambda: signal.SwitchedFilter.from_signal(np.full(99, np.inf), DT_S, 9.0, 50.0, 5.0),
            ValueError,
            r"reference holds inf at \[0\]",
        ),
        (lambda: signal.instantaneous_frequency([1.0], DT_S), SignalError, "has 1 samples"),
        (lambda: signal.instantaneous_frequency([1.0, 2.0], -1.0), SignalError, "dt_s = -1 s"),
        (lambda: signal.zero_phase(3.0, np.zeros(9)), TypeError, "filter is a float"),
        (lambda: PdIlc(1.0, 0.0, q_filter="x"), TypeError, "q_filter is a str"),
        (lambda: PdIlc(1.0, 0.0, q_filter=[0.5, 0.5]), SignalError, "2 taps"),
    ],
)
def test_what_cannot_be_filtered_is_refused(make, error, match):
    with pytest.raises(error, match=match):
        make()
