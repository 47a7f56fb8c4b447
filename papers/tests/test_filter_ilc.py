"""Statements of the filter-based paper that do not depend on what its print leaves open."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.figure import Figure

from ilc_papers.filter_ilc import (
    PAPER,
    bench,
    convergence,
    disturbance,
    filters,
    mechanisms,
)
from ilc_rt import ErrorFeedforwardIlc

if TYPE_CHECKING:
    from ilc_papers.paper import Figures

pytestmark = pytest.mark.xdist_group("filter_ilc")

CASES = ["unfiltered", "zero_phase", "switched", "gate", "ladder", "disturbance", "feedforward"]


@pytest.fixture(scope="module")
def converging() -> Figures:
    """Return what the analysis says."""
    return convergence.compute(True, lambda _: None)


@pytest.fixture(scope="module")
def filtered() -> Figures:
    """Return learning without filter, with one, and with a switched one."""
    return filters.compute(True, lambda _: None)


@pytest.fixture(scope="module")
def gated() -> Figures:
    """Return gate, ladder and repeatability."""
    return mechanisms.compute(True, lambda _: None)


@pytest.fixture(scope="module")
def disturbed() -> Figures:
    """Return disturbance, feed-forward and saturation."""
    return disturbance.compute(True, lambda _: None)


@pytest.fixture(scope="module")
def figures(converging: Figures, filtered: Figures, gated: Figures, disturbed: Figures) -> Figures:
    """Return all of it."""
    return converging | filtered | gated | disturbed


def test_the_motion_is_the_x_axis_of_the_butterfly() -> None:
    """4 mm/s at most along the path, within the size of the curve."""
    moves = bench.motion()
    assert abs(moves.velocity_m_s).max() == pytest.approx(0.004, rel=1e-3)
    assert np.ptp(moves.position_m) == pytest.approx(0.0107, abs=0.0002)
    steps = np.diff(moves.position_m) / bench.DT_S
    assert abs(steps - moves.velocity_m_s[:-1]).max() < 2e-4
    assert (moves.position_m[:50] == 0.0).all()
    assert moves.velocity_m_s[-1] == 0.0


def test_the_loop_is_gain_round_the_corrected_plant() -> None:
    """One run against the difference equations of plant and controller, sample by sample."""
    moves = bench.motion()
    stand = bench.Bench(moves, noise_m=0.0)
    learned = 1e-4 * np.sin(0.01 * np.arange(moves.n_samples))
    y, out, e = np.zeros(moves.n_samples), np.zeros(moves.n_samples), np.zeros(moves.n_samples)
    for k in range(moves.n_samples):
        before = [y[k - i] if k >= i else 0.0 for i in (1, 2)]
        drive = [out[k - i] if k >= i else 0.0 for i in (1, 2)]
        y[k] = 1.85 * before[0] - 0.85 * before[1] + 0.00475 * (drive[0] + drive[1])
        e[k] = moves.position_m[k] - y[k]
        out[k] = learned[k] + 2.0 * e[k]
    np.testing.assert_allclose(stand.run(learned), e, atol=1e-9 * abs(e).max())


def test_the_critical_frequency_is_that_of_eq_9(converging: Figures) -> None:
    told = converging["convergence"]
    z = np.exp(2j * np.pi * np.array(told["frequency_hz"])[1:-1] * bench.DT_S)
    plant = 0.00475 / z * (1 + 1 / z) / ((1 - 1 / z) * (1 - 0.85 / z))
    for case, lead in ((told, 1), (told["lead_5"], 5)):
        expected = abs(1 - 0.5 * z**lead * plant / (1 + 2.0 * plant))
        np.testing.assert_allclose(case["contraction"][1:-1], expected, atol=1e-9)
        above = np.array(told["frequency_hz"])[1:-1][expected >= 1.0]
        step_hz = told["frequency_hz"][1]
        assert case["critical_frequency_hz"] == pytest.approx(above[0], abs=step_hz)
    assert 10.0 < told["critical_frequency_hz"] < 12.0
    assert told["lead_5"]["critical_frequency_hz"] > 50.0


def test_the_analysis_tells_which_cutoff_is_possible(converging: Figures) -> None:
    """50 Hz with the paper's lead is refused in words, with the critical frequency."""
    one, five = converging["convergence"]["told"]
    assert (one["lead"], one["cutoff_hz"], one["converges"]) == (1, 50.0, False)
    assert "each run multiplies the error by 1.06" in one["why"]
    assert "from 11.07" in one["why"]
    assert (five["lead"], five["cutoff_hz"], five["converges"]) == (5, 50.0, True)


def test_without_filter_the_error_falls_and_then_rises(filtered: Figures) -> None:
    rmse = np.array(filtered["unfiltered"]["rmse_m"])
    turn = int(rmse.argmin())
    assert 10 < turn < 30
    assert (np.diff(rmse[:turn]) < 0.0).all()
    assert (np.diff(rmse[turn + 2 :]) > 0.0).all()
    assert rmse[-1] > 2.0 * rmse[turn]


def test_it_rises_without_noise_too() -> None:
    """Repeating errors above the critical frequency grow."""
    course = bench.Bench(bench.motion(), noise_m=0.0).learn(ErrorFeedforwardIlc(bench.GAIN), 35)
    assert course.rmse_m[-1] > 1.5 * min(course.rmse_m)


def test_with_10_hz_it_falls_from_run_to_run(filtered: Figures) -> None:
    rmse = filtered["zero_phase"]["rmse_m"]
    assert filters.falls(rmse)
    assert rmse[-1] < 0.02 * rmse[0]
    assert rmse[-1] < 0.7 * min(filtered["unfiltered"]["rmse_m"])
    assert not filters.falls(filtered["unfiltered"]["rmse_m"])


