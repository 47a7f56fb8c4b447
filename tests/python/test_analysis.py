"""Analysis and tuning against dense NumPy solutions of the lifted problem."""

import json
from pathlib import Path

import control
import numpy as np
import pytest

from ilc_rt import (
    BadInputError,
    Campaign,
    Cell,
    LearningError,
    NormOptimalIlc,
    PdIlc,
    StateSpace,
    analyze,
    discretize,
    second_order,
    tune,
)
from ilc_rt.cli import main

DT_S = 0.002
N = 120
GANTRY = "examples/01_gantry.toml"


def axis(w0=94.0, damping=0.7):
    """Return the closed position loop of one axis."""
    return discretize(second_order(w0, damping), DT_S)


def servo():
    """Return the servo example of the source, closed by python-control."""
    z = control.tf("z")
    plant = control.ss(control.feedback((z - 0.5) / ((z - 1) * (z - 0.925)), 0.425))
    return StateSpace(plant.A, plant.B, plant.C, plant.D, 1.0)


class Proportional:
    """A law written in Python."""

    def update(self, u, e, disturbance=None):
        """Return the next input from the error one sample ahead."""
        del disturbance
        ahead = np.vstack([e[1:], e[-1:]])
        return u + 0.5 * ahead


class Clipped:
    """A nonlinear law."""

    def update(self, u, e, disturbance=None):
        """Return a bounded input."""
        del disturbance
        return np.clip(u + e, -0.1, 0.1)


def test_a_law_written_in_python_is_tried():
    own = analyze(PdIlc(kp=0.5, kd=0.0), axis(), N)
    found = analyze(Proportional(), axis(), N)
    assert found.monotonic_factor == pytest.approx(own.monotonic_factor, rel=1e-9)
    assert found.critical_frequency_hz == pytest.approx(own.critical_frequency_hz)
    with pytest.raises(LearningError, match="not linear"):
        analyze(Clipped(), axis(), N)


def test_uncertainty_is_a_number_or_a_curve():
    weights = {"s": 0.5, "r": 2.0}
    same = analyze(weights, servo(), 200, uncertainty=0.4)
    curve = analyze(weights, servo(), 200, uncertainty=np.full(9, 0.4))
    assert same.robust_factor == pytest.approx(curve.robust_factor, rel=1e-12)
    assert same.robust_factor < 1 < same.uncertainty_allowed
    above = analyze(weights, servo(), 200, uncertainty=1.01 * same.uncertainty_allowed)
    assert above.robust_factor > 1


def test_the_figures_are_readable():
    found = analyze(NormOptimalIlc(axis(), N, rate=3.0), axis(), reference=np.ones(N))
    assert "RMS error before learning" in str(found)
    assert repr(found).startswith("Analysis(converges=True")
    assert json.loads(json.dumps(found.to_dict()))["initial_error_rms"] == pytest.approx(1.0)
    assert found.frequency_hz.shape == found.contraction.shape
    assert found.converged_input.shape == (N, 1)


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"n_samples": None}, ValueError, "n_samples = None"),
        ({"reference": np.ones(N - 1)}, ValueError, "reference"),
        ({"reference": np.full(N, np.nan)}, ValueError, "reference"),
        ({"reference": np.ones((N, 2))}, ValueError, "reference"),
        ({"noise_std": -1.0}, LearningError, "noise_std = -1"),
        ({"uncertainty": -0.1}, LearningError, "uncertainty = -0.1"),
        ({"uncertainty": np.ones((2, 2))}, ValueError, "uncertainty"),
        ({"law": 3.0}, TypeError, "law = 3.0"),
        ({"law": {"qq": 1.0}}, ValueError, "the weights are q, s, r and rate"),
        ({"law": {"q": -1.0}}, LearningError, "q = -1"),
        ({"model": second_order(94.0, 0.7)}, ValueError, "continuous"),
        ({"model": 1}, TypeError, "model"),
    ],
)
def test_wrong_questions_are_refused(options, error, match):
    arguments = {"law": {"r": 0.1}, "model": axis(), "n_samples": N, **options}
    with pytest.raises(error, match=match):
        analyze(**arguments)


def test_tuning_says_what_and_why():
    reference = 0.01 * (1 - np.cos(np.arange(300) / 40))
    curve = np.linspace(0.2, 3.0, 50)
    found = tune(axis(), 300, uncertainty=curve, noise_std=1e-5, reference=reference)
    assert [step["name"] for step in found.steps] == ["s1", "s2", "s3", "smoothing", "s4"]
    assert all(step["why"] for step in found.steps)
    assert found.q == 1
    assert found.s > 0
    assert found.r > 0
    assert found.analysis.robust_factor < 1
    assert found.analysis.converged_error_rms < found.analysis.initial_error_rms
    noisy = tune(axis(), 300, uncertainty=curve, noise_std=1e-3, reference=reference)
    assert noisy.r > found.r
    assert "s1" in str(found)
    with pytest.raises(LearningError, match="n_runs = 0"):
        tune(axis(), 300, n_runs=0)
    with pytest.raises(ValueError, match="reference"):
        tune(axis(), 300, reference=np.ones(7))


def test_the_cell_knows_its_model_and_its_first_error():
    cell = Cell.load(GANTRY)
    model, error = cell.model(), cell.first_error()
    way = cell.reference() - cell.reference()[0]
    np.testing.assert_allclose(error, way - model.simulate(way), atol=1e-15)


def divergent_cell(tmp_path):
    """Write the gantry with a proportional law whose gain is far too high."""
    text = Path(GANTRY).read_text(encoding="utf-8").replace('law = "norm_optimal"', 'law = "pd"')
    path = tmp_path / "cell.toml"
    path.write_text(text + "\n[learning.pd]\nkp = 5.0\ncutoff_hz = 100.0\n", encoding="utf-8")
    return path


def test_a_law_that_will_not_converge_does_not_start(tmp_path, capsys):
    cell = divergent_cell(tmp_path)
    with pytest.raises(BadInputError, match=r"\[learning\].*will not converge"):
        Campaign(cell)
    assert main(["run", str(cell), "--bus", "loopback:"]) == 2
    assert "will not converge" in capsys.readouterr().err
    Campaign(cell, library=tmp_path / "x.db", allow_divergent=True)
    eager = PdIlc(kp=5.0, kd=0.0)
    with pytest.raises(BadInputError, match="will not converge"):
        Campaign(GANTRY, law=eager)
    Campaign(GANTRY, law=eager, library=tmp_path / "x.db", allow_divergent=True)
    Campaign(GANTRY, law=Clipped(), library=tmp_path / "x.db")
