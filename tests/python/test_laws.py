"""Learning laws against dense NumPy solutions of the lifted problem."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as scipy_signal

from ilc_rt import (
    LearningError,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    SignalError,
    StateSpace,
    discretize,
    from_transfer_function,
    second_order,
    signal,
)

DT_S = 0.002


def axis(w0=157.0, damping=0.5, dt_s=DT_S):
    """Return the closed position loop of one axis."""
    return discretize(second_order(w0, damping), dt_s)


def lifted(model, n_samples):
    """Return the dense lifted system, built from powers of the matrices alone."""
    a, b, c, d = model.a, model.b, model.c, model.d
    n_outputs, n_inputs = d.shape
    matrix = np.zeros((n_samples, n_outputs, n_samples, n_inputs))
    for lag in range(n_samples):
        block = d if lag == 0 else c @ np.linalg.matrix_power(a, lag - 1) @ b
        for k in range(n_samples - lag):
            matrix[k + lag, :, k, :] = block
    return matrix.reshape(n_samples * n_outputs, n_samples * n_inputs)


def dense_update(model, u, e, q=1.0, s=0.0, r=0.0, rate=0.0):
    """Return the minimiser of the stacked least-squares problem."""
    n_samples, n_inputs = u.shape
    eye = np.eye(u.size)
    difference = np.kron(np.diff(np.eye(n_samples), axis=0), np.eye(n_inputs))
    rows = [np.sqrt(q) * lifted(model, n_samples), np.sqrt(s) * eye, np.sqrt(r) * eye]
    right = [np.sqrt(q) * e.ravel(), -np.sqrt(s) * u.ravel(), np.zeros(u.size)]
    rows.append(rate * difference)
    right.append(np.zeros(len(difference)))
    change, *_ = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=1e-16)
    return u + change.reshape(u.shape)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 4), st.integers(1, 3), st.integers(1, 3)),
    st.integers(1, 40),
    st.sampled_from([0.0, 1e-3, 1.0]),
    st.sampled_from([1e-3, 1.0]),
    st.sampled_from([0.0, 0.3, 3.0]),
)
def test_norm_optimal_update_is_the_minimiser(seed, sizes, n_samples, s, r, rate):
    n_states, n_inputs, n_outputs = sizes
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n_states, n_states))
    a *= 0.95 / max(abs(np.linalg.eigvals(a)))
    parts = (
        a,
        rng.normal(size=(n_states, n_inputs)),
        rng.normal(size=(n_outputs, n_states)),
        rng.normal(size=(n_outputs, n_inputs)) * (seed % 2),
    )
    model = StateSpace(*parts, DT_S)
    u, e = rng.normal(size=(n_samples, n_inputs)), rng.normal(size=(n_samples, n_outputs))
    found = NormOptimalIlc(model, n_samples, q=2.0, s=s, r=r, rate=rate).update(u, e)
    expected = dense_update(model, u, e, q=2.0, s=s, r=r, rate=rate)
    np.testing.assert_allclose(found, expected, atol=1e-10 * abs(expected).max())


@pytest.mark.parametrize("dt_s", [0.001, 0.002, 0.004])
@pytest.mark.parametrize("n_delay", [0, 1, 3])
def test_convex_optimisation_law_of_the_gantry(dt_s, n_delay):
    model = axis(94.0, 1.0, dt_s).append(axis(94.0, 0.6, dt_s)).delayed(n_delay)
    rng = np.random.default_rng(n_delay)
    u, e = rng.normal(size=(100, 2)), rng.normal(size=(100, 2))
    found = NormOptimalIlc(model, 100, rate=3.0).update(u, e)
    np.testing.assert_allclose(found, dense_update(model, u, e, rate=3.0), atol=1e-10)


def test_convex_optimisation_law_as_printed():
    # Input 0 .. N-2 against error 1 .. N-1, H = P'P + d^2 D'D, f = -P'e.
    n_samples, d = 300, 3.0
    model = axis()
    operator = lifted(model, n_samples)[1:, :-1]
    difference = np.diff(np.eye(n_samples - 1), axis=0)
    hessian = operator.T @ operator + d**2 * difference.T @ difference
    e = np.sin(np.arange(n_samples) / 30.0) ** 3
    expected = np.linalg.solve(hessian, operator.T @ e[1:])
    found = NormOptimalIlc(model, n_samples, rate=d).update(np.zeros(n_samples), e)
    np.testing.assert_allclose(found[:-1], expected, atol=1e-9 * abs(expected).max())
    assert found[-1] == pytest.approx(found[-2], rel=1e-12)


def learn(law, model, reference, runs):
    """Return the largest error of each run."""
    u = np.zeros_like(reference)
    largest = []
    for _ in range(runs):
        e = reference - model.simulate(reference + u)
        largest.append(abs(e).max())
        u = law.update(u, e)
    return np.array(largest)


def test_norm_optimal_learning_falls_steadily_and_below_pd():
    model = axis()
    t_s = np.arange(800) * DT_S
    reference = 0.1 * scipy_signal.lfilter(np.ones(100) / 100, 1.0, np.clip(t_s - 0.1, 0.0, 0.5))
    best = learn(NormOptimalIlc(model, 800, rate=3.0), model, reference, 30)
    low_pass = signal.butterworth(2, 50.0, DT_S)
    pd = learn(PdIlc(1.0, 3.25, low_pass), model, reference, 30)
    assert (np.diff(best) <= 0.0).all()
    assert best[-1] < 0.5 * pd[-1] < 0.5 * pd[0]


def test_pd_update_is_its_equation():
    rng = np.random.default_rng(3)
    u, e = rng.normal(size=(200, 2)), rng.normal(size=(200, 2))
    low_pass = signal.butterworth(2, 50.0, DT_S)
    for lead in (0, 1, 4):
        ahead = np.vstack([e, np.repeat(e[-1:], lead, axis=0)])[lead:]
        held = np.vstack([np.repeat(e[:1], 1, axis=0), e, np.repeat(e[-1:], lead, axis=0)])
        plain = u + 1.284 * ahead + 0.7 * (ahead - held[lead : lead + 200])
        np.testing.assert_allclose(
            PdIlc(1.284, 0.7, lead_samples=lead).update(u, e), plain, atol=1e-13
        )
        expected = scipy_signal.sosfiltfilt(low_pass.sos, plain, axis=0)
        found = PdIlc(1.284, 0.7, low_pass, lead).update(u, e)
        np.testing.assert_allclose(found, expected, atol=1e-12)
        causal = signal.butterworth(2, 50.0, DT_S, causal=True)
        found = PdIlc(1.284, 0.7, causal, lead).update(u, e)
        np.testing.assert_allclose(
            found, scipy_signal.sosfilt(low_pass.sos, plain, axis=0), atol=1e-12
        )


def test_a_law_can_be_used_for_runs_of_other_lengths_and_again():
    law = PdIlc(1.0, 0.5, signal.butterworth(2, 50.0, DT_S))
    e = np.random.default_rng(1).normal(size=300)
    first = law.update(np.zeros(300), e)
    law.update(np.zeros((100, 3)), np.ones((100, 3)))
    law.reset()
    np.testing.assert_array_equal(law.update(np.zeros(300), e), first)


def test_shapes_of_the_input_are_kept():
    flat, column = np.zeros(50), np.zeros((50, 1))
    for law in (NormOptimalIlc(axis(), 50, rate=3.0), PdIlc(1.0, 0.0)):
        assert law.update(flat, flat).shape == (50,)
        assert law.update(column, column).shape == (50, 1)
        assert law.update(column, flat, disturbance=None).dtype == np.float64


def test_models_of_other_packages_are_accepted():
    ours = axis()
    parts = (ours.a, ours.b, ours.c, ours.d)
    e = np.sin(np.arange(100) / 9.0)
    expected = NormOptimalIlc(ours, 100, rate=3.0).update(np.zeros(100), e)
    for model in (control.ss(*parts, DT_S), scipy_signal.StateSpace(*parts, dt=DT_S)):
        found = NormOptimalIlc(model, 100, rate=3.0).update(np.zeros(100), e)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("name", ["u", "e"])
@pytest.mark.parametrize(
    ("spoil", "error"),
    [
        (lambda x: x[:-1], ValueError),
        (lambda x: np.column_stack([x, x]), ValueError),
        (lambda x: x.reshape(1, -1, 1), ValueError),
        (lambda x: x[:0], ValueError),
        (lambda x: np.where(np.arange(x.size) == 7, np.nan, x), ValueError),
        (lambda x: np.where(np.arange(x.size) == 7, -np.inf, x), ValueError),
        (lambda x: x.astype(np.longdouble), TypeError),
        (lambda x: x.astype(np.complex128), TypeError),
        (lambda x: x.astype(object), TypeError),
        (lambda x: None, TypeError),
    ],
    ids=["short", "wide", "axes", "empty", "nan", "inf", "longdouble", "complex", "object", "none"],
)
@pytest.mark.parametrize("kind", ["pd", "norm_optimal"])
def test_each_bad_array_is_refused_by_name(kind, name, spoil, error):
    law = PdIlc(1.0, 0.0) if kind == "pd" else NormOptimalIlc(axis(), 50, rate=3.0)
    arrays = {"u": np.zeros(50), "e": np.zeros(50)}
    arrays[name] = spoil(arrays[name])
    # For a law without a fixed size, a consistent array makes the other one the wrong one.
    named = "[ue]" if kind == "pd" else name
    with pytest.raises(error, match=rf"^{named} (has|holds)"):
        law.update(**arrays)
    law.update(np.zeros(50), np.zeros(50))


def test_a_law_that_cannot_learn_is_refused_in_a_sentence():
    with pytest.raises(LearningError, match="kp = inf"):
        PdIlc(float("inf"), 0.0)
    with pytest.raises(LearningError, match="rate = -1"):
        NormOptimalIlc(axis(), 50, rate=-1.0)
    with pytest.raises(LearningError, match="n_samples = 0"):
        NormOptimalIlc(axis(), 0)
    with pytest.raises(ModelError, match="needs a discrete model"):
        NormOptimalIlc(second_order(157.0, 0.5), 50)
    outside = from_transfer_function([0.5, -0.65], [1.0, -1.1, 0.3], DT_S)
    with pytest.raises(LearningError, match="zero outside the unit circle"):
        NormOptimalIlc(outside, 300)
    with pytest.raises(LearningError, match="does not determine the input"):
        NormOptimalIlc(StateSpace(0.5, [[1.0, 1.0]], 1.0, [[0.0, 0.0]], DT_S), 300)
    with pytest.raises(SignalError, match="more than 9 are needed"):
        PdIlc(1.0, 0.0, signal.butterworth(2, 50.0, DT_S)).update(np.zeros(9), np.zeros(9))