def test_the_switched_filter_helps_where_the_motion_is_fast(filtered: Figures) -> None:
    wide = filtered["switched"]
    assert set(wide["segments"]["cutoffs_hz"]) == {10.0, 50.0}
    assert filters.falls(wide["rmse_m"])
    assert wide["fast_rmse_m"] < 0.6 * wide["low_pass"]["fast_rmse_m"]
    assert wide["slow_rmse_m"] < 1.1 * wide["low_pass"]["slow_rmse_m"]
    # With the paper's lead only the fast parts diverge.
    assert not filters.falls(wide["lead_1"]["rmse_m"])
    assert wide["lead_1"]["fast_rmse_m"] > 4.0 * wide["lead_1"]["slow_rmse_m"]


def test_a_gate_holds_takes_back_and_resumes(gated: Figures) -> None:
    gate = gated["gate"]
    begun = gate["states"].index("holding") + 1
    held = np.array(gate["rmse_m"][begun:])
    assert len(held) > 20
    assert held.max() < 1.05 * gate["tolerance_m"]
    assert held.max() < 1.02 * held.min()
    back = gate["rollback"]
    taken = back["states"].index("rolled_back")
    assert back["rmse_m"][taken] > mechanisms.GROWTH * min(back["rmse_m"])
    assert set(back["states"][taken:]) == {"rolled_back"}
    assert max(back["rmse_m"][taken + 1 :]) < 1.05 * min(back["rmse_m"])
    resumed, step_run = gate["resume"], gate["resume"]["step_run"]
    assert resumed["states"][step_run - 1] == "holding"
    assert resumed["states"][step_run] == "learning"
    assert resumed["states"][-1] == "holding"
    assert resumed["rmse_m"][step_run] > 3.0 * gate["tolerance_m"]
    assert resumed["rmse_m"][-1] < 1.5 * gate["tolerance_m"]


def test_the_noise_that_a_ladder_learns_falls_with_the_root_of_its_repeats(
    gated: Figures,
) -> None:
    learned = gated["ladder"]["learned_noise"]
    expected = learned["noise_rms"][0] / np.sqrt(learned["repeats"])
    np.testing.assert_allclose(learned["noise_rms"], expected, rtol=0.15)
    assert gated["ladder"]["noise_rms_m"] == pytest.approx(
        bench.NOISE_M / np.sqrt(mechanisms.REPEATS), rel=0.05
    )
    rmse = np.array(gated["ladder"]["rmse_m"])
    same = rmse.reshape(-1, mechanisms.REPEATS)
    assert (np.ptp(same, axis=1) < 0.01 * same.mean(axis=1)).all()
    assert (np.diff(same.mean(axis=1)) < 0.0).all()


def test_the_runs_repeat_as_well_as_the_paper_asks(gated: Figures) -> None:
    check = gated["repeatability"]
    assert check["largest_rms_m"] - check["least_rms_m"] < 0.3e-6
    assert check["learnable"] > 0.999
    assert check["spread_rms_m"] < 3.0 * bench.NOISE_M


def test_a_repetitive_disturbance_is_learned_away(disturbed: Figures) -> None:
    rmse = np.array(disturbed["disturbance"]["rmse_m"])
    begins = disturbance.DISTURBANCE_RUN
    assert rmse[begins] > 20.0 * rmse[begins - 1]
    assert rmse[begins + 39] < 0.02 * rmse[begins]
    assert disturbed["disturbance"]["max_m"][begins + 39] < 5e-6
    assert filters.falls(disturbed["disturbance"]["rmse_m"][begins:])


def test_feed_forward_helps_and_learning_more(disturbed: Figures) -> None:
    fed = disturbed["feedforward"]
    assert fed["max_m"][0] < 0.5 * fed["without_max_m"]
    assert fed["rmse_m"][-1] < 0.5 * fed["rmse_m"][0]
    assert filters.falls(fed["rmse_m"])


def test_the_guard_keeps_the_learned_signal_within_the_drive(disturbed: Figures) -> None:
    saturated = disturbed["saturation"]
    assert max(saturated["input_max"]) <= saturated["limit"]
    assert saturated["unguarded_input_max"][-1] > 1.5 * saturated["limit"]
    assert saturated["limited_samples"][-1] > 0
    assert saturated["limited_samples"][0] == 0


@pytest.mark.parametrize("name", CASES)
def test_each_case_has_its_errors_of_forty_runs(figures: Figures, name: str) -> None:
    rmse, largest = (np.array(figures[name][key]) for key in ("rmse_m", "max_m"))
    assert len(rmse) == len(largest) >= 40
    assert (rmse < largest).all()
    assert (rmse > 0.5 * bench.NOISE_M).all()


def test_what_does_not_hold_is_known(figures: Figures) -> None:
    fails = [claim.what for claim in PAPER.claims(figures) if claim.holds is False]
    assert fails == [
        "the loop of eq. 3 as printed is stable",
        "the printed filter passes what is constant",
        "a filter of 50 Hz converges, lead 1",
        "switched 10/50/10 Hz with a lead of one sample",
    ]
    assert figures["convergence"]["printed"]["filter_gain"] == pytest.approx(1.23, abs=0.005)


def test_every_picture_draws_something(figures: Figures) -> None:
    """From the figures alone, as read back from JSON."""
    restored = json.loads(json.dumps(figures, allow_nan=False))
    for picture in PAPER.pictures:
        figure = Figure()
        picture.draw(restored, figure)
        assert all(axes.lines for axes in figure.axes), picture.stem
