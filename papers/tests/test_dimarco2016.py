"""DiMarco 2016 on reduced sizes: results for any of the inputs that the thesis leaves open."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from ilc_papers.dimarco2016 import PAPER, campaign, machine
from ilc_papers.dimarco2016.reference import DT_S, INCH_M, appendix_a

pytestmark = pytest.mark.xdist_group("dimarco2016")

GOLDEN = Path(__file__).parents[2] / "tests" / "golden" / "dimarco_appendix_a.csv"
LAWS = ("pd", "pd_ilc", "flexible", "dpw", "dpw_top30")


@pytest.fixture(scope="module")
def figures():
    told = []
    found = PAPER.compute(True, told.append)
    assert len(told) == PAPER.parts[True]
    return json.loads(json.dumps(found, allow_nan=False))


def test_the_printed_program_comes_out(figures):
    with GOLDEN.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    found = figures["appendix_a"]
    assert len(found["t_s"]) == len(found["x"]) == len(rows) == 1401
    np.testing.assert_allclose(found["t_s"], [float(row["t"]) for row in rows], atol=1e-12)
    np.testing.assert_allclose(found["x"], [float(row["x"]) for row in rows], rtol=0.0, atol=1e-9)


def test_the_settings_lose_frequency_or_amplitude_and_es_neither(figures):
    found = figures["interpolation"]["settings"]
    assert found["frequency_hz"] == [8.0, 16.0]
    assert found["complete"]["frequency_ratio"][0] < 0.7
    assert found["complete"]["frequency_ratio"][1] < found["complete"]["frequency_ratio"][0]
    assert found["on_time"]["frequency_ratio"] == pytest.approx([1.0, 1.0], abs=1e-3)
    assert found["on_time"]["amplitude_ratio"][1] < 0.8 < found["on_time"]["amplitude_ratio"][0]
    assert found["exponential_sigmoid"]["frequency_ratio"][0] == pytest.approx(1.0, abs=1e-6)
    assert found["exponential_sigmoid"]["amplitude_ratio"][0] == pytest.approx(1.0, abs=1e-6)
    assert found["exponential_sigmoid"]["frequency_ratio"][1] is None
    assert "acceleration of the programmed oscillation" in found["refused"]["16 Hz"]


def test_the_index_improves_by_what_is_printed(figures):
    found = figures["interpolation"]["limits"]
    np.testing.assert_allclose(found["acceleration_max_m_s2"], np.multiply([4, 20, 200], INCH_M))
    improvement = found["improvement_over_on_time"]
    assert improvement[1] == pytest.approx(0.60, abs=0.02)
    assert improvement[2] == pytest.approx(0.12, abs=0.03)
    assert improvement[0] < 0.0
    assert min(found["improvement_over_complete"]) > 0.9
    for whole in found["whole_move_of_10_s"]:
        assert "refused" not in whole
    alpha = figures["interpolation"]["alpha"]
    totals = [cost["total"] for cost in alpha["cost"]]
    assert 0 < int(np.argmin(totals)) < len(totals) - 1, "the largest alpha is not the best"
    assert alpha["best_total"] < alpha["linear_at_15_in_s2"]["total"] / 3.0


def test_the_corner_has_the_printed_alpha_and_is_not_passed(figures):
    for row in figures["interpolation"]["corner"]["rows"]:
        assert row["alpha"] == pytest.approx(50.0, rel=1e-6)
        assert row["passes_corner_m"] <= 1e-12
        assert row["ratio"]["whole move"]["complete"]["tracking"] > 10.0
        assert row["ratio"]["whole move"]["complete"]["total"] < 1.0


def test_condition_3_4_is_met_and_not_sufficient(figures):
    found = figures["condition"]
    assert found["p1_motor"] == pytest.approx(1.6e-3, abs=0.05e-3)
    assert found["condition_3_4"] < 1.0 < found["lifted_norm"]
    assert found["rms_without_q"][-1] > 100.0 * min(found["rms_without_q"])
    assert max(found["contraction_with_q"]) < 0.5
    assert np.all(np.diff(found["rms_with_q"]) < 0.0)


@pytest.mark.parametrize("system", ["motor", "expansion"])
def test_dpw_goes_on_improving_where_pd_ilc_stays(figures, system):
    found = figures[system]
    assert set(found["last100_rms"]) == set(found["rms_seed0"]) == set(LAWS)
    median = {law: np.median(found["last100_rms"][law]) for law in LAWS}
    assert median["pd_ilc"] < 0.2 * median["pd"]
    assert median["dpw"] < 0.5 * median["pd_ilc"]
    assert median["dpw_top30"] < 1.1 * median["dpw"]
    assert median["flexible"] < median["pd_ilc"]
    gain = {
        law: np.median(np.divide(found["last100_rms"][law], found["early_rms"][law]))
        for law in ("pd_ilc", "dpw", "dpw_top30")
    }
    assert gain["pd_ilc"] > 0.9
    assert gain["dpw"] < 0.8
    assert gain["dpw_top30"] < 0.6
    # A run without a learned input is the same for all laws.
    first = {found["rms_seed0"][law][0] for law in LAWS}
    assert len(first) == 1
    share = np.array(found["final_relevance"]["share"])
    assert len(share) == len(found["temperature_seed0_k"]) - 1 == 119
    assert share.sum() == pytest.approx(1.0)
    assert np.sort(share)[-10:].sum() > 0.5, "a handful holds most of the relevance"


def test_the_loop_is_the_controller_step_by_step():
    # The same loop by hand: the product's PID, tick by tick, and the motor's own states.
    reference = appendix_a().position_m[:200, 0]
    plant = machine.motor(1.3)
    pid = machine.Pid(10.0, kd_s=1.0, dt_s=DT_S, derivative="filtered", filter_s=0.01)
    state, measured = np.zeros(3), []
    for wanted in reference:
        measured.append(float((plant.c @ state)[0]))
        state = plant.a @ state + plant.b[:, 0] * pid.step(float(wanted) - measured[-1])
    found = machine.closed_loop(1.3).simulate(reference)
    np.testing.assert_allclose(found, measured, rtol=0.0, atol=1e-9)
    assert machine.resistance_ohm(100.0) == pytest.approx(1.39)
    assert machine.expansion(100.0) == pytest.approx(1.0053)
    kelvin = machine.temperatures_k(3, 2000)
    assert np.abs(kelvin).max() <= 100.0
    assert 50.0 < kelvin.std() < 65.0, "every temperature comes about as often"
    np.testing.assert_array_equal(kelvin[:50], machine.temperatures_k(3, 50))


def test_every_campaign_is_the_same_again():
    reference = appendix_a().position_m[:300, 0]
    kelvin = machine.temperatures_k(1, 12)
    once, again = (campaign.run(machine.MOTOR, reference, kelvin, kept=[11]) for _ in range(2))
    for law in LAWS:
        assert once[law].rms == again[law].rms
        np.testing.assert_array_equal(once[law].input[11], again[law].input[11])


def test_claims_and_pictures_come_from_the_figures_alone(figures):
    claims = PAPER.claims(figures)
    assert len({claim.what for claim in claims}) == len(claims)
    # A statement that does not follow from the print says why.
    assert all(claim.remark for claim in claims if claim.holds is False)
    failing = {claim.what for claim in claims if claim.holds is False}
    assert failing == {
        "J of E/S at its best alpha over the linear interpolator's, same acceleration",
        "J, linear over E/S, whole move, the largest of all jerk limits",
        "lifted norm of PD-ILC without a Q filter",
        "RMS error without a Q filter, last run over the least",
    }
    assert len({picture.stem for picture in PAPER.pictures}) == len(PAPER.pictures)
    for picture in PAPER.pictures:
        figure = Figure(figsize=(8, 4), layout="constrained")
        picture.draw(figures, figure)
        assert figure.axes
        assert all(axes.lines or axes.collections for axes in figure.axes)
