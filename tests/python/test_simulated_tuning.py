"""Parameters chosen by simulation on several plants: the worst plant decides."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from ilc_rt import (
    LearningError,
    NormOptimalIlc,
    PdIlc,
    discretize,
    grid,
    second_order,
    simulate,
    tune_by_simulation,
)

N = 60
MOTION = 0.01 * np.hanning(N)
PLANTS = [discretize(second_order(w, 0.7), 0.004) for w in (50.0, 60.0, 75.0)]


def with_weight(r: float) -> NormOptimalIlc:
    """Return the law of the middle plant; importable, for other processes."""
    return NormOptimalIlc(PLANTS[1], N, r=r)


def test_the_case_with_the_smallest_error_on_its_worst_plant_is_chosen() -> None:
    found = tune_by_simulation(PdIlc, grid(kp=[0.1, 0.3, 0.6, 3.0]), PLANTS, MOTION, trials=6)
    for case, value in zip(found.cases.cases, found.cases.values, strict=True):
        left = []
        for plant in PLANTS:
            rms = simulate(plant, PdIlc(**case), MOTION, trials=6).figures()["tracking_rms_m"]
            left.append(rms[-1] / rms[0])
        assert value["worst"] == max(left)
    held = [value for value in found.cases.values if value["growth"] <= 1.2]
    assert 0 < len(held) < 4
    assert found.worst == min(value["worst"] for value in held)
    assert found.law.parameters["kp"] == found.parameters["kp"]
    assert f"of 4 cases {len(held)} grow by no more than 20 %" in str(found)


def test_other_processes_choose_the_same_bit_for_bit() -> None:
    cases = grid(r=[1e-3, 1e-2, 1e-1])
    options = {"trials": 5, "noise_std": 1e-5, "seed": 4}
    serial = tune_by_simulation(with_weight, cases, PLANTS, MOTION, **options)
    with ProcessPoolExecutor(2) as executor:
        parallel = tune_by_simulation(
            with_weight, cases, PLANTS, MOTION, executor=executor, **options
        )
    assert parallel.cases.values == serial.cases.values
    assert parallel.parameters == serial.parameters
    other = tune_by_simulation(with_weight, cases, PLANTS, MOTION, **{**options, "seed": 5})
    assert other.cases.values != serial.cases.values


def test_a_case_that_cannot_be_made_or_diverges_is_not_chosen() -> None:
    found = tune_by_simulation(with_weight, grid(r=[-1.0, 0.05]), PLANTS, MOTION, trials=4)
    assert found.parameters == {"r": 0.05}
    assert "plant 0" in found.cases.values[0]["why"]
    with pytest.raises(LearningError, match="in every case an error grows"):
        tune_by_simulation(PdIlc, grid(kp=[20.0, 30.0]), PLANTS, MOTION, trials=40)
    for wrong, error in (
        ({"trials": 1}, ValueError), ({"growth_max": 0.5}, ValueError), ({"plants": []}, TypeError),
        ({"make": None}, TypeError), ({"cases": []}, ValueError),
    ):  # fmt: skip
        given = {"make": PdIlc, "cases": grid(kp=[0.5]), "plants": PLANTS, "reference": MOTION}
        with pytest.raises(error, match=next(iter(wrong))):
            tune_by_simulation(**{**given, **wrong})
