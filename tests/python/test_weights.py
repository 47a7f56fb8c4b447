"""Weights from their meaning, and the laws that use them, against the printed equations."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

from ilc_rt import (
    LearningError,
    ModelError,
    NormOptimalIlc,
    SignalError,
    StateSpace,
    analyze,
    discretize,
    from_transfer_function,
    second_order,
    simulate,
    weights,
)

GOLDEN = Path(__file__).parents[1] / "golden" / "barton2010_appendix_i.json"
DT_S = 0.002
N = 30
RNG = np.random.default_rng(7)


def path(n_samples, n_axes):
    return np.cumsum(RNG.normal(size=(n_samples, n_axes)), axis=0)


def lifted_blocks(blocks):
    n, rows, cols = blocks.shape
    lifted = np.zeros((n * rows, n * cols))
    for k, block in enumerate(blocks):
        lifted[k * rows : (k + 1) * rows, k * cols : (k + 1) * cols] = block
    return lifted


def dense_update(operator, q, s, r, u, e):
    """Update by the normal equations of the lifted problem (Barton 5.8)."""
    h = operator.T @ q @ operator
    effort = np.eye(len(h))
    right = operator.T @ q @ e.ravel() - s * u.ravel()
    change = np.linalg.solve(h + (s + r) * effort, right)
    return u + change.reshape(u.shape)


def two_axes():
    fast = discretize(second_order(157.0, 0.5), DT_S)
    slow = discretize(second_order(60.0, 0.8), DT_S).delayed(1)
    return fast.append(slow)


def test_contour_weights_are_the_printed_ones():
    reference = path(N, 2)
    contour = RNG.uniform(0.0, 50.0, N)
    found = weights.contour(reference, q=0.5, contour=contour, along=0.1)
    for k in range(1, N - 1):
        dx, dy = reference[k + 1] - reference[k - 1]
        theta = np.arctan2(dy, dx)
        c = np.array([-np.sin(theta), np.cos(theta)])
        t = np.array([np.cos(theta), np.sin(theta)])
        expected = 0.5 * np.eye(2) + contour[k] * np.outer(c, c) + 0.1 * np.outer(t, t)
        np.testing.assert_allclose(found[k], expected, atol=1e-10)


def test_shares_are_the_printed_product():
    coupling = RNG.normal(size=(N, 2, 3))
    sigma, gamma = RNG.uniform(0.0, 30.0, N), RNG.uniform(0.0, 1.0, N)
    found = weights.coupled(coupling, sigma=sigma, gamma=gamma)
    for k, c in enumerate(coupling):
        expected = sigma[k] * (gamma[k] * np.eye(3) + (1.0 - gamma[k]) * c.T @ c)
        np.testing.assert_allclose(found[k], expected, atol=1e-10)


def test_a_schedule_is_smooth_where_it_switches():
    steps = weights.schedule([(0, 1.0), (100, 30.0), (140, 1.0)], 300)
    assert steps[[0, 99, 100, 139, 140, 299]].tolist() == [1.0, 1.0, 30.0, 30.0, 1.0, 1.0]
    smooth = weights.schedule([(0, 1.0), (100, 30.0), (140, 1.0)], 300, 15.0, DT_S)
    sigma = np.sqrt(np.log(2.0)) / (2.0 * np.pi * 15.0 * DT_S)
    reach = np.arange(-40, 41)
    bell = np.exp(-0.5 * (reach / sigma) ** 2)
    expected = np.convolve(np.pad(steps, 40, mode="symmetric"), bell / bell.sum(), mode="valid")
    np.testing.assert_allclose(smooth, expected, atol=30.0 * 1e-3)
    assert smooth.min() >= 1.0
    assert smooth.max() <= 30.0


def test_formation_weights_are_the_printed_product():
    tracking, own = RNG.uniform(size=(N, 1)), RNG.uniform(size=(N, 1))
    centre, sigma = RNG.uniform(size=(N, 1)), RNG.uniform(0.0, 5.0, size=(N, 1))
    half = RNG.normal(size=(2, 2))
    block = half.T @ half
    found = weights.formation(
        3, 2, N, tracking=tracking, own=own, centre=centre, sigma=sigma, weight=block
    )
    shape = np.array(
        [
            [-1, 0, 1, 0, 0, 0],
            [0, 0, -1, 0, 1, 0],
            [-1, 0, 0, 0, 1, 0],
            [0, -1, 0, 1, 0, 0],
            [0, 0, 0, -1, 0, 1],
            [0, -1, 0, 0, 0, 1],
        ]
    )
    mean = np.hstack([np.eye(2)] * 3) / 3.0
    for k in range(N):
        alone = own[k] * np.kron(np.eye(3), block) + centre[k] * mean.T @ block @ mean
        expected = sigma[k] * (tracking[k] * alone + (1.0 - tracking[k]) * shape.T @ shape)
        np.testing.assert_allclose(found[k], expected, atol=1e-10)
    e = RNG.normal(size=(N, 6))
    np.testing.assert_allclose(weights.formation_errors(e, 3), e @ shape.T, atol=1e-14)


def test_gains_may_differ_from_agent_to_agent():
    found = weights.formation(2, 1, 2, tracking=0.0, sigma=[4.0, 1.0])
    np.testing.assert_allclose(found[1], [[2.0, -2.0], [-2.0, 2.0]])
    found = weights.formation(2, 1, 2, sigma=[[4.0, 1.0], [0.0, 3.0]])
    np.testing.assert_allclose(found, [np.diag([4.0, 1.0]), np.diag([0.0, 3.0])])
    led = weights.formation(3, 1, 2, leaders=[1])
    np.testing.assert_allclose(led[0], np.diag([0.0, 1.0, 0.0]))


def test_the_contour_law_is_the_dense_solution():
    model, reference = two_axes(), path(N, 2)
    u, e = RNG.normal(size=(2, N, 2))
    law = NormOptimalIlc.contour(model, reference, q=1.0, contour=30.0, s=1e-3, r=0.1)
    q = lifted_blocks(weights.contour(reference, q=1.0, contour=30.0))
    expected = dense_update(model.lifted(N), q, 1e-3, 0.1, u, e)
    np.testing.assert_allclose(law.update(u, e), expected, atol=1e-10)
    same = NormOptimalIlc(model, N, weights.contour(reference, contour=30.0), s=1e-3, r=0.1)
    np.testing.assert_array_equal(same.update(u, e), law.update(u, e))


def test_the_formation_law_is_the_dense_solution():
    agents = [two_axes(), two_axes(), two_axes().delayed(1)]
    u, e = RNG.normal(size=(2, N, 6))
    law = NormOptimalIlc.formation(agents, N, tracking=0.3, centre=0.5, own=0.5, s=1e-3, r=0.1)
    q = lifted_blocks(weights.formation(3, 2, N, tracking=0.3, centre=0.5, own=0.5))
    whole = agents[0].append(agents[1]).append(agents[2])
    expected = dense_update(whole.lifted(N), q, 1e-3, 0.1, u, e)
    np.testing.assert_allclose(law.update(u, e), expected, atol=1e-10)


def test_the_dynamic_law_is_the_dense_solution():
    model = two_axes()
    u, e = RNG.normal(size=(2, N, 2))
    fast = from_transfer_function([3.0, -2.4], [1.0, -0.4], DT_S)
    fast = fast.series(from_transfer_function([0.3297], [1.0, -0.6703], DT_S))
    slow = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]], DT_S)
    both = fast.append(slow)
    sum_up = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[1.0, 1.0]], DT_S)
    theta = RNG.uniform(-3.0, 3.0, N)
    coupling = np.zeros((N, 2, 2))
    coupling[:, 0, 0], coupling[:, 1, 1] = -np.sin(theta), np.cos(theta)
    contour = both.series(sum_up)
    law = NormOptimalIlc.dynamic(
        model, N, contour, q=5.0, plain=0.2, coupling=coupling, s=1e-3, r=0.1
    )
    seen = contour.lifted(N) @ lifted_blocks(coupling)
    q = 5.0 * seen.T @ seen + 0.2 * np.eye(2 * N)
    expected = dense_update(model.lifted(N), q, 1e-3, 0.1, u, e)
    np.testing.assert_allclose(law.update(u, e), expected, atol=1e-10)


@pytest.mark.parametrize("n", [1, 2, 17, 60])
@pytest.mark.parametrize("axes", [1, 2])
def test_weights_of_filtered_input_and_change_are_the_dense_solution(n, axes):
    """Filters designed by SciPy, lifted by their impulse responses."""
    model = two_axes() if axes == 2 else discretize(second_order(157.0, 0.5), DT_S)
    u, e = RNG.normal(size=(2, n, axes))

    def lifted(order, cutoff_hz, kind):
        b, a = scipy.signal.butter(order, cutoff_hz, kind, fs=1.0 / DT_S)
        impulse = scipy.signal.lfilter(b, a, np.eye(1, n)[0])
        return np.kron(scipy.linalg.toeplitz(impulse, np.zeros(n)), np.eye(axes))

    f_e, f_u, f_v = lifted(2, 60.0, "low"), lifted(3, 80.0, "high"), lifted(2, 30.0, "high")
    along = RNG.uniform(0.1, 2.0, n)
    law = NormOptimalIlc.dynamic(
        model, n, weights.low_pass(2, 60.0, DT_S, axes), q=3.0, plain=0.5, s=1e-3, r=1e-2,
        input_filter=weights.high_pass(3, 80.0, DT_S, axes), input_weight=along,
        change_filter=weights.high_pass(2, 30.0, DT_S, axes), change_weight=0.7,
    )  # fmt: skip
    p, eye = model.lifted(n), np.eye(n * axes)
    q = 3.0 * f_e.T @ f_e + 0.5 * eye
    held = f_u.T @ np.diag(np.repeat(along, axes)) @ f_u + 1e-3 * eye
    h = p.T @ q @ p + held + 0.7 * f_v.T @ f_v + 1e-2 * eye
    change = np.linalg.solve(h, p.T @ q @ e.ravel() - held @ u.ravel())
    shape = (n,) if axes == 1 else (n, axes)
    found = law.update(u.reshape(shape), e.reshape(shape))
    np.testing.assert_allclose(found.ravel(), u.ravel() + change, atol=1e-9)


def test_a_high_pass_weight_keeps_the_input_free_of_high_frequencies():
    """The plant has a mode that the model does not: excited by the plain law, left alone."""
    model = discretize(second_order(2 * np.pi * 25.0, 0.7), DT_S)
    w = 2 * np.pi * 110.0
    mode = discretize(from_transfer_function([-0.4 * w**2], [1.0, 0.02 * w, w**2]), DT_S)
    both = model.append(mode)
    one = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((2, 0)), np.ones((2, 1)), DT_S)
    total = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.ones((1, 2)), DT_S)
    plant = one.series(both).series(total)
    n = 400
    reference = 0.01 * np.hanning(n)
    high_pass = weights.high_pass(4, 50.0, DT_S)
    shaped = NormOptimalIlc.dynamic(model, n, input_filter=high_pass, input_weight=4.0, r=0.01)
    plain = NormOptimalIlc(model, n, r=0.01)
    analysed, refused = analyze(shaped, plant), analyze(plain, plant)
    assert analysed.converges
    assert analysed.monotonic_factor < refused.monotonic_factor
    assert not refused.monotonic
    result = simulate(plant, shaped, reference, trials=12)
    rms = result.figures()["tracking_rms_m"]
    assert rms[-1] < 0.02 * rms[0]
    learned = np.abs(np.fft.rfft(result.input[-1, :, 0]))
    at_hz = np.fft.rfftfreq(n, DT_S)
    assert learned[at_hz > 90.0].max() < 1e-3 * learned.max()


def test_the_printed_tables_come_out_from_python_too():
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    feedback = StateSpace(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[golden["controller_gain"]]], 1.0
    )
    axes = [
        discretize(from_transfer_function([1.0], [mass, damping, 0.0]), 1.0).feedback(feedback)
        for mass, damping in zip(golden["mass"], golden["damping"], strict=True)
    ]
    agents = [x.append(y) for x, y in zip(axes[::2], axes[1::2], strict=True)]
    law = NormOptimalIlc.formation(agents, 5, s=golden["s"], r=golden["r"])
    whole = agents[0].append(agents[1]).append(agents[2])
    reference = np.tile(np.column_stack([golden["reference_x"], golden["reference_y"]]), 3)
    u = np.zeros((5, 6))
    for _ in range(golden["updates"]):
        u = law.update(u, reference - whole.simulate(u))
    error = reference - whole.simulate(u)
    names = ["x1", "y1", "x2", "y2", "x3", "y3"]
    for found, printed in ((u, golden["input"]), (error, golden["error"])):
        expected = np.column_stack([printed[name] for name in names])
        np.testing.assert_allclose(found, expected, atol=0.51e-4)


@pytest.mark.parametrize(
    ("call", "kind", "word"),
    [
        (lambda: weights.contour(np.ones((5, 2))), LearningError, "never moves"),
        (lambda: weights.contour(np.arange(5.0)), LearningError, "reference"),
        (lambda: weights.contour(np.full((5, 2), np.nan)), ValueError, "reference"),
        (lambda: weights.contour(path(5, 2), q=np.ones((3, 3))), ValueError, "q has shape"),
        (lambda: weights.contour(path(5, 2), contour=-1.0), LearningError, "contour"),
        (lambda: weights.contour(path(5, 2), along=np.ones(4)), ValueError, "along has shape"),
        (lambda: weights.contour(path(5, 2), contour=np.ones((5, 1))), ValueError, "contour"),
        (lambda: weights.contour(path(5, 2), axes=[0, 2]), LearningError, "axis 2"),
        (lambda: weights.contour(path(5, 2), q="one"), TypeError, "q has dtype"),
        (lambda: weights.coupled(np.ones((4, 1, 2)), gamma=1.5), LearningError, "gamma"),
        (lambda: weights.coupled(np.ones((4, 1, 2)), sigma=np.ones(3)), ValueError, "sigma has"),
        (lambda: weights.coupled(np.ones(4)), ValueError, "coupling has shape"),
        (lambda: weights.schedule([], 5), LearningError, "no segments"),
        (lambda: weights.schedule([(0, 1.0)], 2**31), LearningError, "at most 10000000"),
        (lambda: weights.formation(2, 1, 2**31), LearningError, "at most 25000000"),
        (lambda: weights.schedule([(1, 2.0)], 5), LearningError, "starts at 1"),
        (lambda: weights.schedule([(0, 2.0), (9, 1.0)], 5), LearningError, "5 samples"),
        (lambda: weights.schedule([(0, 2.0)], 5, 10.0), ValueError, "dt_s"),
        (lambda: weights.schedule([(0, 2.0)], 5, 900.0, DT_S), SignalError, "bandwidth_hz"),
        (lambda: weights.formation(2, 1, 4, tracking=1.5), LearningError, "tracking_share"),
        (lambda: weights.formation(2, 1, 4, own=np.ones(3)), ValueError, "own has shape"),
        (lambda: weights.formation(2, 1, 4, leaders=[2]), LearningError, "agent 2"),
        (lambda: weights.formation(2, 1, 4, pairs=[(0, 0)]), LearningError, "pairs"),
        (lambda: weights.formation(2, 1, 4, axes=[1]), LearningError, "axis 1"),
        (lambda: weights.formation(0, 1, 4), LearningError, "n_agents"),
        (lambda: weights.formation_errors(np.ones((4, 3)), 2), ValueError, "e has shape"),
        (
            lambda: NormOptimalIlc.contour(two_axes(), path(9, 3), r=1.0),
            ValueError,
            "reference has shape",
        ),
        (lambda: NormOptimalIlc.formation([], 5), ValueError, "models is empty"),
        (
            lambda: NormOptimalIlc.formation([two_axes(), second_order(1.0, 1.0)], 5),
            ValueError,
            r"models\[1\] has 1 outputs",
        ),
        (
            lambda: NormOptimalIlc.dynamic(
                two_axes(), 5, from_transfer_function([1.0], [1.0, -1.25], DT_S), r=1.0
            ),
            LearningError,
            "causal",
        ),
        (
            lambda: NormOptimalIlc.dynamic(
                two_axes(), 5, from_transfer_function([1.0], [1.0, -0.5], DT_S), r=1.0
            ),
            ModelError,
            "signals meet",
        ),
        (
            lambda: NormOptimalIlc.dynamic(
                two_axes(), 5, two_axes(), coupling=np.ones((4, 2, 2)), r=1.0
            ),
            ValueError,
            "coupling has shape",
        ),
        (
            lambda: NormOptimalIlc.dynamic(
                two_axes(), 5, input_filter=weights.high_pass(1, 20.0, DT_S)
            ),
            LearningError,
            "input_weight .* takes 1 signals; 2 are needed",
        ),
        (
            lambda: NormOptimalIlc.dynamic(
                two_axes(), 5, change_filter=weights.high_pass(1, 20.0, DT_S, 2), change_weight=-1.0
            ),
            LearningError,
            "change_weight",
        ),
        (lambda: weights.high_pass(2, 250.0, DT_S), SignalError, "cutoff_hz = 250 Hz"),
        (lambda: weights.high_pass(2, -1.0, DT_S), SignalError, "cutoff_hz = -1 Hz"),
        (lambda: weights.low_pass(2, 20.0, DT_S, 0), LearningError, "n_channels = 0"),
        (lambda: weights.low_pass(13, 20.0, DT_S), SignalError, "order = 13"),
        (lambda: weights.contour(path(5, 2), q=-np.eye(2)), LearningError, "semidefinite"),
        (lambda: weights.contour(path(5, 2), contour=[1, 2, 3, 4, np.inf]), ValueError, "contour"),
    ],
)
def test_each_wrong_thing_is_named(call, kind, word):
    with pytest.raises(kind, match=word):
        call()
