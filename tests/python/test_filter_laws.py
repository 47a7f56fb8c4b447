"""Simple laws, gate, ladder and repeatability against dense NumPy and hand calculations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ilc_rt import (
    AdjointIlc,
    ErrorFeedforwardIlc,
    Gate,
    Ladder,
    LearningError,
    ModelInverseIlc,
    NormOptimalIlc,
    PdIlc,
    StateSpace,
    discretize,
    repeatability,
    second_order,
    signal,
)

DT_S = 0.002


def axis(w0=157.0, damping=0.5):
    """Return the closed position loop of one axis."""
    return discretize(second_order(w0, damping), DT_S)


def random_model(seed, n_states, n_inputs, n_outputs):
    """Return a stable model, with feedthrough for every other seed."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n_states, n_states))
    a *= 0.95 / max(abs(np.linalg.eigvals(a)))
    return StateSpace(
        a,
        rng.normal(size=(n_states, n_inputs)),
        rng.normal(size=(n_outputs, n_states)),
        rng.normal(size=(n_outputs, n_inputs)) * (seed % 2),
        DT_S,
    )


FILTERS = {
    "none": None,
    "zero_phase": signal.butterworth(2, 30.0, DT_S),
    "causal": signal.butterworth(3, 30.0, DT_S, causal=True),
    "gaussian": signal.gaussian(25.0, DT_S),
    "fir": signal.fir([-1.0 / 16, 0.25, 0.625, 0.25, -1.0 / 16], repeats=3),
    "taps": np.array([0.25, 0.5, 0.25]),
    "switched": signal.SwitchedFilter([10.0, 60.0], [0, 40], DT_S, blend=20),
}


def apply(low_pass, x):
    """Return the signal filtered as by a law."""
    if low_pass is None:
        return x
    if getattr(low_pass, "causal", False):
        return low_pass.filter(x)
    return signal.zero_phase(low_pass, x)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("lead", [0, 1, 3])
def test_pd_and_feedforward_are_their_equations_with_every_filter(name, lead):
    q_filter = FILTERS[name]
    rng = np.random.default_rng(lead)
    u, e = rng.normal(size=(120, 2)), rng.normal(size=(120, 2))
    held = np.concatenate([e[:1], e, np.repeat(e[-1:], lead, axis=0)])
    ahead, before = held[1 + lead :], held[lead:-1]
    expected = apply(q_filter, u + 0.7 * ahead + 2.0 * (ahead - before))
    found = PdIlc(0.7, 2.0, q_filter=q_filter, lead_samples=lead).update(u, e)
    np.testing.assert_allclose(found, expected, atol=1e-12)

    smooth = apply(q_filter, e)
    expected = u + 0.5 * np.concatenate([smooth, np.repeat(smooth[-1:], lead, axis=0)])[lead:]
    law = ErrorFeedforwardIlc(0.5, q_filter, lead)
    np.testing.assert_allclose(law.update(u, e), expected, atol=1e-12)
    limited = ErrorFeedforwardIlc(0.5, q_filter, lead, input_max=0.4)
    np.testing.assert_allclose(limited.update(u, e), expected.clip(-0.4, 0.4), atol=1e-12)
    assert limited.n_limited == (abs(expected) > 0.4).sum()


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 4), st.integers(1, 3), st.integers(1, 3)),
    st.integers(1, 60),
)
def test_gradient_law_is_that_of_the_dense_operator(seed, sizes, n_samples):
    model = random_model(seed, *sizes)
    operator = model.lifted(n_samples)
    norm = np.linalg.norm(operator, 2)
    if norm == 0.0:
        with pytest.raises(LearningError, match=r"\|P\| = 0"):
            AdjointIlc(model, n_samples)
        return
    rng = np.random.default_rng(seed)
    u, e = rng.normal(size=(n_samples, sizes[1])), rng.normal(size=(n_samples, sizes[2]))
    law = AdjointIlc(model, n_samples)
    assert law.gain_limit == pytest.approx(2.0 / norm**2, rel=1e-6)
    assert law.gain == pytest.approx(1.0 / norm**2, rel=1e-6)
    found = AdjointIlc(model, n_samples, gain=0.5 * law.gain).update(u, e)
    expected = u + 0.5 * law.gain * (operator.T @ e.ravel()).reshape(u.shape)
    np.testing.assert_allclose(found, expected, atol=1e-12 * (1.0 + abs(expected).max()))


@pytest.mark.parametrize("name", FILTERS)
def test_model_laws_filter_their_result(name):
    rng = np.random.default_rng(1)
    u, e = rng.normal(size=120), rng.normal(size=120)
    for make in (AdjointIlc, ModelInverseIlc):
        plain = make(axis(), 120).update(u, e)
        found = make(axis(), 120, q_filter=FILTERS[name]).update(u, e)
        np.testing.assert_allclose(found, apply(FILTERS[name], plain), atol=1e-10)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(1, 3), st.integers(1, 60))
