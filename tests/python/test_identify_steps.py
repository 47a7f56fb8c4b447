"""The steps of an identification against SciPy, on functions and random numbers."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from ilc_rt import ModelError, discretize, identify, second_order
from ilc_rt.repeatable import compare_runs

DT_S = 0.002


def noisy_pair(seed=0, n=6000):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=n)
    axis = discretize(second_order(120.0, 0.4), DT_S)
    return u, axis.simulate(u) + 0.2 * rng.normal(size=n)


@pytest.mark.parametrize(("segment", "overlap"), [(512, 256), (500, 100), (301, 0)])
def test_response_and_coherence_agree_with_scipy(segment, overlap):
    u, y = noisy_pair()
    found = identify.frequency_response(
        u, y, DT_S, segment_samples=segment, overlap_samples=overlap
    )
    options = {"fs": 1 / DT_S, "nperseg": segment, "noverlap": overlap}
    f, uy = scipy_signal.csd(u, y, **options)
    _, uu = scipy_signal.welch(u, **options)
    _, coherence = scipy_signal.coherence(u, y, **options)
    np.testing.assert_allclose(found.frequency_hz, f, rtol=1e-12)
    np.testing.assert_allclose(found.response, uy / uu, rtol=1e-9)
    np.testing.assert_allclose(found.coherence, coherence, rtol=1e-9)


def test_the_deviation_is_that_of_repeated_estimates():
    estimates, claimed = [], []
    for seed in range(60):
        found = identify.frequency_response(*noisy_pair(seed), DT_S, segment_samples=400)
        estimates.append(found.response[5:40])
        claimed.append(found.relative_deviation()[5:40])
    relative = np.array(estimates) / np.mean(estimates, axis=0)
    seen = np.sqrt(np.mean(np.std(relative.real, axis=0) ** 2))
    assert seen == pytest.approx(np.sqrt(np.mean(np.square(claimed))), rel=0.15)


@pytest.mark.parametrize("experiment", [identify.swept_sine, identify.multisine])
def test_a_function_is_identified_exactly(experiment):
    axis = discretize(second_order(2 * np.pi * 12.0, 0.5), DT_S).delayed(2)
    found = experiment(axis.simulate, dt_s=DT_S, amplitude=1e-3, from_hz=1.0, to_hz=60.0)
    assert found.model.gain == pytest.approx(1.0, rel=1e-5)
    assert found.model.natural_frequency_hz == pytest.approx(12.0, rel=1e-5)
    assert found.model.damping == pytest.approx(0.5, rel=1e-5)
    assert found.model.delay_s == pytest.approx(2 * DT_S, abs=1e-7)
    assert found.model.delay_samples == 2
    np.testing.assert_allclose(
        found.response, axis.frequency_response(2 * np.pi * found.frequency_hz)[:, 0, 0], rtol=1e-4
    )
    assert found.uncertainty[1].max() < 1e-3


def test_uncertainty_covers_a_mode_that_the_model_leaves_out():
    rigid, mode = second_order(2 * np.pi * 10.0, 0.7), second_order(2 * np.pi * 35.0, 0.1)
    axis = discretize(rigid.series(mode), DT_S)
    found = identify.multisine(axis.simulate, dt_s=DT_S, amplitude=1e-3, to_hz=45.0)
    model = found.described.response(found.frequency_hz)
    frequency_hz, bound = found.uncertainty
    assert (bound >= np.abs(found.response / model - 1.0) - 1e-12).all()
    assert frequency_hz[np.argmax(bound)] > 20.0
    assert bound.max() > 0.2
    grid = found.uncertainty_on_grid(501)
    assert grid.shape == (501,)
    assert (grid[-10:] >= 1.0).all()
    assert grid[20] == pytest.approx(np.interp(10.0, frequency_hz, bound))
    data = found.frequency_hz, found.response, 2, 4
    flexible = identify.fit_rational(*data, delay_s=DT_S / 2)
    assert flexible.residual_rms < 1e-3
    assert flexible.reflected_poles == 0
    assert (flexible.model.poles().real < 0).all()


def test_wrong_arguments_are_named_one_at_a_time():
    def axis(u):
        return u

    good = {"dt_s": DT_S, "amplitude": 1.0}
    with pytest.raises(ValueError, match="--periods"):
        identify.multisine(axis, periods=1, **good)
    with pytest.raises(ValueError, match="dt_s and amplitude"):
        identify.multisine(axis)
    with pytest.raises(ValueError, match="for a cell only"):
        identify.multisine(axis, axis="x", **good)
    with pytest.raises(ValueError, match="spacing"):
        identify.swept_sine(axis, spacing="square", **good)
    with pytest.raises(ValueError, match="returned shape"):
        identify.multisine(lambda u: u[1:], **good)
    with pytest.raises(ModelError, match="to_hz = 300"):
        identify.multisine(axis, to_hz=300.0, **good)
    f, h = np.linspace(1.0, 10.0, 20), np.ones(20, dtype=complex)
    with pytest.raises(ValueError, match="response has 19"):
        identify.fit_second_order(f, h[1:])
    with pytest.raises(ValueError, match="coherence holds 2"):
        identify.fit_second_order(f, h, coherence=np.full(20, 2.0))
    with pytest.raises(ModelError, match="frequency_hz = 0"):
        identify.fit_second_order(f - 1.0, h)
    with pytest.raises(ValueError, match="response holds NaN"):
        identify.fit_second_order(f, h * np.nan)
    with pytest.raises(ModelError, match="n_zeros = 3"):
        identify.fit_rational(f, h, 3, 2)
    with pytest.raises(ValueError, match="exclude each other"):
        identify.frequency_response(f, f, 1.0, period_samples=8, segment_samples=8)
    with pytest.raises(ModelError, match="output holds 19"):
        identify.frequency_response(f, f[1:], 1.0, period_samples=10)
    with pytest.raises(ValueError, match="waveform = 'noise'"):
        identify.excitation("noise", 1.0, 1.0, 10.0, 8.0, 2, DT_S)
    with pytest.raises(ValueError, match="n_averages"):
        identify.FrequencyResponse(f, h, n_averages=0.5)


def test_repeatability_splits_known_parts():
    rng = np.random.default_rng(3)
    lag = np.sin(np.linspace(0, 20, 2000))[:, None] * [3e-3, 1e-4]
    runs = lag + 1e-4 * rng.normal(size=(8, 2000, 2))
    found = compare_runs(runs, ("x", "y"))
    x, y = found.axes
    assert x.repeatable_rms_m == pytest.approx(np.sqrt(np.mean(lag[:, 0] ** 2)), rel=0.01)
    assert x.non_repeatable_rms_m == pytest.approx(1e-4, rel=0.02)
    assert (x.verdict, y.verdict) == ("yes", "no")
    assert y.ratio == pytest.approx(np.sqrt(0.5), rel=0.06)
    assert found.applicable
    noise = compare_runs(1e-4 * rng.normal(size=(8, 2000, 1)))
    assert not noise.applicable
    for bad in (runs[:1], runs[0], runs[:, :0]):
        with pytest.raises(ValueError, match="errors has shape"):
            compare_runs(bad)
    with pytest.raises(ValueError, match="not finite"):
        compare_runs(runs * np.nan)
    with pytest.raises(ValueError, match="axis_names"):
        compare_runs(runs, ("x",))


def test_the_former_name_of_a_keyword_is_refused_with_the_new_one():
    with pytest.raises(ValueError, match="now period_s"):
        identify.swept_sine(lambda u: u, dt_s=DT_S, amplitude=1.0, duration_s=5.0)
