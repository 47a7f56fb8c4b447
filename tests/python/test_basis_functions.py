"""Learning in parameters: against dense least squares, and from one trajectory to another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from ports_fixture import free_bus

from ilc_rt import (
    BadInputError,
    BasisFunctions,
    Campaign,
    Cell,
    LearningError,
    analyze,
    discretize,
    second_order,
    simulate,
)
from ilc_rt.laws import PositionHarmonic, RepetitiveIlc, position_harmonics

if TYPE_CHECKING:
    from pathlib import Path

N, DT_S = 150, 0.002
RNG = np.random.default_rng(11)
AXIS = discretize(second_order(94.0, 0.7), DT_S)
# The plant: slower, less damped, a cycle later.
PLANT = discretize(second_order(80.0, 0.5), DT_S).delayed(1)
SMOOTH = 0.02 * np.hanning(N) ** 2


def differences(reference: np.ndarray, order: int) -> np.ndarray:
    """Return a derivative by the dense matrix of central differences, at rest outside the run."""
    wide = np.concatenate((np.full(order, reference[0]), reference, np.full(order, reference[-1])))
    for _ in range(order):
        n = len(wide)
        wide = (np.eye(n)[2:] - np.eye(n)[:-2]) @ wide / (2 * DT_S)
    return wide


def dense(u, e, q, s, r, psi, matrix):
    """Return the next input by the normal equations."""
    predicted = matrix @ psi
    left = predicted.T @ np.diag(q) @ predicted + (s + r) * psi.T @ psi
    right = predicted.T @ np.diag(q) @ (e + matrix @ u) + r * psi.T @ u
    return psi @ np.linalg.solve(left, right)


@pytest.mark.parametrize(("s", "r"), [(0.0, 0.0), (0.02, 0.0), (0.0, 0.3), (0.01, 0.1)])
def test_an_update_is_that_of_the_normal_equations(s: float, r: float) -> None:
    q = RNG.uniform(0.5, 2.0, N)
    model = AXIS.delayed(2)
    law = BasisFunctions(
        model, SMOOTH, ["position", "velocity", "acceleration"], q=q, s=s, r=r, lead_samples=3
    )
    signals = [SMOOTH, differences(SMOOTH, 1), differences(SMOOTH, 2)]
    psi = np.column_stack([np.r_[x[3:], np.full(3, x[-1])] for x in signals])
    u, e = 1e-3 * RNG.normal(size=N), 1e-3 * RNG.normal(size=N)
    expected = dense(u, e, q, s, r, psi, model.lifted(N))
    np.testing.assert_allclose(law.update(u, e), expected, rtol=0, atol=1e-7 * np.ptp(expected))


def test_axes_have_parameters_of_their_own_through_a_coupled_model() -> None:
    coupled = AXIS.append(PLANT).series(
        type(AXIS)(
            np.zeros((0, 0)),
            np.zeros((0, 2)),
            np.zeros((2, 0)),
            [[1.0, 0.2], [0.1, 1.0]],
            DT_S,
        )
    )
    reference = np.column_stack([SMOOTH, 0.5 * np.roll(SMOOTH, 7)])
    law = BasisFunctions(coupled, reference, ["position", "velocity"], r=0.01, lead_samples=0)
    u, e = 1e-3 * RNG.normal(size=(N, 2)), 1e-3 * RNG.normal(size=(N, 2))
    psi = np.zeros((2 * N, 4))
    for axis in range(2):
        for order in range(2):
            psi[axis::2, 2 * axis + order] = differences(
                reference[:, axis] - reference[0, axis], order
            )
    expected = dense(u.ravel(), e.ravel(), np.ones(2 * N), 0.0, 0.01, psi, coupled.lifted(N))
    np.testing.assert_allclose(law.update(u, e).ravel(), expected, rtol=0, atol=1e-9)


def test_the_parameters_of_an_axis_are_found() -> None:
    """The inverse of the axis is 1 + 2 d/w s + s^2/w^2."""
    law = BasisFunctions(AXIS, SMOOTH, ["position", "velocity", "acceleration"], lead_samples=1)
    simulate(AXIS, law, SMOOTH, trials=3)
    found = law.coefficients
    assert found["position"][0] == pytest.approx(1.0, rel=1e-3)
    assert found["velocity"][0] == pytest.approx(1.4 / 94.0 - 0.5 * DT_S, rel=0.05)
    assert found["acceleration"][0] == pytest.approx(94.0**-2, rel=0.2)


def test_a_mismatched_plant_is_learned_and_the_parameters_hold_elsewhere() -> None:
    basis = ["position", "velocity", "acceleration"]
    law = BasisFunctions(AXIS, SMOOTH, basis)
    learned = simulate(PLANT, law, SMOOTH, trials=8)
    rms = learned.figures()["tracking_rms_m"]
    assert rms[-1] < 0.01 * rms[0]
    assert (np.diff(rms[:4]) < 0).all()
    elsewhere = -0.05 * np.hanning(400) ** 2
    transferred = law.with_reference(elsewhere, learn=False)
    error = elsewhere - PLANT.simulate(transferred.input())
    assert np.abs(error).max() < 0.02 * np.abs(elsewhere).max()
    np.testing.assert_array_equal(law.input(elsewhere), transferred.input())
    # Without learning the parameters stay, whatever the error.
    np.testing.assert_array_equal(
        transferred.update(np.zeros(400), RNG.normal(size=400)), transferred.input()
    )


def test_position_harmonics_learn_cogging_at_one_speed_for_every_other_one() -> None:
    pitch = 0.01

    def cogging(reference):
        return 2e-4 * np.sin(2 * np.pi * reference / pitch + 0.4)

    slow, fast = (np.linspace(0.0, 0.06, n) for n in (3000, 1500))
    law = BasisFunctions(AXIS, slow, position_harmonics(pitch, 2))
    result = simulate(AXIS, law, slow, trials=4, output_disturbance=slow + cogging(slow))
    assert result.records[-1].tracking_rms_m < 0.2 * result.records[0].tracking_rms_m
    before = -cogging(fast)
    after = before - AXIS.simulate(law.input(fast))
    # Apart from the start, where the model is still at rest.
    assert np.std(after[60:]) < 0.25 * np.std(before[60:])


def test_what_the_reference_does_not_excite_stays() -> None:
    still = np.zeros(N)
    law = BasisFunctions(AXIS, still, ["velocity"], parameters=[[0.3]])
    law.update(np.zeros(N), np.ones(N))
    assert law.coefficients["velocity"][0] == 0.3
    law = BasisFunctions(AXIS, SMOOTH, ["velocity"], parameters=[[0.3]])
    law.update(np.zeros(N), np.ones(N))
    assert law.coefficients["velocity"][0] != 0.3
    law.reset()
    assert law.coefficients["velocity"][0] == 0.3


def test_functions_of_the_user_and_the_analysis() -> None:
    def square(reference, dt_s):
        return reference**2

    law = BasisFunctions(AXIS, SMOOTH, ["position", square])
    assert list(law.coefficients) == ["position", "square"]
    analysis = analyze(law, AXIS, N)
    assert analysis.converges


PROGRAM = """
start_m = [0.02, 0.01]
feed_m_s = 0.07
corner = "blend"
blend_s = 0.04
segment = [{ to_m = [0.05, 0.05] }, { to_m = [0.07, 0.02] }, { to_m = [0.02, 0.01] }]

