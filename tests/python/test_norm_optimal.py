"""Norm-optimal ILC with every form of weight and model, against dense NumPy solutions."""

import control
import numpy as np
import pytest
from scipy import signal as scipy_signal

from ilc_rt import (
    ModelError,
    NormOptimalIlc,
    PdIlc,
    StateSpace,
    TimeVarying,
    discretize,
    second_order,
    signal,
)

DT_S = 0.002


def axis(w0=157.0, damping=0.5):
    """Return the closed position loop of one axis."""
    return discretize(second_order(w0, damping), DT_S)


def repeated(model, n_samples):
    """Return a model with the same matrices at every sample."""
    parts = (
        np.repeat(part[None], n_samples, axis=0) for part in (model.a, model.b, model.c, model.d)
    )
    return TimeVarying(*parts, DT_S)


def lifted(a, b, c, d):
    """Return the dense lifted system of a time-varying model, from its matrices."""
    n_samples, n_outputs, n_inputs = d.shape
    matrix = np.zeros((n_samples, n_outputs, n_samples, n_inputs))
    for k in range(n_samples):
        matrix[k, :, k, :] = d[k]
        x = b[k]
        for later in range(k + 1, n_samples):
            matrix[later, :, k, :] = c[later] @ x
            x = a[later] @ x
    return matrix.reshape(n_samples * n_outputs, n_samples * n_inputs)


def block_diagonal(weight, n_samples, n_channels):
    """Return a weight of any form as one block-diagonal matrix."""
    weight = np.asarray(weight, float)
    matrix = np.zeros((n_samples, n_channels, n_samples, n_channels))
    for k in range(n_samples):
        at = weight[k] if weight.ndim in (1, 3) else weight
        matrix[k, :, k, :] = at if at.ndim == 2 else at * np.eye(n_channels)
    return matrix.reshape(n_samples * n_channels, n_samples * n_channels)


def weight(rng, form, n_samples, n_channels):
    """Return a weight of one of the four forms, positive definite."""
    root = rng.normal(size=(n_samples, n_channels, n_channels))
    blocks = root @ root.transpose(0, 2, 1) + 0.05 * np.eye(n_channels)
    samples = rng.uniform(0.05, 2.0, n_samples)
    return {"number": 0.4, "samples": samples, "block": blocks[0], "blocks": blocks}[form]


@pytest.mark.parametrize("varies", [False, True])
@pytest.mark.parametrize(
    "forms",
    [
        ("number", "samples", "block"),
        ("samples", "block", "blocks"),
        ("block", "blocks", "number"),
        ("blocks", "number", "samples"),
    ],
)
def test_weights_of_every_form_give_the_minimiser(forms, varies):
    rng = np.random.default_rng(3)
    n_samples, n_inputs, n_outputs, rate = 20, 2, 3, 0.3
    shapes = [(4, 4), (4, n_inputs), (n_outputs, 4), (n_outputs, n_inputs)]
    parts = [0.4 * rng.normal(size=(n_samples if varies else 1, *shape)) for shape in shapes]
    model = TimeVarying(*parts, DT_S) if varies else StateSpace(*(x[0] for x in parts), DT_S)
    q = weight(rng, forms[0], n_samples, n_outputs)
    s, r = (weight(rng, form, n_samples, n_inputs) for form in forms[1:])
    u, e = rng.normal(size=(n_samples, n_inputs)), rng.normal(size=(n_samples, n_outputs))
    found = NormOptimalIlc(model, n_samples, q=q, s=s, r=r, rate=rate).update(u, e)
    p = lifted(*(x if varies else np.repeat(x, n_samples, axis=0) for x in parts))
    weigh = block_diagonal(q, n_samples, n_outputs)
    effort, change = (block_diagonal(w, n_samples, n_inputs) for w in (s, r))
    steps = rate * np.kron(np.diff(np.eye(n_samples), axis=0), np.eye(n_inputs))
    hessian = p.T @ weigh @ p + effort + change + steps.T @ steps
    moved = np.linalg.solve(hessian, p.T @ weigh @ e.ravel() - effort @ u.ravel())
    np.testing.assert_allclose(found, u + moved.reshape(u.shape), atol=1e-11)


def test_convex_optimisation_law_as_printed():
    # Input 0 .. N-2 against error 1 .. N-1, H = P'P + d^2 D'D, f = -P'e.
    n_samples, d = 300, 3.0
    model = axis()
    operator = model.lifted(n_samples)[1:, :-1]
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


def test_models_of_other_packages_are_accepted():
    ours = axis()
    parts = (ours.a, ours.b, ours.c, ours.d)
    e = np.sin(np.arange(100) / 9.0)
    expected = NormOptimalIlc(ours, 100, rate=3.0).update(np.zeros(100), e)
    for model in (control.ss(*parts, DT_S), scipy_signal.StateSpace(*parts, dt=DT_S)):
        found = NormOptimalIlc(model, 100, rate=3.0).update(np.zeros(100), e)
        np.testing.assert_array_equal(found, expected)


def test_the_same_problem_in_every_form_is_the_same():
    n_samples = 400
    model = axis()
    e = np.sin(np.arange(n_samples) / 9.0)
    expected = NormOptimalIlc(model, n_samples, q=2.0, r=0.1).update(np.zeros(n_samples), e)
    for law in (
        NormOptimalIlc(model, n_samples, q=np.full(n_samples, 2.0), r=0.1),
        NormOptimalIlc(model, n_samples, q=[[2.0]], r=np.full((n_samples, 1, 1), 0.1)),
        NormOptimalIlc(repeated(model, n_samples), n_samples, q=2.0, r=0.1),
    ):
        found = law.update(np.zeros(n_samples), e)
        np.testing.assert_allclose(found, expected, atol=1e-13)


