"""`ilc` as a user calls it: process, exit code and output."""

from __future__ import annotations

import csv
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from dataclasses import fields
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ports_fixture import free_bus

from ilc_rt import Library
from ilc_rt.figures import Figures
from ilc_rt.record import SIGNALS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ilc_rt import CampaignResult

    Ilc = Callable[..., subprocess.CompletedProcess[str]]

KINDS = {"float": float, "int": int, "bool": bool, "str": str, "tuple": list}


@pytest.mark.parametrize(
    "verb",
    ["run", "demo", "plot", "monitor", "library list", "library show", "library export"],
)
def test_every_verb_has_help_with_an_example(ilc: Ilc, verb: str) -> None:
    """The example is a line that can be copied."""
    done = ilc(*verb.split(), "--help")
    assert done.returncode == 0
    assert re.search(rf"Example: ilc {verb}\b", done.stdout)


def test_a_run_prints_one_row_a_run_and_writes_what_was_asked(
    ilc: Ilc, gantry: Path, tmp_path: Path
) -> None:
    """Rows, closing sentence, figures file, report and library."""
    done = ilc("run", gantry, "--bus", "loopback:", "--iterations", 3, "--library", "l.db",
               "--json", "f.json", "--report", "r.html")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    rows = [line for line in done.stdout.splitlines() if re.match(r"\s+\d\s", line)]
    assert [int(row.split()[0]) for row in rows] == [0, 1, 2]
    assert re.search(r"Contour error from [\d.]+ µm to [\d.]+ µm \([\d.]+ % less\)", done.stdout)
    check_figures(json.loads((tmp_path / "f.json").read_text()), runs=3)
    assert (tmp_path / "r.html").stat().st_size > 10_000
    assert len(Library(str(tmp_path / "l.db")).list()) == 3


def check_figures(data: dict[str, object], runs: int) -> None:
    """Check the file of --json key by key."""
    assert data["cell"] == "gantry"
    assert data["status"] == "completed"
    assert isinstance(data["campaign"], str)
    assert data["n_axes"] == 2
    assert data["axis_names"] == ["x", "y"]
    assert data["axis_units"] == ["m", "m"]
    iterations = data["iterations"]
    assert isinstance(iterations, list)
    assert [figures["index"] for figures in iterations] == list(range(runs))
    for figures in iterations:
        described = {figure.name: str(figure.type) for figure in fields(Figures)}
        assert set(figures) == {"id", "index", "digest", *described}
        for name, kind in described.items():
            is_absent = figures[name] is None and "None" in kind
            assert is_absent or isinstance(figures[name], KINDS[re.split(r"\W", kind)[0]]), name
        assert figures["contour_inf_m"] > 0


def test_the_demo_needs_nothing(ilc: Ilc, tmp_path: Path) -> None:
    """No cell, no option but a fast bus: it runs, and prints the place of every file."""
    done = ilc("demo", "--bus", "loopback:", "--iterations", 2)
    assert done.returncode == 0, done.stderr
    assert "report:  ilc-report.html" in done.stdout
    assert "library: ilc-library.db" in done.stdout
    assert (tmp_path / "ilc-report.html").exists()


def test_the_packaged_cell_is_the_example(gantry: Path) -> None:
    """`ilc demo` and the example run the same machine."""
    packaged = resources.files("ilc_rt").joinpath("data/gantry.toml")
    assert packaged.read_bytes() == gantry.read_bytes()


def test_processes_over_udp_in_lockstep(ilc: Ilc, gantry: Path, tmp_path: Path) -> None:
    """The real programs, each in its own process."""
    done = ilc("run", gantry, "--bus", free_bus(), "--lockstep", "--iterations", 2,
               "--json", "f.json")  # fmt: skip
    assert done.returncode == 0, done.stderr
    data = json.loads((tmp_path / "f.json").read_text())
    check_figures(data, runs=2)
    assert data["mode"] == "lockstep"
    assert data["iterations"][1]["tracking_rms_m"] < data["iterations"][0]["tracking_rms_m"]


def test_ctrl_c_in_a_real_time_run_is_a_controlled_stop(gantry: Path, tmp_path: Path) -> None:
    """SIGINT to the terminal's process group: exit 130, one line, nothing left running."""
    command = [sys.executable, "-m", "ilc_rt.cli", "run", str(gantry), "--iterations", "5",
               "--bus", free_bus()]  # fmt: skip
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        for line in process.stdout:
            if re.match(r"\s+0\s", line):
                break
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.strip() == "ilc: stopped on request; the axes are at rest"
    assert "at most in 1 run." in out
    assert len(Library(str(tmp_path / "ilc-library.db")).list()) == 1


