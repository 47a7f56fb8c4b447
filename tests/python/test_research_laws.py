"""Laws of research: against dense computations, and on plants that differ from the model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from ilc_rt import (
    Campaign,
    Ladder,
    LearningError,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    StateSpace,
    discretize,
    from_transfer_function,
    second_order,
    signal,
    simulate,
)
from ilc_rt.laws import Filtered, HigherOrderIlc, ModelFreeIlc, PointToPointIlc, StableInverseIlc

EXAMPLES = Path(__file__).parents[2] / "examples"
N, DT_S = 160, 0.002
RNG = np.random.default_rng(5)
AXIS = discretize(second_order(94.0, 0.7), DT_S)
PLANT = discretize(second_order(80.0, 0.5), DT_S).delayed(1)
REFERENCE = 0.01 * np.hanning(N) ** 2
# One zero outside the unit circle, one inside, complex poles, a delay.
NON_MINIMUM = from_transfer_function(
    0.3 * np.poly([1.4, -0.5]), np.poly([0.8 + 0.2j, 0.8 - 0.2j, 0.3]).real, DT_S
).delayed(2)


class Dense:
    """P-type learning in dense matrices: u + gain P' e."""

    def __init__(self, matrix, gain):
        self.gradient = gain * matrix.T

    def update(self, u, e, disturbance=None):
        """Return the next input."""
        return u + self.gradient @ e


def step_of(matrix) -> float:
    return 1.0 / np.linalg.norm(matrix, 2) ** 2


def test_a_higher_order_is_the_recursion_of_its_companion_matrix() -> None:
    """The stacked last three inputs as one dense linear system."""
    matrix, weights = PLANT.lifted(N), (1.3, -0.5, 0.2)
    gain = 0.5 * step_of(matrix)
    law = HigherOrderIlc(Dense(AXIS.lifted(N), gain), weights)
    found = simulate(PLANT, law, REFERENCE, trials=9).input[:, :, 0]
    learned = np.eye(N) - gain * AXIS.lifted(N).T @ matrix
    constant = gain * AXIS.lifted(N).T @ REFERENCE
    # The oldest run replaces the missing ones: they are equal at first.
    past = [np.zeros(N)] * 3
    for u in found:
        np.testing.assert_allclose(u, past[0], rtol=0, atol=1e-12)
        following = sum(w * (learned @ v + constant) for w, v in zip(weights, past, strict=True))
        past = [following, *past[:2]]


def test_a_higher_order_converges_faster_and_averages_noise() -> None:
    matrix = AXIS.lifted(N)
    gain = step_of(matrix)
    plain, second = (
        simulate(PLANT, HigherOrderIlc(Dense(matrix, gain), weights), REFERENCE, trials=30)
        for weights in ([1.0], [1.5, -0.5])
    )
    assert second.records[-1].tracking_rms_m < 0.8 * plain.records[-1].tracking_rms_m
    noisy = [
        simulate(
            [1.0], HigherOrderIlc(PdIlc(kp=1.0, lead_samples=0), weights), np.ones(400),
            trials=40, noise_std=0.1, seed=2,
        ).input[20:]
        for weights in ([1.0], [0.5, 0.5])
    ]  # fmt: skip
    assert np.std(noisy[1] - 1.0) < 0.85 * np.std(noisy[0] - 1.0)


@pytest.mark.parametrize("weights", [[], [0.5], [1.0] * 21, [np.nan], "1"])
def test_weights_add_up_to_one(weights) -> None:
    with pytest.raises((LearningError, TypeError), match="weights"):
        HigherOrderIlc(PdIlc(kp=0.5), weights)


@pytest.mark.parametrize("r", [0.0, 0.02])
def test_point_to_point_is_the_regularised_pseudo_inverse(r: float) -> None:
    both = AXIS.append(PLANT)
    points = [40, 90, 159]
    law = PointToPointIlc(both, N, points, gain=0.8, r=r)
    u, e = RNG.normal(size=(N, 2)), RNG.normal(size=(N, 2))
    rows = both.lifted(N).reshape(N, 2, 2 * N)[points].reshape(6, 2 * N)
    right = e[points].ravel()
    # The smallest change in least squares, by stacking.
    if r:
        tall = np.vstack([rows, np.sqrt(r) * np.eye(2 * N)])
        change = np.linalg.lstsq(tall, np.concatenate([right, np.zeros(2 * N)]), rcond=None)[0]
    else:
        change = scipy.linalg.pinv(rows) @ right
    expected = u + 0.8 * change.reshape(N, 2)
    np.testing.assert_allclose(law.update(u, e), expected, rtol=0, atol=1e-9)


