"""The recommended law learns on plants that differ from the model as much as stated."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from ilc_rt import (
    LearningError,
    StateSpace,
    TimeVarying,
    discretize,
    from_transfer_function,
    recommend,
    second_order,
    simulate,
)
from ilc_rt.learning_facts import learning_facts

N = 120
DT_S = 0.004
TRIALS = 12
NOISE = 1e-5
# The plants with a zero outside need a rest before the motion, in which their input begins.
MOTION = 0.01 * np.concatenate((np.zeros(30), np.hanning(N - 30)))
SHAPED = np.linspace(0.15, 1.5, 20)


def plant(num, den) -> StateSpace:
    return discretize(from_transfer_function(num, den), DT_S)


@cache
def axis(rad_s: float = 60.0, damping: float = 0.7, gain: float = 1.0) -> StateSpace:
    return plant([gain * rad_s**2], [1.0, 2.0 * damping * rad_s, rad_s**2])


def flexible(hz: float, damping: float, gain: float = 1.0) -> StateSpace:
    w = 2 * np.pi * hz
    mode = [1.0, 2.0 * damping * w, w * w]
    return plant([gain * w * w * 3600.0], np.polymul([1.0, 84.0, 3600.0], mode))


def non_minimum_phase(zero: float, rad_s: float = 60.0, gain: float = 1.0) -> StateSpace:
    return plant([-gain / zero, gain], [1 / rad_s**2, 1.4 / rad_s, 1.0])


# Model, plant within 30 % of it, uncertainty, laws that suit.
TRACKING: dict[str, tuple[StateSpace, StateSpace, Any, set[str]]] = {
    "position loop": (axis(), axis(56.0, 0.6, 1.1), 0.3, {"NormOptimalIlc"}),
    "dead time": (
        axis().delayed(3), axis(64.0, 0.8, 0.9).delayed(3), 0.3, {"NormOptimalIlc"},
    ),
    "slow": (axis(15.0, 0.9), axis(14.0, 1.0, 1.1), 0.3, {"NormOptimalIlc"}),
    "fast": (axis(250.0), axis(270.0, 0.7, 1.1), 0.3, {"NormOptimalIlc"}),
    "uncertain at high frequency": (
        axis(), axis(56.0, 0.6, 1.1), SHAPED, {"NormOptimalIlc", "ModelInverseIlc"},
    ),
    "first order": (
        plant([1.0], [1 / 40, 1.0]), plant([1.15], [1 / 45, 1.0]), 0.3, {"NormOptimalIlc"},
    ),
    "velocity to position": (
        plant([1.0], [1 / 60, 1.0, 0.0]), plant([1.1], [1 / 66, 1.0, 0.0]), 0.3,
        {"NormOptimalIlc"},
    ),
    "force to position": (
        plant([0.1], [1.0, 0.0, 0.0]), plant([0.115], [1.0, 0.0, 0.0]), 0.3, {"NormOptimalIlc"},
    ),
    "lightly damped mode": (
        flexible(30.0, 0.03), flexible(32.5, 0.025, 1.05), 0.3, {"StableInverseIlc"},
    ),
    "non-minimum phase": (
        non_minimum_phase(60.0), non_minimum_phase(56.0, 60.0, 1.1), 0.3,
        {"NormOptimalIlc", "StableInverseIlc"},
    ),
    "slow zero outside": (
        non_minimum_phase(25.0), non_minimum_phase(26.0, 60.0, 0.9), 0.3,
        {"NormOptimalIlc", "StableInverseIlc"},
    ),
    "two axes": (
        axis().append(axis(40.0, 0.9)), axis(57.0, 0.6, 1.1).append(axis(42.0, 0.9, 0.95)), 0.3,
        {"NormOptimalIlc"},
    ),
}  # fmt: skip


def learned(real: StateSpace, law, motion=MOTION, **options: Any) -> np.ndarray:
    """Return the RMS errors of the runs over that of the first."""
    result = simulate(real, law, motion, trials=TRIALS, seed=3, **options)
    rms = result.figures()["tracking_rms_m"]
    return rms / rms[0]


@pytest.mark.parametrize("case", TRACKING)
def test_the_law_learns_on_a_plant_within_the_uncertainty(case: str) -> None:
    """The error ends at least 70 % below that of run 0, and never grows above it."""
    model, real, uncertainty, suitable = TRACKING[case]
    short = MOTION[40:]
    motion = MOTION if model.n_outputs == 1 else np.column_stack((short, -short))
    found = recommend(model, reference=motion, uncertainty=uncertainty, noise_std=NOISE)
    rms = learned(real, found.law, motion, noise_std=NOISE)
    assert rms[-1] < 0.3
    assert rms.max() == rms[0]
    assert found.name == type(found.law).__name__
    assert found.name in suitable
    assert found.name not in {one.law for one in found.refused}
    # The prediction is that of the model itself.
    predicted = next(reason.value for reason in found.reasons if reason.fact == "left")
    nominal = learned(model, found.law, motion, noise_std=NOISE)
    assert nominal[10] < 1.2 * predicted
    assert found.name != "NormOptimalIlc" or predicted < 1.2 * nominal[10]


def test_a_mode_within_the_uncertainty_limits_the_band() -> None:
    facts = learning_facts(flexible(30.0, 0.03), 0.3)
    (mode,) = facts.modes
    assert (mode.frequency_hz, mode.damping) == pytest.approx((30.0, 0.03))
    assert 15.0 < facts.known_hz < 30.0
    # The bound holds for a plant whose mode lies elsewhere.
    f = np.linspace(0.0, facts.nyquist_hz, len(facts.uncertainty))
    model, real = (
        flexible(hz, 0.03).frequency_response(2 * np.pi * f)[:, 0, 0] for hz in (30.0, 34.4)
    )
    inside = f < 60.0
    assert (np.abs(real / model - 1)[inside] <= 1.05 * facts.uncertainty[inside] + 0.05).all()
    assert learning_facts(flexible(30.0, 0.03), 0.01).known_hz is None
    found = recommend(flexible(30.0, 0.03), reference=MOTION, uncertainty=0.3)
    assert found.arguments["q_filter"].cutoff_hz <= facts.known_hz
    assert "a mode at 30 Hz" in str(found)


def test_zeros_and_delays_are_facts() -> None:
    facts = learning_facts(non_minimum_phase(60.0).delayed(2))
    assert facts.is_non_minimum_phase
    assert facts.delay_samples == 3
    assert facts.zeros_outside[0].real == pytest.approx(np.exp(60.0 * DT_S), rel=0.05)
    third = discretize(from_transfer_function([2e6], [1.0, 220.0, 24e3, 2e6]), 0.001)
    sampled = learning_facts(third)
    assert sampled.zeros_outside == pytest.approx([-3.5312], rel=1e-3)
    assert not sampled.is_non_minimum_phase
    assert learning_facts(plant([0.1], [1.0, 0.0, 0.0])).integrators == 2


def test_bounds_matter_if_they_would_be_reached() -> None:
    """The input that brings the error to zero is about the motion, of 10 mm."""
    far = recommend(axis(), reference=MOTION, bounds={"input_max": 0.05})
    assert far.name == "NormOptimalIlc"
    assert any(one.law == "ConstrainedIlc" for one in far.refused)
    near = recommend(axis(), reference=MOTION, bounds={"input_max": 0.009})
    assert near.name == "ConstrainedIlc"
    assert "input_max allows 0.009" in str(near)
    result = simulate(axis(56.0, 0.6, 1.1), near.law, MOTION, trials=TRIALS)
    rms = result.figures()["tracking_rms_m"]
    assert np.abs(result.input).max() <= 0.009 * (1 + 1e-6)
    assert rms[-1] < 0.3 * rms[0]
    assert rms.max() == rms[0]
    assert recommend(axis(), N, bounds={"change_max": 1.0}).name == "ConstrainedIlc"
    moves = {"reference": MOTION, "velocity_bounds": 0.01}
    assert "velocity_bounds allows 0.01" in str(recommend(axis(), reference=MOTION, bounds=moves))


def test_points_alone_get_the_smallest_input() -> None:
    found = recommend(axis(), reference=MOTION, points=[75, 119], uncertainty=0.2)
    assert found.name == "PointToPointIlc"
    result = simulate(axis(56.0, 0.6, 1.1), found.law, MOTION, trials=TRIALS)
    at = np.abs(result.error[:, [75, 119], 0]).max(axis=1)
    assert at[-1] < 0.01 * at[0]
    assert at.max() == at[0]


def test_a_changing_task_gets_parameters_that_hold_for_the_next_one() -> None:
    """Learned on one motion, the error of another one is 70 % lower at once."""
    found = recommend(axis(), reference=MOTION, changes_task=True)
    assert found.name == "BasisFunctions"
    assert found.arguments["basis"] == ["position", "velocity", "acceleration"]
    real = axis(56.0, 0.6, 1.1)
    rms = learned(real, found.law)
    assert rms[-1] < 0.3
    assert rms.max() == rms[0]
    other = 0.02 * np.hanning(200) ** 2
    left = other - real.simulate(found.law.input(other))
    assert np.linalg.norm(left) < 0.3 * np.linalg.norm(other)
    force = recommend(
        plant([0.1], [1.0, 0.0, 0.0]), reference=MOTION, changes_task=True, has_friction=True
    )
    assert force.arguments["basis"] == ["acceleration", "coulomb"]
    with pytest.raises(LearningError, match="reference: needed with changes_task"):
        recommend(axis(), N, changes_task=True)


def test_without_a_model_the_error_or_a_measured_gradient_is_taken() -> None:
    found = recommend(None, dt_s=DT_S, bandwidth_hz=60.0 / (2 * np.pi), delay_samples=2)
    assert found.name == "PdIlc"
    for real in (axis().delayed(2), axis(60.0, 0.5, 1.2).delayed(2), axis(75.0, 1.0).delayed(2)):
        rms = learned(real, found.law)
        assert rms[-1] < 0.3
        assert rms.max() == rms[0]
    gradient = recommend(None, N)
    assert (gradient.name, gradient.kind) == ("ModelFreeIlc", "model_free")
    rms = learned(axis(), gradient.law)
    # The runs between are for the measurement.
    assert rms[::3][-1] < 0.3
    assert (np.diff(rms[::3]) < 0.0).all()
    with pytest.raises(LearningError, match="no law suits several"):
        recommend(None, N, n_axes=2)


def test_a_model_that_may_be_all_wrong_teaches_nothing() -> None:
    assert recommend(axis(), N, uncertainty=1.0).name == "ModelFreeIlc"
    with pytest.raises(LearningError, match="`ilc identify` measures a better one"):
        recommend(axis().append(axis()), N, uncertainty=1.0)


def test_a_measured_disturbance_gets_a_memory_of_runs() -> None:
    """The gain of the plant depends on the temperature, which alternates."""

    def warm(u, disturbance):
        return (1.0 + 0.01 * (disturbance[0] - 20.0)) * axis().simulate(u)

    found = recommend(axis(), reference=MOTION, disturbance_std=10.0)
    assert found.name == "RelevanceIlc"
    temperatures = np.tile([10.0, 30.0], 8)[:, None]
    result = simulate(warm, found.law, MOTION, trials=16, disturbance=temperatures, dt_s=DT_S)
    rms = result.figures()["tracking_rms_m"]
    assert rms[-2:].max() < 0.3 * rms[0]
    alone = recommend(axis(), reference=MOTION).law
    forgetful = simulate(warm, alone, MOTION, trials=16, disturbance=temperatures, dt_s=DT_S)
    assert rms[-2:].max() < 0.5 * forgetful.figures()["tracking_rms_m"][-2:].max()


def test_a_model_that_varies_gets_norm_optimal_learning() -> None:
    matrices = [np.repeat(m[None], N, 0) for m in (axis().a, axis().b, axis().c, axis().d)]
    varying = TimeVarying(*matrices, DT_S)
    found = recommend(varying, reference=MOTION)
    assert (found.name, found.facts.varies) == ("NormOptimalIlc", True)
    rms = learned(varying, found.law)
    assert rms[-1] < 0.3
    with pytest.raises(LearningError, match="does not vary along the run"):
        recommend(varying, points=[60])


def test_it_is_shown_with_reasons_and_refusals() -> None:
    found = recommend(axis(), reference=MOTION, noise_std=NOISE)
    assert repr(found).startswith("Recommendation(NormOptimalIlc(q=1, s=0, r=")
    assert found.kind == "norm_optimal"
    page = found._repr_html_()
    for reason in found.reasons:
        assert reason.text in page
        assert f"because {reason.text}" in str(found)
    assert len(found.refused) >= 3
    assert found.analysis.converges


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"model": second_order(60.0, 0.7)}, "continuous time: discretize it"),
        ({"model": from_transfer_function([1.0], [1.0, -1.1], DT_S)}, "close a loop around"),
        ({"uncertainty": -0.1}, "gains of 0 or more"),
        ({"n_samples": None}, "n_samples: needed"),
        ({"n_runs": 0}, "n_runs = 0: a whole number"),
        ({"reference": np.ones(N - 1)}, "n_samples = 120"),
        ({"disturbance_std": 0.0}, "disturbance_std = 0.0"),
        ({"model": None, "bandwidth_hz": 10.0}, "dt_s = None"),
        ({"model": None, "bandwidth_hz": 500.0, "dt_s": DT_S}, "between 0 and 125 Hz"),
        ({"points": [0]}, "before the first effect"),
    ],
)
def test_what_cannot_be_recommended_is_named(arguments: dict[str, Any], words: str) -> None:
    given = {"model": axis(), "n_samples": N, **arguments}
    with pytest.raises(LearningError, match=words):
        recommend(given.pop("model"), **given)


def test_bounds_that_are_no_mapping_are_refused() -> None:
    for bounds in (len, [("input_max", 1.0)], 0.5, "input_max"):
        with pytest.raises(TypeError, match="a mapping of keywords of ConstrainedIlc"):
            recommend(axis(), N, bounds=bounds)  # type: ignore[arg-type]