def test_a_terminal_gets_a_table_and_a_bar(gantry: Path, tmp_path: Path) -> None:
    """On a terminal, the table stays and the bar is gone at the end."""
    main, side = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "120", "LINES": "40"}
    with subprocess.Popen(
        [sys.executable, "-m", "ilc_rt.cli", "run", str(gantry), "--bus", free_bus(),
         "--iterations", "1"],
        cwd=tmp_path, stdout=side, stderr=side, env=environment,
    ) as process:  # fmt: skip
        os.close(side)
        said = b""
        until = time.monotonic() + 60
        while time.monotonic() < until:
            try:
                chunk = os.read(main, 65536)
            except OSError:
                break
            if not chunk:
                break
            said += chunk
        assert process.wait(10) == 0
    os.close(main)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", said.decode())
    assert "max contour µm" in text
    assert "run 0 (1 of 1): running" in text
    assert text.rstrip().splitlines()[-1].startswith("library: ")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "nix.toml"], "nix.toml"),
        (["run"], "Missing argument 'CELL'"),
        (["run", "CELL", "--bus", "foo"], "bus = foo: allowed can:INTERFACE"),
        (
            ["run", "CELL", "--iterations", "0"],
            "invalid value '0' for '--iterations <N>': allowed 1 to 4294967295",
        ),
        (["run", "CELL", "--iterations", "many"], "--iterations"),
        (["run", "CELL", "--measure", "laser"], "--measure"),
        (["run", "CELL", "--library", "/no/folder/l.db"], "no such folder"),
        (["run", "CELL", "--frobnicate"], "--frobnicate"),
        (["frobnicate"], "frobnicate"),
        (["plot", "nix.db"], "nix.db: no such library"),
        (["library", "list", "nix.db"], "nix.db: no such library"),
        (["library", "show", "nix.db", "1"], "nix.db: no such library"),
        (["monitor", "a/b"], "a/b"),
        (["monitor", "gantry", "--connect", "nonsense", "--no-scouting"], "nonsense"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    ilc: Ilc, gantry: Path, arguments: list[str], said: str
) -> None:
    """Never a traceback."""
    done = ilc(*(str(gantry) if argument == "CELL" else argument for argument in arguments))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert said in done.stderr
    assert done.stdout == ""


def test_without_the_papers_reproduce_says_how_to_get_them() -> None:
    """The verb is in a separate package."""
    without = (
        "import importlib.metadata as metadata; metadata.entry_points = lambda **_: ();"
        "from ilc_rt.cli import main;"
        "raise SystemExit(main(['reproduce', 'haas2016', '--reduced']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", without], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "pip install 'ilc-rt[papers]'" in done.stderr


def test_a_file_that_is_no_library_is_refused(ilc: Ilc, gantry: Path) -> None:
    """A text file is not taken for a library."""
    done = ilc("library", "list", gantry)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


def test_the_library_lists_and_shows(ilc: Ilc, finished: CampaignResult) -> None:
    """Every run is listed; one is shown with all its data."""
    listed = ilc("library", "list", finished.library)
    assert listed.returncode == 0
    assert listed.stdout.count(finished.campaign) == 3
    assert "3 runs in" in listed.stdout
    shown = ilc("library", "show", finished.library, finished.records[1].id)
    assert shown.returncode == 0
    assert finished.records[1].digest in shown.stdout
    assert "reference_m" in shown.stdout
    missing = ilc("library", "show", finished.library, 99)
    assert missing.returncode == 2
    assert "no run 99" in missing.stderr


def test_an_exported_run_is_the_run(ilc: Ilc, finished: CampaignResult, tmp_path: Path) -> None:
    """Npz and json bit by bit, csv to the last digit."""
    record = finished.records[-1]
    for ending in ("npz", "json", "csv"):
        done = ilc("library", "export", finished.library, record.id, f"run.{ending}")
        assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "run.npz") as packed:
        for name in SIGNALS:
            np.testing.assert_array_equal(packed[name], record.row()[name])
        assert json.loads(str(packed["figures"]))["digest"] == record.digest
    content = json.loads((tmp_path / "run.json").read_text())
    np.testing.assert_array_equal(content["error_m"], record.error_m)
    lines = (tmp_path / "run.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == finished.n_samples
    names = [name for name in rows[0] if name.startswith("error_")]
    assert len(names) == 2
    read = np.array([[float(row[name]) for name in names] for row in rows])
    np.testing.assert_array_equal(read, record.error_m)
    assert float(rows[1]["time_s"]) == finished.cycle_s
    refused = ilc("library", "export", finished.library, record.id, "run.xlsx")
    assert refused.returncode == 2
    assert ".npz, .csv, .json" in refused.stderr


def test_plot_makes_pictures_or_a_report(
    ilc: Ilc, finished: CampaignResult, tmp_path: Path
) -> None:
    """A folder gets one picture per figure; a .html path gets the report."""
    done = ilc("plot", finished.library, "--out", "pictures")
    assert done.returncode == 0, done.stderr
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert names == {"convergence.png", "contour.png", "tracking.png", "input.png"}
    done = ilc("plot", finished.library, "--campaign", finished.campaign, "--out", "r.html")
    assert done.returncode == 0
    assert (tmp_path / "r.html").exists()
    assert ilc("plot", finished.library, "--campaign", "nix").returncode == 2