def test_inverse_of_several_axes_leaves_no_error_that_can_be_reached(seed, n, m, n_samples):
    model = random_model(2 * seed + 1, n, m, m)
    # With feedthrough the zeros are the eigenvalues of A - B inv(D) C.
    zeros = np.linalg.eigvals(model.a - model.b @ np.linalg.solve(model.d, model.c))
    if max(abs(zeros)) >= 1.0 - 1e-7:
        with pytest.raises(LearningError, match="zero at"):
            ModelInverseIlc(model, n_samples)
        return
    e = np.random.default_rng(seed).normal(size=(n_samples, m))
    change = ModelInverseIlc(model, n_samples, 1.0).update(np.zeros((n_samples, m)), e)
    left = e - model.simulate(change).reshape(e.shape)
    growth = np.linalg.norm(model.lifted(n_samples), 2) * abs(change).max()
    np.testing.assert_allclose(left, 0.0, atol=1e-11 * (1.0 + growth))


def test_a_gain_that_diverges_is_refused_without_filter():
    limit = AdjointIlc(axis(), 100).gain_limit
    with pytest.raises(LearningError, match="it must be less than 2"):
        AdjointIlc(axis(), 100, gain=1.01 * limit)
    AdjointIlc(axis(), 100, gain=1.01 * limit, q_filter=FILTERS["zero_phase"])
    for gain in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(LearningError, match="gain = "):
            AdjointIlc(axis(), 100, gain=gain)


class Recorder:
    """A user's own law: adds one and records its arguments."""

    def __init__(self):
        self.seen = []

    def update(self, u, e, disturbance=None):
        """Return the input with one added."""
        self.seen.append((u.shape, e.shape, disturbance))
        return u + 1.0


def test_gate_holds_resumes_and_rolls_back():
    law = Gate(Recorder(), tolerance=1.0)
    u = np.zeros(2)
    states, inputs = [], []
    for size in [5.0, 2.0, 0.9, 1.4, 1.6, 4.0, 4.1, 1.5]:
        u = law.update(u, np.array([size, -size]))
        states.append(law.state)
        inputs.append(u[0])
    assert states == ["learning"] * 2 + ["holding"] * 2 + ["learning"] * 2 + ["rolled_back"] * 2
    # Learning resumed with input 2 and an error of 1.6; it grew for two runs.
    assert inputs == [1.0, 2.0, 2.0, 2.0, 3.0, 4.0, 2.0, 2.0]
    assert law.best_error == 1.5
    np.testing.assert_array_equal(law.best_input, [2.0, 2.0])
    law.reset()
    assert (law.state, law.best_error, law.best_input) == ("learning", None, None)


def test_gate_judges_by_its_measure():
    e = np.array([3.0, -4.0])
    for measure, size in [("rms", np.sqrt(12.5)), ("max", 4.0)]:
        law = Gate(Recorder(), tolerance=size * 1.001, measure=measure)
        law.update(np.zeros(2), e)
        assert law.state == "holding"
        law = Gate(Recorder(), tolerance=size * 0.999, measure=measure)
        law.update(np.zeros(2), e)
        assert law.state == "learning"
        assert law.best_error == pytest.approx(size)


def test_rms_of_several_channels_is_that_of_the_length_as_in_a_cell():
    e = np.array([[3.0, -4.0], [0.0, 2.0]])
    law = Gate(Recorder())
    law.update(np.zeros((2, 2)), e)
    assert law.best_error == pytest.approx(np.sqrt((25.0 + 4.0) / 2))
    # The same numbers as one channel give a different figure.
    law = Gate(Recorder())
    law.update(np.zeros(4), e.ravel())
    assert law.best_error == pytest.approx(np.sqrt(29.0 / 4))


def test_a_ladder_tells_its_mean_its_noise_and_its_gain():
    law = Ladder(PdIlc(1.0, 0.0, lead_samples=0), repeats=2, slow=0.5, increase=1.25)
    assert law.repeatable_rms is None
    np.testing.assert_array_equal(law.update(np.zeros(2), np.array([1.0, 5.0])), 0.0)
    assert law.runs == 1
    np.testing.assert_allclose(law.update(np.zeros(2), np.array([3.0, 3.0])), [2.0, 4.0])
    # Variances 2 and 2 of a run, half in the mean of two; mean square of the mean 10.
    assert law.noise_rms == pytest.approx(1.0)
    assert law.repeatable_rms == pytest.approx(3.0)
    assert (law.runs, law.gain) == (0, 1.0)
    still = Ladder(PdIlc(1.0, 0.0), repeats=1, increase=1.0, lowest=1.0, highest=1.0)
    for size in [1.0, 2.0, 2.0]:
        still.update(np.zeros(1), np.array([size]))
        assert still.gain == 1.0


