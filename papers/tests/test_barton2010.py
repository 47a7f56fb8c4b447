"""Statements of Barton's thesis that hold, on reduced sizes."""

import json
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from ilc_papers.barton2010 import PAPER, SECTIONS, printed
from ilc_papers.barton2010.agents import AXES, FORMATION
from ilc_papers.barton2010.positioning import axis_controller, axis_model, stage
from ilc_papers.barton2010.raster import R, S, raster_m, time_varying_law
from ilc_papers.barton2010.servo_system import servo
from ilc_rt import NormOptimalIlc

pytestmark = pytest.mark.xdist_group("barton2010")

GOLDEN = Path(__file__).parents[2] / "tests" / "golden" / "barton2010_appendix_i.json"
NAMES = (
    "servo",
    "robustness",
    "raster",
    "uncertain",
    "bursts",
    "formation",
    "appendix_i",
    "dissimilar",
)


def section(name):
    return import_module(f"ilc_papers.barton2010.{name}")


@cache
def found(name):
    """Return the figures of a section, each computed by the first test that asks for them."""
    told = []
    figures = section(name).compute(True, told.append)
    assert told
    # Plain JSON only, or the pages could not be regenerated from the file.
    return json.loads(json.dumps(figures, allow_nan=False))


def rises(values):
    return all(after > before for before, after in pairwise(values))


def test_the_paper_has_all_sections():
    assert PAPER.name == "barton2010"
    assert {section(name) for name in NAMES} <= set(SECTIONS)


@pytest.mark.parametrize("name", NAMES)
def test_pictures_are_drawn_from_the_figures(name):
    for picture in section(name).PICTURES:
        figure = Figure()
        picture.draw({name: found(name)}, figure)
        assert figure.axes
        assert all(axes.get_ylabel() for axes in figure.axes), picture.stem
        assert figure.axes[-1].get_xlabel(), picture.stem


def test_only_these_statements_do_not_hold():
    refuted = [
        claim.what
        for name in NAMES
        for claim in section(name).claims(found(name))
        if claim.holds is False
    ]
    expected = (
        "error under noise by (3.24)",
        "r does not matter for robust convergence",
        "lemma 2, counterexample",
        "largest closed-loop pole with the controller (5.13) as printed",
        "E_d1 at sample 2",
        "contour error without the filter",
    )
    assert len(refuted) == len(expected)
    for what, start in zip(refuted, expected, strict=True):
        assert what.startswith(start)


def test_weights_of_error_and_input_set_the_converged_error():
    q, s = found("servo")["q"], found("servo")["s"]
    assert q["value"] == [1.0, 0.5, 0.1, 0.001]
    assert rises(q["converged_rms"])
    assert s["value"] == [10.0, 1.0, 0.1, 0.01, 0.001]
    assert rises(s["converged_rms"][::-1])
    for sweep in (q, s):
        starts = [errors[0] for errors in sweep["rms"]]
        assert len(set(starts)) == 1
        assert all(errors[-1] < errors[0] for errors in sweep["rms"])


def test_the_weight_of_the_change_sets_the_speed_alone():
    r = found("servo")["r"]
    assert r["value"] == [0.0, 0.1, 1.0, 10.0, 100.0]
    np.testing.assert_allclose(r["converged_rms"], r["converged_rms"][0], rtol=1e-9)
    assert r["monotonic_factor"][0] < 1e-9
    assert rises(r["monotonic_factor"])
    # Deadbeat: the first update is the last that changes anything.
    np.testing.assert_allclose(r["rms"][0][1:], r["converged_rms"][0], rtol=1e-9)
    assert rises([errors[5] for errors in r["rms"][1:]])


@pytest.mark.parametrize("name", ["q", "s", "r"])
def test_monotonic_factors_are_those_of_the_dense_solution(name):
    lifted = servo(100).plant.lifted(100)
    sweep = found("servo")[name]
    for value, factor, observed in zip(
        sweep["value"], sweep["monotonic_factor"], sweep["observed_factor"], strict=True
    ):
        q, s, r = (value if name == each else 1.0 for each in "qsr")
        hessian = q * lifted.T @ lifted + (s + r) * np.eye(100)
        expected = np.linalg.norm(np.linalg.solve(hessian, r * np.eye(100)), 2)
        assert factor == pytest.approx(expected, abs=1e-6)
        assert factor < 1.0
        assert observed <= factor + 1e-6


