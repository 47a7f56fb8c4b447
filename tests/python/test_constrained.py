"""Norm-optimal ILC within bounds, against SciPy's solvers and its own guarantees."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from ilc_rt import (
    ConstrainedIlc,
    LearningError,
    NormOptimalIlc,
    discretize,
    second_order,
)

DT_S = 0.002


def axis():
    """Return the closed position loop of one axis."""
    return discretize(second_order(157.0, 0.5), DT_S)


def problem(n_samples):
    """Return a reference in metres and an error to learn from."""
    k = np.arange(n_samples)
    return 0.02 * (1.0 - np.cos(k / 9.0)), 3e-3 * np.sin(k / 9.0)


def stacked(model, n_samples, u, e, q, s, r, rate):
    """Return M, t with cost = |M v - t|^2, of one axis."""
    eye = np.eye(n_samples)
    difference = np.diff(eye, axis=0)
    rows = [
        np.sqrt(q) * model.lifted(n_samples),
        np.sqrt(s) * eye,
        np.sqrt(r) * eye,
        rate * difference,
    ]
    targets = [np.sqrt(q) * e, -np.sqrt(s) * u, 0.0 * u, np.zeros(n_samples - 1)]
    return np.vstack(rows), np.concatenate(targets)


@pytest.mark.parametrize(("q", "s", "r", "rate"), [(1.0, 0.0, 1e-2, 3.0), (2.0, 1e-2, 1e-3, 0.0)])
def test_a_bounded_input_agrees_with_scipys_least_squares(q, s, r, rate):
    n_samples = 60
    _, e = problem(n_samples)
    u = 1e-3 * np.cos(np.arange(n_samples))
    free = NormOptimalIlc(axis(), n_samples, q=q, s=s, r=r, rate=rate).update(u, e)
    limit = 0.6 * np.abs(free).max()
    law = ConstrainedIlc(axis(), n_samples, q=q, s=s, r=r, rate=rate, input_max=(-limit, limit))
    found = law.update(u, e)
    assert law.status == "solved"
    assert law.iterations > 0
    matrix, target = stacked(axis(), n_samples, u, e, q, s, r, rate)
    # bvls finds the active set: exact, like a direct solution.
    best = lsq_linear(matrix, target, (-limit - u, limit - u), method="bvls", tol=1e-15)
    expected = u + best.x
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()
    cost = np.sum((matrix @ (found - u) - target) ** 2)
    assert cost <= 2.0 * best.cost * (1.0 + 1e-8)
    assert np.count_nonzero(np.abs(np.abs(found) - limit) < 1e-9 * limit) > 3


def test_bounds_that_are_not_reached_change_nothing():
    n_samples = 200
    r, e = problem(n_samples)
    free = NormOptimalIlc(axis(), n_samples, rate=3.0).update(np.zeros(n_samples), e)
    law = ConstrainedIlc(axis(), n_samples, rate=3.0, input_max=(-1.0, 1.0), reference=r)
    found = law.update(np.zeros(n_samples), e)
    assert (law.status, law.iterations, law.gap) == ("solved", 0, 0.0)
    assert np.abs(found - free).max() < 1e-8 * np.abs(free).max()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 120))
def test_no_bound_is_exceeded_over_several_runs(seed, n_samples):
    rng = np.random.default_rng(seed)
    model = axis().append(axis())
    r = np.cumsum(rng.normal(size=(n_samples, 2)), axis=0) * 1e-3
    limit = np.array([[rng.uniform(1e-4, 1e-2), np.inf]])
    step = rng.uniform(1e-4, 1e-2)
    rise = np.abs(np.diff(r, axis=0, prepend=r[:1])).max() / DT_S + step
    bend = 2.5 * rise / DT_S
    reach = np.abs(r).max() + 0.5 * limit
    law = ConstrainedIlc(
        model,
        n_samples,
        rate=rng.uniform(0.1, 3.0),
        input_max=(-limit, limit),
        change_max=(-2.0 * step, 2.0 * step),
        step_max=(-step, step),
        position_bounds=(-reach, reach),
        velocity_bounds=(-rise, rise),
        acceleration_bounds=(-bend, bend),
        reference=r,
    )
    u = np.zeros((n_samples, 2))
    for _ in range(4):
        e = r - model.simulate(r + u) + 1e-5 * rng.normal(size=r.shape)
        last, u = u, law.update(u, e)
        assert law.status == "solved", law.message
        assert np.all(np.abs(u) <= limit)
        assert np.abs(u - last).max() <= 2.0 * step * (1.0 + 1e-9)
        assert np.all(np.abs(r + u) <= reach * (1.0 + 1e-9))
        moves = np.diff(r + u, axis=0, prepend=r[:1])
        still = np.diff(moves, axis=0, prepend=np.zeros((1, 2)))
        assert np.abs(still).max() <= bend * DT_S**2 * (1.0 + 1e-9)
        before = np.vstack([[0.0, 0.0], u[:-1]])
        assert np.abs(u - before).max() <= step * (1.0 + 1e-9)
        assert np.abs(moves).max() <= rise * DT_S * (1.0 + 1e-9)


def test_what_cannot_be_honoured_keeps_the_input_and_says_so():
    u = np.zeros(9)
    u[3] = 0.5
    law = ConstrainedIlc(axis(), 9, rate=3.0, input_max=(-0.1, 0.1), change_max=(-0.01, 0.01))
    assert law.status == "untried"
    assert np.array_equal(law.update(u, np.ones(9)), u)
    assert law.status == "infeasible"
    assert "at sample 3, channel 0" in law.message
    r, e = problem(30)
    law = ConstrainedIlc(
        axis(), 30, rate=3.0, input_max=(-0.1, 0.1), output_bounds=(5.0, 6.0), reference=r
    )
    assert np.array_equal(law.update(np.zeros(30), e), np.zeros(30))
    assert law.status == "max_iterations"


def test_a_second_search_starts_from_the_first_and_a_reset_forgets_it():
    _, e = problem(200)
    law = ConstrainedIlc(axis(), 200, rate=3.0, input_max=(-1e-3, 1e-3))
    first = law.update(np.zeros(200), e)
    cold = law.iterations
    again = law.update(np.zeros(200), e)
    assert law.iterations <= cold
    assert np.abs(again - first).max() < 1e-9
    law.reset()
    assert np.array_equal(law.update(np.zeros(200), e), first)


@pytest.mark.parametrize(
    ("name", "value", "error", "words"),
    [
        ("input_max", "1", TypeError, "a pair"),
        ("input_max", (1.0,), ValueError, "1 sides"),
        ("input_max", (np.nan, 1.0), ValueError, r"input_max\[0\] holds NaN"),
        ("change_max", (None, np.zeros(8)), ValueError, r"change_max\[1\] has shape \(8,\)"),
        ("step_max", (np.zeros((9, 2)), None), ValueError, r"step_max\[0\] has shape"),
        ("step_max", ("a", None), (TypeError, ValueError), r"step_max\[0\]"),
        ("reference", np.zeros(8), ValueError, "reference has shape"),
        ("reference", np.full(9, np.inf), ValueError, "reference holds inf"),
        ("position_bounds", (0.0, 1.0), LearningError, "position bound needs the reference"),
        ("velocity_bounds", (0.0, 1.0), LearningError, "velocity bound needs the reference"),
        (
            "acceleration_bounds",
            (0.0, 1.0),
            LearningError,
            "acceleration bound needs the reference",
        ),
        ("output_bounds", (0.0, 1.0), LearningError, "output bound needs the reference"),
        ("input_max", (1.0, -1.0), LearningError, "lower input bound 1 lies above"),
        ("change_max", (np.inf, np.inf), LearningError, "lower change bound is inf"),
        ("q", np.ones(8), ValueError, "q has shape"),
        ("r", -1.0, LearningError, "r = -1"),
        ("rate", -1.0, LearningError, "rate = -1"),
    ],
)
def test_wrong_arguments_are_refused_one_at_a_time(name, value, error, words):
    with pytest.raises(error, match=words):
        ConstrainedIlc(axis(), 9, **({"rate": 3.0} | {name: value}))


def test_bounds_that_exclude_each_other_are_refused_with_the_sample():
    r = np.linspace(0.0, 0.08, 9)
    with pytest.raises(LearningError, match=r"input and position bounds leave no value.* sample 6"):
        ConstrainedIlc(
            axis(),
            9,
            rate=3.0,
            input_max=(-0.005, 0.005),
            position_bounds=(0.0, 0.051),
            reference=r,
        )
    low = np.full(9, -1.0)
    low[1] = 0.3
    with pytest.raises(LearningError, match="at sample 1, channel 0"):
        ConstrainedIlc(axis(), 9, rate=3.0, input_max=(low, 1.0), step_max=(-0.1, 0.1))