def test_a_long_run_is_the_same_as_its_pieces_far_from_their_ends():
    n_samples = 60_000
    e = np.sin(np.arange(n_samples) / 50.0)
    long = NormOptimalIlc(axis(), n_samples, r=0.01).update(np.zeros(n_samples), e)
    start = NormOptimalIlc(axis(), 2_000, r=0.01).update(np.zeros(2_000), e[:2_000])
    np.testing.assert_allclose(long[:1_500], start[:1_500], atol=1e-14)
    again = NormOptimalIlc(axis(), n_samples, r=0.01).update(np.zeros(n_samples), e)
    np.testing.assert_array_equal(long, again)


def test_weights_come_back_as_they_were_given():
    q, r = np.linspace(1.0, 2.0, 20), np.full((20, 1, 1), 0.5)
    law = NormOptimalIlc(axis(), 20, q=q, s=[[0.25]], r=r, rate=3.0)
    np.testing.assert_array_equal(law.q, q)
    np.testing.assert_array_equal(law.s, [[0.25]])
    np.testing.assert_array_equal(law.r, r)
    assert (law.rate, law.n_samples) == (3.0, 20)
    assert NormOptimalIlc(axis(), 20).q == 1.0
    assert 0.0 < law.conditioning <= 1.0
    assert NormOptimalIlc(axis(), 20, r=1e-9).conditioning < law.conditioning


def test_a_varying_model_simulates_its_equation():
    rng = np.random.default_rng(5)
    shapes = [(30, 3, 3), (30, 3, 2), (30, 1, 3), (30, 1, 2)]
    model = TimeVarying(*(rng.normal(size=shape) * 0.4 for shape in shapes), DT_S)
    u = rng.normal(size=(30, 2))
    expected = (lifted(model.a, model.b, model.c, model.d) @ u.ravel()).reshape(30, 1)
    np.testing.assert_allclose(model.simulate(u), expected, atol=1e-12)
    assert model.simulate(u).shape == (30, 1)
    assert (model.n_samples, model.n_states, model.n_inputs, model.n_outputs) == (30, 3, 2, 1)
    assert model.a.shape == (30, 3, 3)
    assert model.dt_s == DT_S
    assert repr(model).startswith("TimeVarying(n_samples=30, n_states=3")


@pytest.mark.parametrize("name", ["q", "s", "r"])
@pytest.mark.parametrize(
    ("bad", "error"),
    [
        (np.ones(49), ValueError),
        (np.ones((50, 1)), ValueError),
        (np.ones((2, 2)), ValueError),
        (np.ones((50, 2, 2)), ValueError),
        (np.ones((49, 1, 1)), ValueError),
        (np.where(np.arange(50) == 7, np.nan, 1.0), ValueError),
        (np.where(np.arange(50) == 7, np.inf, 1.0), ValueError),
        (np.where(np.arange(50) == 7, -1.0, 1.0), ValueError),
        (-1.0, ValueError),
        (float("nan"), ValueError),
        (np.full((50, 1, 1), -1.0), ValueError),
        (np.ones(50, dtype=np.longdouble), TypeError),
        (np.ones(50, dtype=np.complex128), TypeError),
        ("one", TypeError),
    ],
    ids=[
        "short", "flat", "wide", "blocks", "few", "nan", "inf", "negative", "minus", "not",
        "indefinite", "longdouble", "complex", "text",
    ],
)  # fmt: skip
def test_each_bad_weight_is_refused_by_name(name, bad, error):
    with pytest.raises(error, match=rf"^{name} "):
        NormOptimalIlc(axis(), 50, **{"rate": 1.0, name: bad})


@pytest.mark.parametrize("name", ["a", "b", "c", "d"])
@pytest.mark.parametrize(
    ("spoil", "error"),
    [
        (lambda x: x[:-1], ValueError),
        (lambda x: x[0], ValueError),
        (lambda x: np.concatenate([x, x], axis=1), ValueError),
        (lambda x: x * np.nan, ValueError),
        (lambda x: x.astype(np.longdouble), TypeError),
    ],
    ids=["short", "axes", "rows", "nan", "longdouble"],
)
def test_each_bad_matrix_is_refused_by_name(name, spoil, error):
    model = repeated(axis(), 5)
    parts = {part: getattr(model, part) for part in "abcd"}
    parts[name] = spoil(parts[name])
    # If one matrix is consistent, those that depend on it are the wrong ones.
    with pytest.raises(error, match=r"^[abcd] (has|holds)"):
        TimeVarying(**parts, dt_s=DT_S)


def test_a_varying_model_of_another_run_is_refused():
    with pytest.raises(ModelError, match="5 values; one for each of the 6 samples"):
        NormOptimalIlc(repeated(axis(), 5), 6)
    with pytest.raises(ModelError, match="dt_s = 0"):
        TimeVarying(*(np.ones((5, 1, 1)) for _ in range(4)), 0.0)
    with pytest.raises(ModelError, match="0 values"):
        TimeVarying(*(np.ones((0, 1, 1)) for _ in range(4)), DT_S)
    with pytest.raises(ValueError, match=r"^u has"):
        repeated(axis(), 5).simulate(np.ones(4))
