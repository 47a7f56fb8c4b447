"""`ilc sweep`: a cell learns with varied parameters, and the map says for which it converges."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ilc_rt import BadInputError, Campaign
from ilc_rt.cell_sweep import RobustnessMap, Variation, parse_variation, robustness_map
from ilc_rt.errors import EXIT_INTERRUPTED

pytestmark = pytest.mark.xdist_group("robustness map")

MASS = "axis.x.simulation.mode_frequency_hz=8:40:log"


@pytest.fixture(scope="module")
def found(gantry: Path) -> RobustnessMap:
    return robustness_map(gantry, [MASS, "axis.0.simulation.mass_kg=60:200"], 8, 5, seed=2)


def test_the_map_tells_where_learning_fails(found: RobustnessMap) -> None:
    """A mode below the bandwidth of the law spoils it, one above does not."""
    frequency_hz = found.values("axis.x.simulation.mode_frequency_hz")
    assert not found.converged[np.argmin(frequency_hz)]
    assert found.converged[frequency_hz > 16.0].all()
    parts = found.by_parameter(4)[0]["parts"]
    assert [part["cases"] for part in parts] == [2, 2, 2, 2]
    assert parts[-1]["converged_share"] == 1.0
    inside = frequency_hz >= parts[-1]["from"]
    assert parts[-1]["worst_error_m"] == found.last_m[inside].max()
    assert f"{int(found.converged.sum())} of 8 cases converge" in found.sentence()


def test_a_case_is_a_campaign_of_the_cell_with_that_value(
    gantry: Path, tmp_path: Path, found: RobustnessMap
) -> None:
    case = found.cases[3]
    text = gantry.read_text(encoding="utf-8")
    values = case["values"]
    text = text.replace(
        "mode_frequency_hz = 20.0",
        f"mode_frequency_hz = {values['axis.x.simulation.mode_frequency_hz']!r}",
    ).replace("mass_kg = 150.0", f"mass_kg = {values['axis.0.simulation.mass_kg']!r}")
    cell = tmp_path / "cell.toml"
    cell.write_text(text, encoding="utf-8")
    campaign = Campaign(
        cell, bus="loopback:", library=tmp_path / "l.db", allow_divergent=True, telemetry=False
    )
    errors = [record.contour_inf_m for record in campaign.run(5)]
    assert [case["first_m"], case["last_m"]] == [errors[0], errors[-1]]


def test_faults_do_not_end_the_sweep(gantry: Path) -> None:
    """A following error in every case: none converges, and the reason is kept."""
    found = robustness_map(gantry, ["axis.x.limits.following_error_max_m=1e-5:2e-5"], 2, 3, seed=1)
    assert found.converged_share == 0.0
    assert all("x" in case["fault"] for case in found.cases)
    assert found.sentence() == "0 of 2 cases converge (0 %)."


def test_the_verb_writes_figures_and_picture_and_resumes(ilc, gantry: Path, tmp_path: Path) -> None:
    arguments = ["sweep", gantry, "--vary", MASS, "--samples", "3", "--iterations", "3",
                 "--file", "kept.jsonl", "--json", "map.json"]  # fmt: skip
    done = ilc(*arguments, "--picture", "map.png")
    assert done.returncode == 0, done.stderr
    assert "of 3 cases converge" in done.stdout
    assert (tmp_path / "map.png").stat().st_size > 10_000
    first = (tmp_path / "map.json").read_bytes()
    data = json.loads(first)
    assert len(data["cases"]) == 3
    assert data["by_parameter"][0]["key"] == "axis.x.simulation.mode_frequency_hz"
    kept = (tmp_path / "kept.jsonl").read_text().splitlines()
    (tmp_path / "kept.jsonl").write_text("\n".join(kept[:2]) + "\n")
    done = ilc(*arguments, "--executor", "processes:2")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "map.json").read_bytes() == first


def test_files_beside_the_cell_come_along(gantry: Path, tmp_path: Path) -> None:
    for name in ("04_gcode.toml", "04_gcode.ngc"):
        shutil.copy(gantry.with_name(name), tmp_path)
    found = robustness_map(tmp_path / "04_gcode.toml", ["axis.x.simulation.mass_kg=100:200"], 1, 2)
    assert found.cases[0]["runs"] == 2


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ("axis.x.simulation.mass_kg", "needed is KEY=LOW:HIGH"),
        ("axis.x.simulation.mass_kg=3:2", "LOW < HIGH"),
        ("axis.x.simulation.mass_kg=0:2:log", "LOW must be above 0"),
        ("axis.x.simulation.mass_kg=1:2:cubic", "KEY=LOW:HIGH:log"),
        ("axis.z.simulation.mass_kg=1:2", "there is no z; there is x, y"),
        ("axis.x.simulations.mass_kg=1:2", "there is no simulations"),
        ("axis.x.name=1:2", "is not a number"),
        ("axis.x.simulation=1:2", "is not a number"),
        ("axis.x.simulation.weight_kg=1:2", "weight_kg"),
        ("axis.x.simulation.mass_kg=-5:2", "with axis.x.simulation.mass_kg = -5"),
    ],
)
def test_an_unusable_variation_is_named(gantry: Path, vary: str, words: str) -> None:
    with pytest.raises(BadInputError, match=words):
        robustness_map(gantry, [vary], 1, 2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--executor", "moon"], "--executor moon: allowed serial"),
        (["--executor", "processes:0"], "--executor processes:0: allowed"),
        (["--picture", "map.bmp"], "--picture map.bmp: allowed .png"),
        (["--samples", "0"], "samples"),
    ],
)
def test_an_unusable_option_is_named(ilc, gantry: Path, options: list[str], words: str) -> None:
    done = ilc("sweep", gantry, "--vary", MASS, *options)
    assert done.returncode == 2
    assert words in done.stderr


def test_whole_numbers_stay_whole_and_pictures_take_axes(found: RobustnessMap) -> None:
    assert parse_variation("a.b=1:3") == Variation("a.b", 1.0, 3.0, "linear")
    axes = found.plot()
    assert [one.get_xscale() for one in axes] == ["log", "linear", "log"]
    with pytest.raises(ValueError, match="3 are needed"):
        found.plot(axes[:1])


def test_ctrl_c_leaves_no_process_and_no_trace(gantry: Path, tmp_path: Path) -> None:
    """The terminal interrupts the whole group, while the workers are still importing."""
    command = [
        sys.executable, "-m", "ilc_rt.cli", "sweep", str(gantry), "--vary", MASS,
        "--samples", "1000", "--executor", "processes:2", "--file", "kept.jsonl",
    ]  # fmt: skip
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    # The two workers, and the tracker of their resources.
    while len(children.read_text(encoding="utf-8").split()) < 3:
        assert process.poll() is None
    os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=60.0)
    told = "ilc: kept.jsonl has every finished case; go on with it\n"
    assert (process.returncode, *said) == (EXIT_INTERRUPTED, "", told)
