"""Norm-optimal ILC with every form of weight and model, against dense NumPy solutions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ilc_rt import (
    LearningError,
    ModelError,
    NormOptimalIlc,
    StateSpace,
    TimeVarying,
    discretize,
    second_order,
)

LONG = np.longdouble
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


def lifted(model):
    """Return the dense lifted system of a time-varying model, from its matrices, in long double."""
    return lifted_of(*(part.astype(LONG) for part in (model.a, model.b, model.c, model.d)))


def lifted_of(a, b, c, d):
    n_samples, n_outputs, n_inputs = d.shape
    matrix = np.zeros((n_samples, n_outputs, n_samples, n_inputs), dtype=LONG)
    for k in range(n_samples):
        matrix[k, :, k, :] = d[k]
        x = b[k]
        for later in range(k + 1, n_samples):
            matrix[later, :, k, :] = c[later] @ x
            x = a[later] @ x
    return matrix.reshape(n_samples * n_outputs, n_samples * n_inputs)


def stacked(weight, n_samples, n_channels):
    """Return a weight as one block-diagonal matrix."""
    weight = np.asarray(weight, dtype=LONG)
    matrix = np.zeros((n_samples, n_channels, n_samples, n_channels), dtype=LONG)
    for k in range(n_samples):
        at = weight[k] if weight.ndim in (1, 3) else weight
        matrix[k, :, k, :] = at if at.ndim == 2 else at * np.eye(n_channels)
    return matrix.reshape(n_samples * n_channels, n_samples * n_channels)


def dense_update(operator, u, e, q=1.0, s=0.0, r=0.0, rate=0.0):
    """Return the solution of the normal equations, formed and solved in long double.

    Their condition number is the square of the problem's, and long double has 11 bits more: so they
    are eliminated in long double too, with two steps of refinement.
    """
    n_samples, n_inputs = u.shape
    q = stacked(q, n_samples, e.shape[1])
    s, r = stacked(s, n_samples, n_inputs), stacked(r, n_samples, n_inputs)
    difference = np.kron(np.diff(np.eye(n_samples), axis=0), np.eye(n_inputs)).astype(LONG)
    p, u_, e_ = operator.astype(LONG), u.ravel().astype(LONG), e.ravel().astype(LONG)
    h = p.T @ q @ p + s + r + LONG(rate) ** 2 * difference.T @ difference
    right = p.T @ (q @ e_) - s @ u_
    lower = cholesky(h)
    change = np.zeros_like(right)
    for _ in range(3):
        change += substitute(lower, right - h @ change)
    return (u_ + change).astype(float).reshape(u.shape)


def cholesky(h):
    """Return the lower Cholesky factor of a matrix of any floating-point type."""
    lower, rest = np.zeros_like(h), h.copy()
    for k in range(len(h)):
        lower[k:, k] = rest[k:, k] / np.sqrt(rest[k, k])
        rest[k:, k:] -= np.outer(lower[k:, k], lower[k:, k])
    return lower


def substitute(lower, right):
    """Return the solution of ``lower lower' x = right``."""
    x = right.copy()
    for k in range(len(x)):
        x[k] = (x[k] - lower[k, :k] @ x[:k]) / lower[k, k]
    for k in reversed(range(len(x))):
        x[k] = (x[k] - lower[k + 1 :, k] @ x[k + 1 :]) / lower[k, k]
    return x


def weight(rng, kind, n_samples, n_channels):
    """Return a weight of one of the four forms, positive definite."""
    if kind == "number":
        return 0.4
    if kind == "samples":
        return rng.uniform(0.05, 2.0, n_samples)
    root = rng.normal(size=(n_samples, n_channels, n_channels))
    blocks = root @ root.transpose(0, 2, 1) + 0.05 * np.eye(n_channels)
    return blocks if kind == "blocks" else blocks[0]


