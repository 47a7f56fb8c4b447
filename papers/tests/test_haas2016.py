"""Statements of Haas et al. that do not depend on what their print leaves open."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from ilc_papers.haas2016 import PAPER, constrained, gantry, positioning

pytestmark = pytest.mark.xdist_group("haas2016")

TIMES = list(positioning.SAMPLE_TIMES_S)
BOUNDS = list(constrained.BOUNDS)


@pytest.fixture(scope="module")
def figures() -> dict[str, Any]:
    """Return the paper's figures on reduced sizes."""
    told: list[str] = []
    found = PAPER.compute(True, told.append)
    assert len(told) == PAPER.parts[True]
    return found


def test_the_program_is_that_of_fig_2() -> None:
    """0 to 100 to 50 mm at 0.2 and 0.1 m/s, at rest for 0.1 s before and 0.2 s between."""
    for dt_s in positioning.SAMPLE_TIMES_S.values():
        reference_m = positioning.program(dt_s)
        assert len(reference_m) == round(1.7 / dt_s) + 1
        speed = np.diff(reference_m) / dt_s
        assert speed.max() == pytest.approx(0.2, rel=1e-9)
        assert speed.min() == pytest.approx(-0.1, rel=1e-9)
        assert (reference_m[: round(0.1 / dt_s)] == 0.0).all()
        rest = np.flatnonzero(np.isclose(reference_m, 0.1, rtol=0.0, atol=1e-12))
        assert (len(rest) - 1) * dt_s == pytest.approx(0.2, abs=2.5 * dt_s)
        assert reference_m[-1] == 0.05


@pytest.mark.parametrize("name", TIMES)
def test_co_ilc_falls_in_every_run_and_below_pd_ilc(figures: dict[str, Any], name: str) -> None:
    runs = figures["positioning"][name]
    co, pd, causal = (
        np.array(runs[f"{law}_inf_m"]) for law in ("co", "pd_zero_phase", "pd_causal")
    )
    assert len(co) == len(pd) == len(causal) == 51
    assert co[0] == pd[0] == causal[0]
    assert (np.diff(co) < 0.0).all()
    assert (co[1:] < pd[1:]).all()
    assert (co[1:] < causal[1:]).all()
    # The ramp's lag, 2 delta v / w0, is the smallest error of an axis without learning.
    assert co[0] > 0.5 * 0.2 / 157.0
    assert co[50] < 1e-3 * co[0]


def test_pd_ilc_is_stable_at_2_ms_and_diverges_at_4_ms(figures: dict[str, Any]) -> None:
    two = np.array(figures["positioning"]["2ms"]["pd_zero_phase_inf_m"])
    assert two[-1] < 0.01 * two[0]
    assert two[-1] < 2.0 * two.min()
    for law in ("pd_zero_phase", "pd_causal"):
        four = np.array(figures["positioning"]["4ms"][f"{law}_inf_m"])
        assert four[-1] > 1e3 * four[0]
        assert (np.diff(four[20:]) > 0.0).all()


def test_a_causal_filter_stalls_and_then_grows(figures: dict[str, Any]) -> None:
    causal = np.array(figures["positioning"]["2ms"]["pd_causal_inf_m"])
    assert causal.min() > 10.0 * min(figures["positioning"]["2ms"]["pd_zero_phase_inf_m"])
    assert causal.argmin() < 25
    assert causal[-1] > 1.5 * causal.min()


def test_the_law_is_the_dense_quadratic_program() -> None:
    """One update of eq. (9) to (12), with lifted matrices."""
    dt_s = positioning.SAMPLE_TIMES_S["4ms"]
    model, reference_m = positioning.axis(dt_s), positioning.program(dt_s)
    n = len(reference_m) - 1
    e = reference_m - model.simulate(positioning.set_points(reference_m))
    operator = model.lifted(n + 1)[1:, :n]
    rate = 3.0 * np.diff(np.eye(n), axis=0)
    change = np.linalg.solve(operator.T @ operator + rate.T @ rate, operator.T @ e[1:])
    law = positioning.laws(dt_s, n + 1)["co"]
    found = law.update(np.zeros(n + 1), e)
    np.testing.assert_allclose(found[:n], change, atol=1e-9 * abs(change).max())
    left = e[1:] - operator @ change
    assert figures_of_run_1(dt_s) == pytest.approx(max(abs(left).max(), abs(e[0])), rel=1e-6)