def test_a_law_can_be_used_for_runs_of_other_lengths_and_again():
    law = PdIlc(1.0, 0.5, signal.butterworth(2, 50.0, DT_S))
    e = np.random.default_rng(1).normal(size=300)
    first = law.update(np.zeros(300), e)
    law.update(np.zeros((100, 3)), np.ones((100, 3)))
    law.reset()
    np.testing.assert_array_equal(law.update(np.zeros(300), e), first)


@pytest.mark.parametrize("wrap", [lambda law: Gate(law), lambda law: Ladder(law, 1)])
def test_what_the_law_inside_sees_and_raises(wrap):
    inside = Recorder()
    law = wrap(inside)
    assert law.law is inside
    law.update(np.zeros((4, 2)), np.ones((4, 3)), {"temperature_c": 21.5})
    law.update(np.zeros(4), np.ones(4))
    law.reset()
    assert inside.seen == [((4, 2), (4, 3), {"temperature_c": 21.5}), ((4,), (4,), None)]

    class Broken:
        def update(self, u, e, disturbance=None):
            del e, disturbance
            raise KeyError(u.shape)

    with pytest.raises(KeyError, match="4,"):
        wrap(Broken()).update(np.zeros(4), np.ones(4))

    class Shrinking:
        def update(self, u, e, disturbance=None):
            del e, disturbance
            return u[:-1]

    with pytest.raises(ValueError, match="the input returned by update has shape"):
        wrap(Shrinking()).update(np.zeros(4), np.ones(4))
    with pytest.raises(TypeError, match=r"law = 1\.5 is a float"):
        wrap(1.5)


def test_a_norm_optimal_law_of_more_outputs_than_inputs_can_be_gated():
    model = random_model(4, 3, 1, 2)
    law = NormOptimalIlc(model, 30, r=0.1)
    u, e = np.zeros(30), np.ones((30, 2))
    np.testing.assert_array_equal(Gate(law).update(u, e), law.update(u, e))


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (lambda: Gate(Recorder(), tolerance=-1.0), LearningError, "tolerance = -1"),
        (lambda: Gate(Recorder(), resume=0.5), LearningError, "resume = 0.5"),
        (lambda: Gate(Recorder(), growth=np.nan), LearningError, "growth = NaN"),
        (lambda: Gate(Recorder(), patience=0), LearningError, "patience = 0"),
        (lambda: Gate(Recorder(), measure="mean"), ValueError, "measure = 'mean'"),
        (lambda: Ladder(Recorder(), 0), LearningError, "repeats = 0"),
        (lambda: Ladder(Recorder(), 2, slow=2.0), LearningError, "slow = 2"),
        (lambda: Ladder(Recorder(), 2, increase=0.5), LearningError, "increase = 0.5"),
        (lambda: repeatability(np.zeros((1, 5))), LearningError, "n_runs = 1"),
        (lambda: repeatability(np.zeros(5)), ValueError, r"errors has shape \(5,\)"),
        (lambda: repeatability(np.zeros((2, 0))), ValueError, r"errors has shape \(2, 0\)"),
        (lambda: repeatability([[1.0], [np.nan]]), ValueError, r"errors holds NaN at \[1, 0\]"),
    ],
)
def test_wrong_arguments_are_refused_one_at_a_time(make, error, match):
    with pytest.raises(error, match=match):
        make()


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(2, 12), st.integers(1, 40), st.integers(1, 3))
def test_repeatability_is_that_of_numpy(seed, n_runs, n_samples, n_channels):
    rng = np.random.default_rng(seed)
    errors = rng.normal(size=(n_samples, n_channels)) + 0.3 * rng.normal(
        size=(n_runs, n_samples, n_channels)
    )
    found = repeatability(errors)
    mean, spread = errors.mean(axis=0), errors.std(axis=0, ddof=1)
    np.testing.assert_allclose(found.mean, mean, atol=1e-14)
    np.testing.assert_allclose(found.spread, spread, atol=1e-13)
    ms_mean, ms_spread = (mean**2).mean(), (spread**2).mean()
    assert found.mean_rms == pytest.approx(np.sqrt(ms_mean))
    assert found.spread_rms == pytest.approx(np.sqrt(ms_spread))
    assert found.ratio == pytest.approx(np.sqrt(ms_spread / ms_mean))
    repeatable = max(0.0, ms_mean - ms_spread / n_runs)
    assert found.learnable == pytest.approx(repeatable / (repeatable + ms_spread))
    rms = np.sqrt((errors**2).mean(axis=(1, 2)))
    assert (found.least_rms, found.largest_rms) == (
        pytest.approx(rms.min()),
        pytest.approx(rms.max()),
    )
    if n_channels == 1:
        assert repeatability(errors[:, :, 0]).mean.shape == (n_samples,)
