"""Simulation of learning on any plant: equal plants agree, seeds repeat, errors are named."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING

import control
import numpy as np
import pytest
import scipy.signal

import ilc_rt
from ilc_rt import (
    BadInputError,
    Gate,
    LearningError,
    NormOptimalIlc,
    PdIlc,
    PlantError,
    TimeVarying,
    discretize,
    second_order,
    simulate,
)
from ilc_rt.deviation import path_deviation

if TYPE_CHECKING:
    from pathlib import Path

N = 200
DT_S = 0.002
REFERENCE = 0.01 * np.hanning(N)
CONTINUOUS = second_order(94.0, 0.7)
AXIS = discretize(CONTINUOUS, DT_S)


def law() -> NormOptimalIlc:
    return NormOptimalIlc(AXIS, N, r=0.05)


def varying() -> TimeVarying:
    return TimeVarying(*(np.repeat(m[None], N, 0) for m in (AXIS.a, AXIS.b, AXIS.c, AXIS.d)), DT_S)


PLANTS = {
    "function": AXIS.simulate,
    "continuous": CONTINUOUS,
    "varying": varying(),
    "lifted": AXIS.lifted(N),
    "impulse response": AXIS.markov(N)[:, 0, 0],
    "list": AXIS.markov(N)[:, 0, 0].tolist(),
    "Markov parameters": AXIS.markov(N),
}


@pytest.mark.parametrize("kind", PLANTS)
def test_every_kind_of_plant_gives_the_same_runs(kind: str) -> None:
    expected = simulate(AXIS, law(), REFERENCE, trials=4, noise_std=1e-6, seed=5)
    found = simulate(PLANTS[kind], law(), REFERENCE, trials=4, noise_std=1e-6, dt_s=DT_S, seed=5)
    np.testing.assert_allclose(found.error, expected.error, rtol=0, atol=1e-14)
    assert found.cycle_s == DT_S


def test_models_of_scipy_and_python_control_are_plants() -> None:
    expected = simulate(AXIS, law(), REFERENCE, trials=3)
    numerator = AXIS.c @ AXIS.b, AXIS.c @ (AXIS.a - np.trace(AXIS.a) * np.eye(2)) @ AXIS.b
    polynomials = [float(part[0, 0]) for part in numerator], np.poly(AXIS.a)
    transfer = (
        scipy.signal.TransferFunction(*polynomials, dt=DT_S),
        control.TransferFunction(*polynomials, DT_S),
    )
    for foreign in (AXIS.to_scipy(), AXIS.to_control(), *transfer):
        found = simulate(foreign, law(), REFERENCE, trials=3)
        np.testing.assert_allclose(found.error, expected.error, rtol=0, atol=1e-10)


def test_runs_are_those_of_the_recursion() -> None:
    """Against the same learning in dense matrices."""
    matrix, kp = AXIS.lifted(N), 0.4
    result = simulate(AXIS, PdIlc(kp=kp, lead_samples=0), REFERENCE, trials=5)
    u = np.zeros(N)
    for record in result.records:
        e = REFERENCE - matrix @ u
        np.testing.assert_allclose(record.error_m[:, 0], e, rtol=0, atol=1e-15)
        assert record.tracking_rms_m == pytest.approx(np.sqrt(np.mean(e**2)))
        assert record.tracking_inf_m == pytest.approx(np.abs(e).max())
        u = u + kp * e


def test_a_seed_repeats_the_runs_bit_for_bit_and_another_one_does_not() -> None:
    runs = [simulate(AXIS, law(), REFERENCE, trials=4, noise_std=1e-5, seed=s) for s in (1, 1, 2)]
    assert runs[0].digest == runs[1].digest != runs[2].digest
    noise = runs[0].error[0] - simulate(AXIS, law(), REFERENCE, trials=1).error[0]
    assert 0.8e-5 < noise.std() < 1.2e-5
    assert not np.array_equal(noise, runs[0].error[1] - runs[0].error[0])


def test_a_law_that_was_used_before_begins_again() -> None:
    gated = Gate(PdIlc(kp=0.5), tolerance=1e-4)
    first = simulate(AXIS, gated, REFERENCE, trials=12)
    assert gated.state == "holding"
    assert simulate(AXIS, gated, REFERENCE, trials=12).digest == first.digest


def test_a_function_may_take_trial_disturbance_and_random_numbers() -> None:
    seen = []

    def plant(u, *, trial, disturbance, rng):
        seen.append((trial, float(disturbance[0]), float(rng.normal())))
        return AXIS.simulate(u) * (1 + 0.01 * disturbance[0])

    drawn = []
    for _ in range(2):
        seen.clear()
        result = simulate(plant, law(), REFERENCE, trials=3, disturbance=[1.0, 2.0, 3.0])
        drawn.append(list(seen))
    assert drawn[0] == drawn[1]
    assert [row[:2] for row in drawn[0]] == [(0, 1.0), (1, 2.0), (2, 3.0)]
    assert [float(record.disturbance[0]) for record in result.records] == [1.0, 2.0, 3.0]


def test_disturbances_and_initial_states_enter() -> None:
    ramp = np.linspace(0.0, 1e-3, N)
    result = simulate(
        AXIS, None, REFERENCE, trials=2, output_disturbance=lambda trial: (1 + trial) * ramp,
        initial_state=lambda trial: [0.0, 1e-3 * trial],
    )  # fmt: skip
    np.testing.assert_allclose(result.error[0, :, 0], REFERENCE - ramp)
    free = AXIS.simulate(np.zeros(N), [0.0, 1e-3])
    np.testing.assert_allclose(result.error[1, :, 0], REFERENCE - 2 * ramp - free, atol=1e-16)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_names_trial_and_sample_and_leaves_the_runs(bad: float) -> None:
    def plant(u, *, trial):
        y = AXIS.simulate(u)
        if trial == 2:
            y[17] = bad
        return y

    with pytest.raises(PlantError, match="trial 2, sample 17, output 0: the plant returned") as one:
        simulate(plant, law(), REFERENCE)
    assert (one.value.trial, one.value.sample, one.value.channel) == (2, 17, 0)
    assert len(one.value.result.records) == 2
    assert pickle.loads(pickle.dumps(one.value)).sample == 17


@pytest.mark.parametrize(
    ("keywords", "error", "words"),
    [
        ({"trials": 0}, ValueError, "trials = 0"),
        ({"noise_std": -1.0}, ValueError, "noise_std = -1.0"),
        ({"reference": None}, ValueError, "reference: needed"),
        ({"reference": [0.0, np.nan]}, ValueError, r"reference\[1\] = nan"),
        ({"plant": object()}, TypeError, "plant is a object"),
        ({"plant": CONTINUOUS}, ValueError, "continuous time: give dt_s"),
        ({"plant": np.ones((3, 4))}, ValueError, "4 columns, but the input has 200"),
        ({"plant": np.sum}, ValueError, r"output has shape \(\)"),
        ({"dt_s": 0.1}, ValueError, "dt_s = 0.1, but the plant has"),
        ({"law": 3}, TypeError, "law = 3"),
        ({"disturbance": [1.0]}, ValueError, "a row for trial 1"),
        ({"output_disturbance": np.ones(3)}, ValueError, r"output_disturbance has shape \(3,\)"),
        ({"plant": AXIS.simulate, "initial_state": [0, 0]}, ValueError, "initial_state"),
    ],
)  # fmt: skip
def test_an_unusable_argument_is_named(keywords, error, words: str) -> None:
    arguments = {"plant": AXIS, "law": law(), "reference": REFERENCE, "trials": 3, **keywords}
    with pytest.raises(error, match=words):
        simulate(**arguments)


def test_an_unusable_update_is_named() -> None:
    class Bad:
        def __init__(self, found):
            self.found = found

        def update(self, u, e, disturbance=None):
            return self.found

    for found, words in ((np.zeros(3), r"shape \(3,\)"), (np.full(N, np.nan), "sample 0.*nan")):
        with pytest.raises(LearningError, match=rf"trial 1.*{words}"):
            simulate(AXIS, Bad(found), REFERENCE)


def test_more_inputs_than_outputs() -> None:
    """A plant with two inputs and one output; the law spreads the error over both."""
    plant = np.stack([AXIS.markov(N)[:, 0, 0], 0.5 * AXIS.markov(N)[:, 0, 0]], axis=-1)[:, None, :]

    class Spread:
        def update(self, u, e, disturbance=None):
            return u + 0.4 * np.column_stack([e, e])

    result = simulate(plant, Spread(), REFERENCE, trials=12)
    assert result.input.shape == (12, N, 2)
    assert result.records[-1].tracking_rms_m < 0.1 * result.records[0].tracking_rms_m


def test_a_cell_description_is_run_by_the_controller(gantry: Path) -> None:
    result = simulate(gantry, trials=4)
    assert [record.index for record in result.records] == [0, 1, 2, 3]
    assert result.records[3].contour_inf_m < 0.2 * result.records[0].contour_inf_m
    assert result.error.shape == (4, result.n_samples, 2)
    assert result.axis_names == ("x", "y")
    assert simulate(ilc_rt.Cell.load(gantry), trials=4).digest == result.digest
    with pytest.raises(BadInputError, match="noise_std: not for a cell"):
        simulate(gantry, noise_std=1e-6)


def test_a_contour_is_measured_where_there_is_one() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, N)
    circle = 0.02 * np.column_stack([np.cos(turn) - 1.0, np.sin(turn)])
    result = simulate(AXIS.append(AXIS), PdIlc(kp=0.5), circle, trials=3)
    record = result.records[2]
    expected = np.linalg.norm(path_deviation(circle, circle - record.error_m), axis=1)
    assert record.contour_inf_m == pytest.approx(expected.max())
    assert simulate(AXIS.append(AXIS), None, circle, unit="V").records[0].contour_inf_m is None
