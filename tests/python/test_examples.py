"""Every example runs as it stands, in a folder of its own."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from ilc_rt import Library

if TYPE_CHECKING:
    from pathlib import Path


def run_example(script: Path, folder: Path, *arguments: str) -> str:
    """Run a script and return what it prints."""
    done = subprocess.run(
        [sys.executable, str(script), *arguments],
        cwd=folder, capture_output=True, text=True, timeout=180, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_gantry_learns_its_contour(gantry: Path, tmp_path: Path) -> None:
    """One line per run with falling errors, a picture and a library."""
    said = run_example(gantry.with_suffix(".py"), tmp_path, "4")
    rows = [line.split() for line in said.splitlines() if re.match(r"\s*\d", line)]
    errors_um = [float(row[2]) for row in rows]
    assert len(errors_um) == 4
    assert errors_um[3] < 0.3 * errors_um[0]
    assert (tmp_path / "01_gantry.png").stat().st_size > 10_000
    assert len(Library(str(tmp_path / "01_gantry.db")).list()) == 4


def test_a_law_of_ones_own_learns(gantry: Path, tmp_path: Path) -> None:
    """The RMS error falls from run to run."""
    said = run_example(gantry.with_name("03_own_law.py"), tmp_path, "4")
    errors_um = [float(value) for value in re.findall(r"error\s+([\d.]+) µm", said)]
    assert len(errors_um) == 4
    assert errors_um == sorted(errors_um, reverse=True)
    assert errors_um[3] < 0.4 * errors_um[0]


def test_trajectories_are_planned_and_drawn(gantry: Path, tmp_path: Path) -> None:
    """One line per trajectory, E/S the best, and a picture."""
    said = run_example(gantry.with_name("05_trajectories.py"), tmp_path)
    tracking = [float(value) for value in re.findall(r" s\s+([\d.]+e[+-]\d+)", said)]
    assert len(tracking) == 3
    assert tracking[0] < tracking[1]
    assert (tmp_path / "05_trajectories.png").stat().st_size > 10_000


def test_an_axis_is_identified_and_drawn(gantry: Path, tmp_path: Path) -> None:
    """Near the simulated axis, including friction; the bolder law leaves a smaller error."""
    said = run_example(gantry.with_name("06_identify.py"), tmp_path)
    frequencies_hz = [float(value) for value in re.findall(r"natural_frequency_hz = (\S+)", said)]
    assert frequencies_hz == pytest.approx([15.0], rel=0.1)
    factors = [float(value) for value in re.findall(r"leaves ([\d.]+) of", said)]
    assert len(factors) == 2
    assert factors[0] < factors[1] < 1.0
    assert (tmp_path / "06_identify.png").stat().st_size > 10_000


def test_what_was_learned_cold_is_recalled(gantry: Path, tmp_path: Path) -> None:
    """Back in the cold, the first run is as good as the last one there; not without recall."""
    said = run_example(gantry.with_name("07_warm_and_cold.py"), tmp_path)
    rows = [[float(v) for v in re.findall(r"([\d.]+) µm", line)] for line in said.splitlines()]
    plain_um, relevant_um = zip(*(row for row in rows if row), strict=True)
    assert len(plain_um) == 12
    assert relevant_um[8] < 1.1 * relevant_um[3]
    assert relevant_um[8] < 0.3 * plain_um[8]


def test_optuna_chooses_weights_on_simulated_cells(gantry: Path, tmp_path: Path) -> None:
    """The best trial leaves less than half of what the first guess leaves."""
    said = run_example(gantry.with_name("14_optuna.py"), tmp_path, "9")
    lines = [line for line in said.splitlines() if line.startswith("trial")]
    assert len(lines) == 9
    rates = [float(value) for value in re.findall(r"rate +([\d.]+) ", said)]
    assert rates[0] == 15.0
    assert len(set(rates)) > 5
    shares = {line.split()[1]: float(line.split()[-2]) for line in lines if "left" in line}
    number, share = re.search(r"# trial (\d+), ([\d.]+) % left", said).groups()
    assert shares[number] == float(share) == min(shares.values())
    assert min(shares.values()) < 0.5 * shares["0"]