def test_points_are_reached_on_another_plant_with_less_effort() -> None:
    points = [50, 110, N - 1]
    law = PointToPointIlc(AXIS, N, points, gain=0.7)
    result = simulate(PLANT, law, REFERENCE, trials=20)
    errors = np.abs(result.error[:, points, 0]).max(axis=1)
    assert errors[-1] < 1e-4 * errors[0]
    gradient = Dense(AXIS.lifted(N), step_of(AXIS.lifted(N)))
    everywhere = simulate(PLANT, gradient, REFERENCE, trials=200)
    assert np.linalg.norm(result.input[-1]) < 0.8 * np.linalg.norm(everywhere.input[-1])


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([N], "points = 160"),
        ([], "1 to 2000 different"),
        ([3, 3], "different samples"),
        ([0], "sample 0: before the first effect"),
        (range(3, N), "too near to each other"),
    ],
)
def test_unusable_points_are_named(points, words: str) -> None:
    with pytest.raises(LearningError, match=words):
        PointToPointIlc(NON_MINIMUM if words.startswith("too") else AXIS, N, points)


def test_norm_optimal_with_a_q_filter_is_the_filtered_dense_solution() -> None:
    """A mode that the model omits makes the law diverge; with the filter it converges."""
    r, low_pass = 0.05, signal.butterworth(2, 25.0, DT_S)
    u, e = RNG.normal(size=N), RNG.normal(size=N)
    matrix = AXIS.lifted(N)
    change = np.linalg.solve(matrix.T @ matrix + r * np.eye(N), matrix.T @ e)
    law = Filtered(NormOptimalIlc(AXIS, N, r=r), low_pass)
    expected = signal.zero_phase(low_pass, u + change)
    np.testing.assert_allclose(law.update(u, e), expected, rtol=0, atol=1e-8)
    plant = AXIS * discretize(second_order(400.0, 0.04), DT_S)
    alone, filtered = (
        simulate(plant, one, REFERENCE, trials=12).figures()["tracking_rms_m"]
        for one in (
            NormOptimalIlc(AXIS, N, r=1e-3),
            Filtered(NormOptimalIlc(AXIS, N, r=1e-3), low_pass),
        )
    )
    assert alone[-1] > alone[3]
    assert filtered[-1] < 0.1 * filtered[0]


def two_sided(model, e: np.ndarray) -> np.ndarray:
    """Return the exact two-sided inverse by a Fourier transform, with room on both sides."""
    n = 1 << 14
    w = 2 * np.pi * np.fft.rfftfreq(n) / DT_S
    response = np.asarray(model.frequency_response(w))[:, 0, 0]
    wide = np.zeros(n)
    wide[n // 2 : n // 2 + len(e)] = e
    return np.fft.irfft(np.fft.rfft(wide) / response, n)[n // 2 : n // 2 + len(e)]


def test_stable_inversion_is_the_two_sided_inverse() -> None:
    e = np.zeros(400)
    e[150:250] = np.hanning(100)
    law = StableInverseIlc(NON_MINIMUM, 400, gain=1.0)
    assert law.zeros_outside.real == pytest.approx([1.4])
    u = law.update(np.zeros(400), e)
    np.testing.assert_allclose(u, two_sided(NON_MINIMUM, e), rtol=0, atol=1e-9 * np.abs(u).max())
    np.testing.assert_allclose(NON_MINIMUM.simulate(u), e, rtol=0, atol=1e-9)


def test_zpetc_has_no_phase_error_and_its_known_gain() -> None:
    """P L = |Bu|^2 / Bu(1)^2, from the transform of an impulse in the middle."""
    e = np.zeros(2000)
    e[1000] = 1.0
    u = StableInverseIlc(NON_MINIMUM, 2000, gain=1.0, method="zpetc").update(np.zeros(2000), e)
    response = np.fft.rfft(np.roll(NON_MINIMUM.simulate(u), -1000))
    z = np.exp(2j * np.pi * np.fft.rfftfreq(2000))
    np.testing.assert_allclose(response, np.abs(z - 1.4) ** 2 / 0.4**2, rtol=0, atol=1e-6)


def test_zeros_near_the_circle_are_left_alone_by_zpetc() -> None:
    ringing = discretize(second_order(94.0, 0.7), DT_S)
    law = StableInverseIlc(ringing, N, method="zpetc", zero_radius=0.9)
    assert len(law.zeros_outside) == 1
    u = law.update(np.zeros(N), REFERENCE)
    plain = StableInverseIlc(ringing, N).update(np.zeros(N), REFERENCE)
    np.testing.assert_allclose(u, plain, rtol=0, atol=0.02 * np.abs(plain).max())
    step = np.where(np.arange(N) > 40, 1.0, 0.0)
    inputs = [one.update(np.zeros(N), step) for one in (law, StableInverseIlc(ringing, N))]
    assert np.abs(np.diff(inputs[0])).max() < 0.8 * np.abs(np.diff(inputs[1])).max()


@pytest.mark.parametrize("method", ["stable_inversion", "zpetc"])
def test_a_non_minimum_phase_plant_is_learned_despite_another_model(method: str) -> None:
    """Gain 20 % less, zeros and poles elsewhere; the input stays bounded."""
    plant = from_transfer_function(
        0.24 * np.poly([1.35, -0.45]), np.poly([0.78 + 0.22j, 0.78 - 0.22j, 0.35]).real, DT_S
    ).delayed(2)
    reference = np.zeros(400)
    reference[100:300] = 0.01 * np.hanning(200)
    law = StableInverseIlc(
        NON_MINIMUM, 400, gain=0.6, method=method, q_filter=signal.butterworth(2, 40.0, DT_S)
    )
    result = simulate(plant, law, reference, trials=15)
    rms = result.figures()["tracking_rms_m"]
    assert rms[-1] < 0.02 * rms[0]
    assert (np.diff(rms[:5]) < 0).all()
    assert np.abs(result.input[-1]).max() < 10 * np.abs(reference).max()


def coupled() -> StateSpace:
    none = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0))
    return AXIS.append(AXIS).series(StateSpace(*none, [[1.0, 0.1], [0.0, 1.0]], DT_S))