def figures_of_run_1(dt_s: float) -> float:
    """Return the largest error after one update, simulated."""
    model, reference_m = positioning.axis(dt_s), positioning.program(dt_s)
    out = positioning.set_points(reference_m)
    law = positioning.laws(dt_s, len(out))["co"]
    u = law.update(np.zeros_like(out), reference_m - model.simulate(out))
    return float(abs(reference_m - model.simulate(out + u)).max())


@pytest.mark.parametrize("name", [*BOUNDS, "all"])
def test_each_bound_is_held_and_costs_nothing_where_it_is_not_reached(
    figures: dict[str, Any], name: str
) -> None:
    told = figures["constrained"]
    free = np.array(told["free"]["co_inf_m"])
    active, inactive = told[name]["active"], told[name]["inactive"]
    for case in (active, inactive):
        assert case["solved"]
        for held in case.get("bounds", {"": case}).values():
            assert held["violation_share"] <= constrained.SLACK
    for held in inactive.get("bounds", {"": inactive}).values():
        assert not held["bound_reached"]
        assert held["reached_largest"] > held["reached_least"]
    np.testing.assert_allclose(inactive["co_inf_m"], free, atol=1e-6 * free[0])
    reached = [held["bound_reached"] for held in active.get("bounds", {"": active}).values()]
    assert any(reached)
    assert active["differs_from_free_m"] > 0.0
    # Learning continues within any of these bounds.
    assert active["co_inf_m"][-1] < 0.5 * free[0]


def test_the_tool_needs_a_measurement_at_the_tool(figures: dict[str, Any]) -> None:
    bench = figures["gantry"]
    for key in ("tracking_inf_m", "contour_inf_m"):
        none, enc, kgm = (bench[name][key] for name in ("none", "enc", "kgm"))
        assert none[0] == enc[0] == kgm[0]
        assert len(none) == len(enc) == len(kgm) >= 11
        assert kgm[9] < enc[9] < none[9]
        assert kgm[9] < 0.2 * none[9]
    enc = bench["enc"]["contour_inf_m"]
    assert 1 <= int(np.argmin(enc)) < 6
    assert enc[-1] > 1.2 * min(enc)
    # The encoders themselves see it fall.
    assert bench["enc"]["encoder_contour_inf_m"][9] < 0.2 * bench["enc"]["encoder_contour_inf_m"][0]


def test_without_learning_every_run_is_alike(figures: dict[str, Any]) -> None:
    none = np.array(figures["gantry"]["none"]["tracking_inf_m"])
    np.testing.assert_allclose(none, none[0], rtol=1e-3)


def test_the_gantry_gives_the_same_figures_again(figures: dict[str, Any]) -> None:
    """Lock-step: no clock, no chance."""
    again = gantry.compute(True, lambda _: None)
    assert again["gantry"] == figures["gantry"]
    assert again["path"] == figures["path"]


def test_every_statement_but_one_holds(figures: dict[str, Any]) -> None:
    """The one is that PD-ILC is stable, which it is not at 4 ms."""
    fails = [claim.what for claim in PAPER.claims(figures) if claim.holds is False]
    assert fails == ["PD-ILC is stable, 4 ms"]


def test_every_picture_draws_something(figures: dict[str, Any]) -> None:
    """From the figures alone, as read back from JSON."""
    restored = json.loads(json.dumps(figures, allow_nan=False))
    for picture in PAPER.pictures:
        figure = Figure()
        picture.draw(restored, figure)
        assert all(axes.lines for axes in figure.axes), picture.stem
