"""Wrong arguments for the public interface: no abort, panic, hang or non-finite result."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ilc_rt import (
    Gate,
    LearningError,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    SignalError,
    analyze,
    discretize,
    from_transfer_function,
    identify,
    recommend,
    repeatability,
    second_order,
    signal,
    trajectory,
    tune,
    weights,
)

BORDER = Path(__file__).parents[1] / "fuzz" / "border.py"
AXIS = discretize(second_order(94.0, 0.7), 0.002)


@pytest.mark.timeout(600)
def test_fifteen_hundred_drawn_calls_break_no_rule():
    command = [sys.executable, str(BORDER), "--calls", "1500", "--seconds", "500", "--seed", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: AXIS.lifted(10**5), "n_samples = 100000; at most 7071"),
        (lambda: AXIS.lifted(2**63), "n = 9223372036854775808; a whole number from 0 to"),
        (lambda: AXIS.markov(2**31), "count = 2147483648; at most 10000000"),
        (lambda: AXIS.markov(10**10), "n = 10000000000; a whole number from 0 to 4294967295"),
        (lambda: AXIS.markov(-1), "n = -1; a whole number from 0"),
        (lambda: AXIS.delayed(2**31), "n_delay = 2147483648; at most 1998"),
        (lambda: analyze(PdIlc(0.5, 0.0), AXIS, 10**12), "n_samples = 1000000000000"),
        (lambda: analyze(PdIlc(0.5, 0.0), AXIS, 10**9), "n_samples = 1000000000; at most"),
        (lambda: analyze(PdIlc(0.5, 0.0), AXIS, 10**7), "an analysis = 10000000; at most 1000000"),
        (lambda: tune(AXIS, 10**7, noise_std=1e-6), "of an analysis = 10000000; at most 1000000"),
        (lambda: recommend(AXIS, 10**7, uncertainty=0.2), "10000000; at most 1000000"),
        (lambda: NormOptimalIlc(AXIS, 10**9, r=0.1), "n_samples = 1000000000; at most 10000000"),
        (lambda: signal.fir([0.25, 0.5, 0.25], 10**7), "at most 20001"),
        (lambda: identify.frequency_response(np.ones(64), np.ones(64), 0.1,
                                             segment_samples=2**63), "segment_samples = 92233"),
        (lambda: identify.frequency_response(np.ones(64), np.ones(64), 0.1,
                                             segment_samples=2**31), "at least 8, and no more"),
        (lambda: weights.schedule([(0, 1.0)], 2**32), "n_samples = 4294967296"),
        (lambda: trajectory.exponential_sigmoid(
            [[0.0, 0.0], [0.1, 0.0]], feed_m_s=1e-200, dt_s=0.002, velocity_max_m_s=0.5,
            acceleration_max_m_s2=2.0, jerk_max_m_s3=50.0), "samples: allowed 10000000"),
        (lambda: identify.fit_rational(np.arange(1.0, 81.0), np.exp(-1j * np.arange(80.0) / 50),
                                       n_zeros=1, n_poles=2, delay_s=1e308), "a million periods"),
        (lambda: weights.formation(10**7, 1, 60), "n_agents \\* n_axes = 10000000; at most 256"),
        (lambda: weights.formation(1, 10**7, 60), "n_agents \\* n_axes = 10000000; at most 256"),
        (lambda: weights.formation(2**31, 2**31, 1), "; at most 256"),
    ],
)  # fmt: skip
def test_sizes_are_bounded_before_memory_is_asked_for(call, words):
    with pytest.raises(ValueError, match=words):
        call()


@pytest.mark.parametrize("given", [2.0, np.float64(2.0), True, np.bool_(True), "2", None, [2], 1j])
def test_what_counts_nothing_is_a_type_error_with_a_name(given):
    with pytest.raises(TypeError, match=r"lead_samples = .*a whole number from 0"):
        PdIlc(0.5, 0.0, lead_samples=given)


@pytest.mark.parametrize("given", [2, np.int64(2), np.uint8(2), np.array(2)])
def test_whole_numbers_of_any_kind_do(given):
    assert "lead_samples=2" in repr(PdIlc(0.5, 0.0, lead_samples=given))
    assert "patience=2" in repr(Gate(PdIlc(0.5, 0.0), patience=given))


def test_narrower_numbers_are_widened_and_others_refused():
    u = np.linspace(0.0, 1.0, 20)
    expected = AXIS.simulate(u.astype(np.float32).astype(float))
    np.testing.assert_array_equal(AXIS.simulate(u.astype(np.float32)), expected)
    for dtype in (complex, object, np.longdouble, str, "datetime64[s]", bool):
        with pytest.raises(TypeError, match="u has dtype"):
            AXIS.simulate(np.zeros(20).astype(dtype))


def test_what_overflows_is_an_error_of_its_module():
    runaway = from_transfer_function([1.0], [1.0, -1e10], 0.002)
    for call in (lambda: runaway.simulate(np.ones(60)), lambda: runaway.markov(60),
                 lambda: runaway.lifted(60)):  # fmt: skip
        with pytest.raises(ModelError, match="not finite"):
            call()
    with pytest.raises(ModelError, match="numerator holds 0 values"):
        from_transfer_function([], [1.0, 1.0])


def test_states_that_nothing_moves_are_no_integrators():
    scipy_signal = pytest.importorskip("scipy.signal")
    gain = discretize(scipy_signal.TransferFunction([2.0], [1.0]), 0.01)
    np.testing.assert_allclose(gain.dc_gain(), [[2.0]])
    with pytest.raises(ModelError, match="integrates"):
        from_transfer_function([1.0], [1.0, -1.0], 0.01).dc_gain()


@pytest.mark.parametrize("order", range(1, 13))
def test_no_cutoff_makes_a_filter_of_numbers_that_are_none(order):
    x = np.ones(400)
    for share in [1e-300, 1e-12, 1e-9, 1e-7, 9e-6, 2e-5, 1e-3, 0.3, 0.4999, 0.4999999999]:
        cutoff_hz = share / 1e-3
        if share < (1e-10 if order == 1 else 1e-5):
            with pytest.raises(SignalError, match=r"cutoff_hz = .* needs at least"):
                signal.butterworth(order, cutoff_hz, 1e-3)
            continue
        y = signal.butterworth(order, cutoff_hz, 1e-3).zero_phase(x)
        np.testing.assert_allclose(y, x, rtol=0, atol=2e-3)


def test_a_silent_axis_is_doubted_and_not_a_failure():
    found = identify.multisine(lambda u: 0 * u, dt_s=0.002, amplitude=1e-3)
    assert found.doubt is not None
    assert "does not answer" in found.doubt
    assert found.model.gain == 0.0
    assert found.model.residual_rms == 1.0
    assert np.isfinite(found.uncertainty[1]).all()


@pytest.mark.parametrize(("f0", "damping", "low", "high"), [(12, 0.5, 36, 80), (12, 0.1, 24, 60)])
def test_a_resonance_below_the_band_is_found(f0, damping, low, high):
    f = np.arange(low, high + 0.25, 0.5)
    model = discretize(second_order(2 * np.pi * f0, damping), 0.002)
    h = np.asarray(model.frequency_response(2 * np.pi * f)).reshape(-1)
    found = identify.fit_second_order(f, h, dt_s=0.002)
    assert found.natural_frequency_hz == pytest.approx(f0, rel=1e-4)
    assert found.gain == pytest.approx(1.0, rel=1e-3)
    assert found.residual_rms < 1e-7


@pytest.mark.parametrize(
    "degrees", [(2, 3), (2, 4), (3, 4), (3, 5), (4, 4), (5, 6), (6, 6), (8, 8)]
)
def test_a_fraction_of_more_poles_than_there_are_fits_too(degrees):
    model = from_transfer_function([1.0, 6.0, 3600.0], np.polymul([1.0, 9.0, 8100.0], [1.0, 40.0]))
    w = np.geomspace(1.0, 80.0, 200) * 2 * np.pi
    h = np.asarray(model.frequency_response(w)).reshape(-1)
    assert identify.fit_rational(w / 2 / np.pi, h, *degrees).residual_rms < 1e-3


@pytest.mark.parametrize(("bandwidth_hz", "dt_s"), [(20.0, 5e-324), (5e-324, 0.002)])
def test_a_bell_wider_than_any_number_is_refused(bandwidth_hz: float, dt_s: float) -> None:
    with pytest.raises(SignalError, match=r"dt_s|bandwidth_hz"):
        signal.gaussian(bandwidth_hz, dt_s)


def test_a_loop_at_rest_answers_with_its_gain_alone() -> None:
    """The open loop integrates, so only the position gain remains at 0 Hz."""
    frequency_hz = np.linspace(1.0, 40.0, 80)
    z = np.exp(2j * np.pi * frequency_hz * 0.002)
    fit = identify.fit_velocity_loop(
        frequency_hz, 0.002 / (z - 1) / (1 + 20.0 / z * 0.002 / (z - 1)), dt_s=0.002,
        position_gain_per_s=20.0,
    )  # fmt: skip
    assert fit.response(np.array([0.0]))[0] == pytest.approx(0.05)
    assert abs(fit.response(np.array([0.01]))[0]) == pytest.approx(0.05, rel=1e-3)


def test_errors_whose_squares_overflow_have_no_repeatability() -> None:
    with pytest.raises(ValueError, match="must be finite"):
        repeatability(np.full((3, 5), 1e199))


def test_weights_beyond_the_largest_number_are_refused() -> None:
    with pytest.raises(LearningError, match="not finite"):
        weights.coupled(np.full((2, 2), 1e199))