def test_what_has_no_inverse_is_refused() -> None:
    on_circle = from_transfer_function(np.poly([-1.0]), np.poly([0.5, 0.2]), DT_S)
    for model, words in (
        (on_circle, "on the unit circle"),
        (coupled(), "couples axes"),
        (second_order(94.0, 0.7), "continuous"),
        (from_transfer_function([0.0], [1.0, -0.5], DT_S), "responds to no input"),
    ):
        with pytest.raises((LearningError, ModelError), match=words):
            StableInverseIlc(model, N)
    with pytest.raises(LearningError, match="zero_radius"):
        StableInverseIlc(AXIS, N, zero_radius=0.5)
    StableInverseIlc(on_circle, N, method="zpetc", zero_radius=0.99)


def test_a_measured_gradient_is_that_of_the_dense_plant() -> None:
    matrix = PLANT.lifted(N)
    gain = step_of(matrix)
    # Friction and the like: the same in every run.
    bias = 1e-3 * RNG.normal(size=N)
    result = simulate(PLANT, ModelFreeIlc(gain), REFERENCE, trials=9, output_disturbance=bias)
    u = np.zeros(N)
    for learning in result.input[::2, :, 0]:
        np.testing.assert_allclose(learning, u, rtol=0, atol=1e-12)
        u = u + gain * matrix.T @ (REFERENCE - bias - matrix @ u)


def test_the_best_step_is_that_of_steepest_descent() -> None:
    matrix = NON_MINIMUM.lifted(N)
    result = simulate(NON_MINIMUM, ModelFreeIlc(), REFERENCE, trials=13)
    u = np.zeros(N)
    for learning in result.input[::3, :, 0]:
        np.testing.assert_allclose(learning, u, rtol=0, atol=1e-10)
        e = REFERENCE - matrix @ u
        gradient = matrix.T @ e
        along = matrix @ gradient
        u = u + (e @ along) / (along @ along) * gradient


def test_a_wrapper_that_changes_what_is_measured_refuses_a_law_that_measures() -> None:
    wrap = (
        lambda law: Ladder(law, repeats=2),
        lambda law: Filtered(law, signal.butterworth(2, 60.0, DT_S)),
        lambda law: HigherOrderIlc(law, [1.5, -0.5]),
    )
    for wrapped in wrap:
        with pytest.raises(ValueError, match="makes runs that only measure"):
            simulate(PLANT, wrapped(ModelFreeIlc()), REFERENCE, trials=4)


def test_the_phase_tells_what_a_run_is_for() -> None:
    law = ModelFreeIlc()
    phases = []
    u = np.zeros(N)
    for _ in range(4):
        phases.append(law.phase)
        u = law.update(u, REFERENCE - AXIS.simulate(u))
    assert phases == ["learning", "probing", "searching", "learning"]
    with pytest.raises(LearningError, match="one input and one output"):
        law.update(np.zeros((N, 2)), np.zeros((N, 2)))
    law.reset()
    assert law.phase == "learning"
    np.testing.assert_array_equal(law.update(u, np.zeros(N)), u)


def test_a_campaign_marks_the_runs_that_only_measure(tmp_path) -> None:
    """Also of a law that is a Python object: its errors are no reason to roll back."""
    text = (EXAMPLES / "07_warm_and_cold.toml").read_text(encoding="utf-8")
    cell = tmp_path / "cell.toml"
    cell.write_text(text.split("[learning]")[0] + '[learning]\nlaw = "model_free"\n', "utf-8")
    for number, law in enumerate((None, ModelFreeIlc(probe=1.0))):
        campaign = Campaign(
            cell, law=law, library=tmp_path / f"{number}.db", bus="loopback:", drives="simulated",
            telemetry=False, lockstep=True,
        )  # fmt: skip
        records = list(campaign.run(7))
        assert [record.phase for record in records] == [
            None, "probing", "searching", None, "probing", "searching", None,
        ]  # fmt: skip
        assert not any(record.rolled_back for record in records)
        learned = [record.tracking_inf_m for record in campaign.result.comparison.learned]
        assert learned[2] < learned[1] < learned[0]