def test_noise_is_expected_from_the_covariance():
    noise = found("servo")["noise"]
    assert noise["noise_std"] ** 2 == pytest.approx(1e-6)
    assert rises(noise["expected_rms"][::-1])
    np.testing.assert_allclose(noise["monte_carlo_rms"], noise["expected_rms"], rtol=0.03)
    # (3.24) assumes that the sign of the disturbance alternates from run to run, and then is exact.
    assert max(noise["alternating_difference"]) < 1e-7
    assert noise["equation_3_24_rms"][0] > 1.05 * noise["expected_rms"][0]


def test_lemma_2_fails_in_the_2_norm_and_holds_in_a_weighted_one():
    robustness = found("robustness")
    without_r = [row[0] for row in robustness["worst_factor"]]
    assert max(without_r) < 1.0
    assert rises(without_r[::-1])
    example = robustness["counterexample"]
    assert example["lemma_1_norm"] < 1.0 < example["norm"]
    assert example["input_norm"][1] == pytest.approx(example["norm"], rel=1e-6)
    assert example["input_norm"][-1] < 1e-6
    assert example["weighted_norm"] < 1.0
    assert example["spectral_radius"] < 1.0
    worst, bound = np.array(robustness["worst_factor"]), np.array(robustness["bound"])
    assert np.all(worst <= bound + 1e-9)
    np.testing.assert_allclose(worst[:, 0], bound[:, 0], rtol=1e-6)


def test_the_guidelines_make_the_axis_robust():
    guidelines = found("robustness")["guidelines"]
    assert guidelines["s"] > 0.0
    assert guidelines["robust_factor"] < 1.0 <= guidelines["without_s"]
    assert guidelines["monotonic_factor"] < 1.0


def test_the_controller_is_stable_as_it_is_read_and_not_as_printed():
    closed = axis_model().process_sensitivity(axis_controller())
    assert np.abs(closed.poles()).max() < 1.0
    assert found("raster")["printed_controller_largest_pole"] > 1.0


@pytest.mark.parametrize("key", ["contour_rms_m", "linearised_rms_m"])
def test_time_varying_is_below_time_invariant_below_feedback(key):
    raster = found("raster")
    feedback, invariant, varying = (
        raster[name][key] for name in ("feedback", "time_invariant", "time_varying")
    )
    assert len(feedback) == len(invariant) == len(varying)
    assert feedback[0] == invariant[0] == varying[0] == feedback[-1]
    assert varying[-1] < invariant[-1] < feedback[-1]


def test_without_schedules_the_time_varying_weight_is_that_of_the_contour():
    table = stage(raster_m(0.002, 0.001, 480))
    n_samples = len(table.reference_m)
    law = time_varying_law(table, np.ones(n_samples), np.zeros(n_samples))
    contour = NormOptimalIlc.contour(table.plant, table.reference_m, q=0.0, contour=1.0, s=S, r=R)
    u = np.zeros_like(table.first_error_m)
    expected = contour.update(u, table.first_error_m)
    np.testing.assert_allclose(law.update(u, table.first_error_m), expected, atol=1e-12)


def test_corners_are_tighter_where_the_weight_is_high():
    raster = found("raster")
    assert len(raster["corner_samples"]) == 6
    assert np.all(
        np.array(raster["time_varying"]["corner_m"]) < raster["time_invariant"]["corner_m"]
    )
    assert max(raster["sigma"]) == pytest.approx(30.0, rel=0.02)
    assert max(raster["gamma"]) == pytest.approx(1.0, rel=1e-3)


