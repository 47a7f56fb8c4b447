"""Chapters 7 and 8 of [barton2010], reduced: results for any choice left open by the print."""

import json

import numpy as np
import pytest

from ilc_papers.barton2010 import delta, delta_leg, mechanisms, mechanisms_law
from ilc_papers.barton2010.mechanisms import fall
from ilc_papers.barton2010.mechanisms_cell import build, tools_m
from ilc_rt import NormOptimalIlc
from ilc_rt.kinematics import Delta

pytestmark = pytest.mark.xdist_group("mechanisms")


def silent(_: str) -> None:
    """Report nothing."""


@pytest.fixture(scope="module")
def kinematics():
    return delta.compute(True, silent)


@pytest.fixture(scope="module")
def learned():
    return mechanisms.compute(True, silent)


def test_the_figures_are_plain_json_and_every_picture_can_be_drawn(kinematics, learned):
    from matplotlib.figure import Figure

    figures = {"delta": kinematics, "mechanisms": learned}
    figures = json.loads(json.dumps(figures, allow_nan=False))
    for picture in [*delta.PICTURES, *mechanisms.PICTURES]:
        figure = Figure()
        picture.draw(figures, figure)
        assert figure.axes, picture.stem


def test_both_mechanisms_come_back_from_every_place(kinematics):
    for each in kinematics["geometries"].values():
        assert each["n_inside"] > 1000
        assert each["position_error_m"] < 1e-12
        assert each["angle_error_rad"] < 1e-9


def test_the_finite_difference_goes_to_the_analytic_jacobian_with_its_step(kinematics):
    for each in kinematics["geometries"].values():
        found = each["finite_difference"]
        slope = np.polyfit(np.log(found["step_rad"]), np.log(found["relative_error"]), 1)[0]
        assert slope == pytest.approx(1.0, abs=0.05)


def test_the_printed_jacobian_is_a_difference_over_a_large_step(kinematics):
    printed = kinematics["geometries"]["appendix C"]["printed_jacobian"]
    assert printed["largest_difference_m"] < 1e-5
    assert printed["step_rad"] > 0.4


def test_a_leg_is_identified_by_what_it_is_made_of(kinematics):
    found = kinematics["identification"]
    for name, true in found["true"].items():
        assert found["linear"][name] == pytest.approx(true, rel=1e-6)
        assert found["pendulum"][1][name] == pytest.approx(true, rel=0.02)


def test_the_linearised_leg_is_the_printed_model():
    small = delta_leg.pendulum(0.0)(np.full(400, 1e-6))
    assert np.allclose(small, delta_leg.printed_model().simulate(np.full(400, 1e-6)), atol=1e-10)


@pytest.mark.parametrize("path", ["raster", "spiral"])
def test_individual_learning_serves_every_agent(learned, path):
    for agent in learned[path]["individual"]["agents"]:
        assert fall(agent["tracking_rms_m"]) > 5.0
    # The rest that passes the printed filter is removed too, and the contour error with it.
    for agent in learned["unfiltered"][path]["individual"]["agents"]:
        assert fall(agent["tracking_rms_m"]) > 30.0
        assert fall(agent["contour_rms_m"]) > 5.0


@pytest.mark.parametrize("path", ["raster", "spiral"])
@pytest.mark.parametrize("case", ["formation", "combined"])
def test_coordinated_learning_keeps_the_formation(learned, path, case):
    assert fall(learned[path][case]["formation_rms_m"]) > 3.0


@pytest.mark.parametrize("path", ["raster", "spiral", "disturbed"])
def test_the_formation_alone_does_not_serve_tracking(learned, path):
    """Equal references: an error common to all agents has no cost, so it stays."""
    for agent in learned[path]["formation"]["agents"]:
        assert fall(agent["tracking_rms_m"]) < 1.5
    for agent in learned[path]["combined"]["agents"]:
        assert fall(agent["tracking_rms_m"]) > 3.0


def test_neighbours_come_to_meet_a_disturbed_agent(learned):
    disturbed = learned["disturbed"]["formation"]
    assert fall(disturbed["formation_rms_m"]) > 2.0
    followed = [agent["followed"] for agent in disturbed["agents"][1:]]
    assert disturbed["agents"][0]["followed"] is None
    assert min(followed) > 0.15


def test_the_claims_that_do_not_hold_are_those_that_say_why(kinematics, learned):
    claims = [*delta.claims(kinematics), *mechanisms.claims(learned)]
    failed = [claim.what for claim in claims if claim.holds is False]
    order = "last formation error, formation over trajectory objective"
    assert failed == [
        "stiffness of the linearised leg by (7.17)", f"raster: {order}", f"spiral: {order}"
    ]  # fmt: skip


def test_the_law_sees_where_the_tools_were(tmp_path):
    """From errors of the joints to those of the tools, by the kinematics and nothing else."""

    class Seen:
        def update(self, u, e, disturbance=None):
            self.error = e
            return u

    machine = build(tmp_path, "spiral", is_disturbed=False)
    law = mechanisms_law.AtTheTools(Seen(), machine, None)
    missed = 0.01 * np.random.default_rng(1).normal(size=(machine.cell.n_samples, 9))
    law.update(np.zeros_like(missed), missed)
    places = tools_m(Delta(), np.tile(machine.angle_rad, 3) - missed)
    assert np.allclose(
        law.law.error.reshape(-1, 3, 3), machine.tool_m[:, None] - places, atol=1e-15
    )


def test_without_coupling_the_coordinated_law_is_one_law_an_agent(tmp_path):
    machine = build(tmp_path, "raster", is_disturbed=False)
    law = mechanisms_law.coordinated("raster", "individual", machine).law
    assert isinstance(law, NormOptimalIlc)
    rng = np.random.default_rng(2)
    e = 1e-3 * rng.normal(size=(machine.cell.n_samples, 9))
    u = law.update(np.zeros_like(e), e)
    e[:, 3:] = 0.0
    alone = law.update(np.zeros_like(e), e)
    assert np.allclose(alone[:, :3], u[:, :3], atol=1e-12)
    assert np.abs(alone[:, 3:]).max() < 1e-15