KINDS = st.sampled_from(["number", "samples", "block", "blocks"])


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 6), st.integers(1, 3), st.integers(1, 3)),
    st.integers(1, 25),
    st.tuples(KINDS, KINDS, KINDS),
    st.sampled_from([0.0, 0.3]),
    st.booleans(),
)
def test_any_weights_and_models_give_the_minimiser(seed, sizes, n_samples, kinds, rate, varies):
    n_states, n_inputs, n_outputs = sizes
    rng = np.random.default_rng(seed)
    count = n_samples if varies else 1
    parts = (
        rng.normal(size=(count, n_states, n_states)) * 0.8 / np.sqrt(n_states),
        rng.normal(size=(count, n_states, n_inputs)),
        rng.normal(size=(count, n_outputs, n_states)),
        rng.normal(size=(count, n_outputs, n_inputs)) * (seed % 2),
    )
    if varies:
        model = varying = TimeVarying(*parts, DT_S)
    else:
        model = StateSpace(*(part[0] for part in parts), DT_S)
        varying = repeated(model, n_samples)
    q = weight(rng, kinds[0], n_samples, n_outputs)
    s, r = weight(rng, kinds[1], n_samples, n_inputs), weight(rng, kinds[2], n_samples, n_inputs)
    u, e = rng.normal(size=(n_samples, n_inputs)), rng.normal(size=(n_samples, n_outputs))
    found = NormOptimalIlc(model, n_samples, q=q, s=s, r=r, rate=rate).update(u, e)
    exact = [part.astype(LONG) for part in (varying.a, varying.b, varying.c, varying.d)]
    expected = dense_update(lifted_of(*exact), u, e, q, s, r, rate)
    # Effect of the matrices' rounding on the minimiser: an axis that is unstable over the run loses
    # digits that no double-precision solver can recover.
    eps = np.finfo(float).eps
    moved = 0.0
    for _ in range(3):
        near = [part * (1 + eps * rng.uniform(-1, 1, part.shape)) for part in exact]
        apart = dense_update(lifted_of(*near), u, e, q, s, r, rate) - expected
        moved = max(moved, abs(apart).max())
    allowed = 1e-11 * abs(expected).max() + 100 * moved
    np.testing.assert_allclose(found, expected, rtol=0, atol=allowed)
    assert moved < 1e-6 * abs(expected).max(), "a problem that says nothing"


def test_axes_of_different_delay_coupled_by_a_weight():
    model = axis(94.0, 1.0).append(axis(94.0, 0.6).delayed(3))
    n_samples = 100
    angle = np.linspace(0.0, 3.0, n_samples)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    q = normal[:, :, None] * normal[:, None, :] + 0.01 * np.eye(2)
    rng = np.random.default_rng(1)
    u, e = rng.normal(size=(n_samples, 2)), rng.normal(size=(n_samples, 2))
    found = NormOptimalIlc(model, n_samples, q=q, r=1e-3, rate=1.0).update(u, e)
    expected = dense_update(lifted(repeated(model, n_samples)), u, e, q, 0.0, 1e-3, 1.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * abs(expected).max())


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
    expected = (lifted(model) @ u.ravel()).reshape(30, 1)
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


def test_a_block_that_is_no_weight_is_refused():
    two = axis().append(axis())
    with pytest.raises(LearningError, match=r"^q at sample 0: .* symmetric"):
        NormOptimalIlc(two, 50, q=[[1.0, 0.5], [0.0, 1.0]])
    blocks = np.repeat(np.eye(2)[None], 50, axis=0)
    blocks[3] = [[1.0, 2.0], [2.0, 1.0]]
    with pytest.raises(LearningError, match=r"^q at sample 3: .* semidefinite"):
        NormOptimalIlc(two, 50, q=blocks)
    with pytest.raises(LearningError, match=r"^rate = nan|^rate = NaN"):
        NormOptimalIlc(two, 50, rate=float("nan"))
    weights = np.ones(50)
    weights[20:30] = 0.0
    with pytest.raises(LearningError, match="does not determine the input at sample 28"):
        NormOptimalIlc(repeated(axis(), 50), 50, q=weights)


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