def test_uncertain_dynamics_need_the_high_weight_where_they_are():
    uncertain = found("uncertain")
    low, high, varying = (
        uncertain[name]["contour_rms_m"] for name in ("low_s", "high_s", "time_varying")
    )
    assert uncertain["factor_high"] < 1.0 < uncertain["factor_low"]
    assert low[-1] > 10.0 * low[0]
    assert varying[-1] < high[-1] < high[0]


def test_bursts_need_the_high_weight_where_they_are():
    low, high, varying = (found("bursts")[name] for name in ("low_r", "high_r", "time_varying"))
    assert varying["past_noise_m"] < 0.75 * low["past_noise_m"]
    assert varying["converged_rms_m"] < low["converged_rms_m"]
    assert low["settled_at"] <= varying["settled_at"] < high["settled_at"]


def test_each_objective_serves_what_it_weighs():
    formation = found("formation")
    assert formation["rank_of_f"] == 4
    start = formation["individual"]["tracking_rms_m"][0][0]
    x1 = {
        name: formation[name]["tracking_rms_m"][0][-1]
        for name in ("individual", "formation", "combined")
    }
    assert x1["individual"] < x1["combined"] < 0.05 * start
    # Identical references: a zero input keeps the formation, which is its only objective.
    assert formation["formation"]["largest_input"] < 1e-9
    assert x1["formation"] == pytest.approx(start)
    shape = {
        name: max(row[-1] for row in formation[name]["formation_rms_m"])
        for name in ("individual", "combined")
    }
    assert shape["combined"] < shape["individual"]
    assert max(formation["monotonic_factor"].values()) < 1.0


def test_agents_without_disturbance_keep_their_offset():
    rows = found("formation")["disturbed"]["formation"]["formation_rms_m"]
    h1, h2, h3 = (np.mean(row[10:]) for row in rows[3:])
    assert h2 < 0.2 * min(h1, h3)


def test_the_printed_tables_come_out_to_the_printed_digits():
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    example = found("appendix_i")
    assert (
        np.shape(example["u"]) == np.shape(example["e"]) == np.shape(example["formation"]) == (6, 4)
    )
    for row, name in zip(example["u"], AXES, strict=True):
        assert np.round(row, 4).tolist() == golden["input"][name][:-1]
        assert printed.INPUT[name] == golden["input"][name]
    for row, name in zip(example["e"], AXES, strict=True):
        assert np.round(row, 4).tolist() == golden["error"][name][1:]
        assert printed.ERROR[name] == golden["error"][name]
    for row, name in zip(example["formation"], FORMATION, strict=True):
        expected = golden["formation_error"][name]
        np.testing.assert_allclose(
            row, expected["values"][1:], atol=0.5 * 10.0 ** -expected["decimals"]
        )
    against = example["printed"]
    assert against["u"]["in_last_digit"] <= 0.5
    assert against["e"]["in_last_digit"] <= 0.5
    assert against["formation"]["in_last_digit"] <= 0.5
    assert 0.5 < against["formation"]["misprint_in_last_digit"] < 1.5


def test_a_fast_axis_relieves_a_slow_one():
    nominal, coupled = found("dissimilar")["nominal"], found("dissimilar")["coupled"]
    assert nominal["weighted_rms"][0] == coupled["weighted_rms"][0]
    assert coupled["weighted_rms"][-1] < 0.7 * nominal["weighted_rms"][-1]
    assert coupled["peak_command"] < 0.8 * nominal["peak_command"]
    assert coupled["y_error_rms_mm"][-1] > nominal["y_error_rms_mm"][-1]
    # The 14 % of the testbed are not in the printed data.
    assert coupled["plain_rms"][-1] > nominal["plain_rms"][-1]


@pytest.mark.parametrize("name", ["raster", "uncertain", "bursts"])
def test_each_way_of_weighing_in_time_is_there_beside_feedback(name):
    """The same names in all three sections, one figure per run, feedback without a trend."""
    ways = [
        found(name)[way]["contour_rms_m"] for way in ("feedback", "time_invariant", "time_varying")
    ]
    assert len({len(way) for way in ways}) == 1
    assert ways[0][-1] == pytest.approx(ways[0][0], rel=0.2)
    assert ways[2][-1] < ways[0][-1]