[learning]"""


def test_a_gantry_learns_one_path_and_runs_another_at_once(gantry: Path, tmp_path: Path) -> None:
    """Friction, a mode and another path: at least 70 % less error in its first run."""
    text = gantry.read_text(encoding="utf-8")
    head, rest = text.split("[program]\n")
    other = tmp_path / "other.toml"
    other.write_text(head + "[program]" + PROGRAM + rest.split("[learning]", 1)[1], "utf-8")
    here, there = Cell.load(gantry), Cell.load(other)
    law = BasisFunctions(here.model(), here.reference())
    simulate(here, law, trials=6)
    transferred = law.with_reference(there.reference(), learn=False)
    # The controller's first run is without learned input, the second one has it: nothing is
    # learned in between.
    plain, transfer = simulate(there, transferred, trials=2).records
    assert transfer.tracking_rms_m < 0.3 * plain.tracking_rms_m
    for before, after in zip(plain.axes_tracking_rms_m, transfer.axes_tracking_rms_m, strict=True):
        assert after < 0.3 * before


def test_the_controller_takes_the_parameters_of_one_path_to_another(
    gantry: Path, tmp_path: Path
) -> None:
    """The standalone program, with its own law: at least 70 % less error in the first run."""
    head, rest = gantry.read_text(encoding="utf-8").split("[program]\n")
    law = '\nlaw = "basis_functions"\n[learning.basis_functions]\nfunctions = '
    law += '["velocity", "acceleration", "jerk", "coulomb"]\n'
    here, there = tmp_path / "here.toml", tmp_path / "there.toml"
    here.write_text(head + "[program]\n" + rest.split("[learning]", 1)[0] + "[learning]" + law)
    there.write_text(head + "[program]" + PROGRAM + law)
    library, bus = tmp_path / "library.db", free_bus()

    def rms(cell: Path, runs: int, **options: Any) -> list[float]:
        campaign = Campaign(
            cell,
            library=library,
            bus=bus,
            lockstep=True,
            drives="simulated",
            telemetry=False,
            **options,
        )
        return [record.tracking_rms_m for record in campaign.run(runs)]

    learned = rms(here, 5)
    plain = rms(there, 1, learning=False)
    transfer = rms(there, 2, parameters_from="best")
    assert learned[-1] < 0.3 * learned[0]
    assert transfer[0] < 0.3 * plain[0]
    with pytest.raises(BadInputError, match="--parameters-from"):
        rms(there, 3, parameters_from="best", resume=True)


def test_a_table_over_the_position_is_one_for_both_directions_or_one_for_each() -> None:
    there = 0.05 * np.hanning(1600)
    backlash = 1e-4 * np.where(np.gradient(there) >= 0, 1.0, -1.0)
    wave = 2e-4 * np.sin(2 * np.pi * there / 0.025)
    motion = ["position", "velocity", "acceleration"]

    def learned(
        disturbance: np.ndarray, *, by_direction: bool
    ) -> tuple[tuple[np.ndarray, np.ndarray], float]:
        law = RepetitiveIlc(AXIS, there, 0.0025, by_direction=by_direction, functions=motion)
        result = simulate(AXIS, law, there, trials=3, output_disturbance=disturbance)
        return law.table, result.records[-1].tracking_rms_m

    (places, values), _ = learned(wave, by_direction=False)
    assert values.shape == (1, 1, len(places))
    # The disturbance is added to the measurement: the table is its negative.
    expected = -2e-4 * np.sin(2 * np.pi * places / 0.025)
    inner = slice(3, -3)
    table = values[0, 0, inner] - np.polyval(
        np.polyfit(places[inner], values[0, 0, inner] - expected[inner], 2), places[inner]
    )
    np.testing.assert_allclose(table, expected[inner], rtol=0, atol=4e-5)
    _, one = learned(wave + backlash, by_direction=False)
    (_, values), each = learned(wave + backlash, by_direction=True)
    assert values.shape == (1, 2, len(places))
    assert each < 0.5 * one


@pytest.mark.parametrize(
    ("keywords", "error", "words"),
    [
        ({"spacing": 0.0}, LearningError, "spacing = 0.0"),
        ({"spacing": 1e-6}, LearningError, "at most 2000 entries"),
        ({"by_direction": 1}, TypeError, "by_direction = 1"),
        ({"span": (1.0, 0.0)}, LearningError, "lowest position comes first"),
        ({"span": 3.0}, TypeError, "two numbers"),
        ({"reference": np.array([np.nan, 0.0])}, ValueError, "finite numbers"),
    ],
)
def test_an_unusable_table_is_named(keywords, error, words: str) -> None:
    with pytest.raises(error, match=words):
        RepetitiveIlc(**{"model": AXIS, "reference": SMOOTH, "spacing": 0.001, **keywords})


@pytest.mark.parametrize(
    ("keywords", "error", "words"),
    [
        ({"basis": ["speed"]}, LearningError, "basis = 'speed': allowed position, velocity"),
        ({"basis": ["velocity", "viscous"]}, LearningError, "viscous is there twice"),
        ({"basis": "velocity"}, TypeError, "a list of names"),
        ({"basis": [lambda r, dt: r[1:]]}, ValueError, r"shape \(149,\)"),
        ({"basis": [lambda r, dt: r * np.nan]}, ValueError, "not finite"),
        ({"q": -1.0}, LearningError, "q: a weight"),
        ({"s": np.ones(3)}, ValueError, r"s has shape \(3,\)"),
        ({"lead_samples": -1}, LearningError, "lead_samples = -1"),
        ({"reference": np.ones((N, 2))}, ValueError, r"reference has shape \(150, 2\)"),
        ({"parameters": [1.0]}, ValueError, "parameters has shape"),
        ({"model": second_order(94.0, 0.7)}, LearningError, "discrete-time"),
        ({"model": 3}, TypeError, "model is a int"),
    ],
)  # fmt: skip
def test_an_unusable_argument_is_named(keywords, error, words: str) -> None:
    with pytest.raises(error, match=words):
        BasisFunctions(**{"model": AXIS, "reference": SMOOTH, **keywords})


def test_a_harmonic_has_a_period() -> None:
    with pytest.raises(LearningError, match="pitch = 0"):
        position_harmonics(0.0)
    cosine = PositionHarmonic(0.02, 3, is_cosine=True)
    np.testing.assert_allclose(cosine(np.array([0.0, 0.02 / 3]), DT_S), 1.0)
