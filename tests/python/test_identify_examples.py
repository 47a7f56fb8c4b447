"""Identification of every axis of the shipped cells."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from tuning_fixture import learn

from ilc_rt import identify
from ilc_rt.tuning import propose_weights

DT_S = 0.002


TRUTH = {"x": (15.0, 1.0), "y": (15.0, 0.6)}


@pytest.mark.parametrize("measure", ["encoder", "tcp"])
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("cell", ["01_gantry", "02_parallel", "04_gcode"])
def test_every_axis_of_the_examples_gets_a_model_near_the_truth(cell, axis, measure):
    path = f"examples/{cell}.toml"
    told = []
    found = identify.multisine(path, axis=axis, measure=measure, bus="loopback:", tell=told.append)
    assert found.doubt is None
    assert told
    frequency_hz, damping = TRUTH[axis]
    bandwidth_hz, described = 2.0 * damping * frequency_hz, found.described
    if measure == "encoder":
        assert described.delay_samples <= 2
        if cell == "02_parallel":
            assert described.bandwidth_hz == pytest.approx(bandwidth_hz, rel=0.15)
        else:
            assert described.natural_frequency_hz == pytest.approx(frequency_hz, rel=0.1)
            assert described.damping == pytest.approx(damping, rel=0.25)
        return
    # The tool measures the axis, a cycle later, and the mode at 20 Hz.
    low_hz = np.arange(1.0, 10.0, 0.5)
    s = 2j * np.pi * low_hz
    w0, w1 = 2 * np.pi * frequency_hz, 2 * np.pi * 20.0
    true = w0**2 / (s**2 + 2 * damping * w0 * s + w0**2)
    true *= (0.2 * w1 * s + w1**2) / (s**2 + 0.2 * w1 * s + w1**2)
    dt_s = found.dt_s
    true *= np.exp(-s * 1.5 * dt_s)
    gain = 1.0 if cell != "02_parallel" else w0 / (2 * damping)
    seen = np.ravel(described.response(low_hz)) * gain
    assert np.sqrt(np.mean(np.abs(seen / true - 1.0) ** 2)) < 0.25


@pytest.mark.parametrize("cell", ["01_gantry", "02_parallel"])
def test_an_axis_that_stands_still_is_doubted_in_one_line(cell, ilc, tmp_path):
    text = Path(f"examples/{cell}.toml").read_text(encoding="utf-8")
    text = text.replace("static_n = 25.0", "static_n = 2000.0")
    text = text.replace("position_start_m = 0.02", "position_start_m = 0.0")
    (tmp_path / "stuck.toml").write_text(text, encoding="utf-8")
    done = ilc(
        "identify", "stuck.toml", "--axis", "y", "--bus", "loopback:", "--measure", "encoder",
        "--period-s", "5", "--periods", "2", "--json", "y.json",
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("\n") == 1
    assert "no model for axis y: the output does not answer at any frequency" in done.stderr
    assert "natural frequency" not in done.stdout
    figures = json.loads((tmp_path / "y.json").read_text())
    assert figures["doubt"]
    assert figures["axis_model"] is None


def test_what_was_identified_is_tuned_and_learns(tmp_path):
    text = Path("examples/01_gantry.toml").read_text(encoding="utf-8")
    parts = re.split(r"(?=\[\[axis\]\])|(?=\[tcp_encoder\])", text)
    for index, axis in enumerate(("x", "y"), start=1):
        found = identify.multisine("examples/01_gantry.toml", axis=axis, bus="loopback:")
        section = found.section()
        parts[index] = re.sub(
            r"\[axis\.model\].*\n(?:.+\n)*\n", lambda _, new=section: new + "\n", parts[index]
        )
    path = tmp_path / "measured.toml"
    path.write_text("".join(parts), encoding="utf-8")
    assert propose_weights(path).write(path)
    contour, _ = learn(path, tmp_path / "runs.db")
    assert contour[-1] < 0.15 * contour[0]
