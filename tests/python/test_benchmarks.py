"""The report of the benchmarks: figures or a sentence, never an empty table."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def report(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    # The comparisons need packages that are not installed where the tests run.
    for name in ("border", "bounded", "coupled", "moves", "prediction", "update"):
        monkeypatch.setitem(sys.modules, name, type(sys)(name))
    spec = importlib.util.spec_from_file_location("benchmark_report", FOLDER / "report.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_what_criterion_left_is_read(report, tmp_path, monkeypatch):
    found = tmp_path / "one axis" / "update" / "new"
    found.mkdir(parents=True)
    (found / "benchmark.json").write_text(json.dumps({"full_id": "one axis/update"}))
    (found / "estimates.json").write_text(json.dumps({"median": {"point_estimate": 7280.0}}))
    monkeypatch.setenv("CRITERION_HOME", str(tmp_path))
    assert report.criterion(report.criterion_folder()) == [
        ("one axis/update", pytest.approx(7.28e-6))
    ]


def test_no_figures_are_a_failure_with_a_sentence(report, tmp_path, monkeypatch):
    monkeypatch.setenv("CRITERION_HOME", str(tmp_path))
    with pytest.raises(SystemExit, match=r"no figures of the Rust benches in .*make bench"):
        report.main()
    with pytest.raises(SystemExit, match="N = 400 has no figures"):
        report.table({400: {}})
    with pytest.raises(SystemExit, match="axes = 2 has no figures"):
        report.table({2: {"another": 1.0}}, "axes")
    with pytest.raises(SystemExit, match="no figures"):
        report.table({})
    with pytest.raises(SystemExit, match="no figures of campaigns in lock-step"):
        report.lock_step_section("update, N = 1300: 2.5us for one axis, 10.4us for two")


def test_campaigns_in_lock_step_are_told_by_axes(report):
    kept = "lock-step, in process, every run kept on disk: "
    told = f"{kept}2 axes, 10 runs in 71.717ms, 464 times faster than real time\n"
    told += f"{kept}12 axes, 20 runs in 1.586s, 91 times faster than real time\n"
    assert report.lock_step_section(told)[-3:-1] == [
        "| 2 | 10 | 71.717ms | 464 |",
        "| 12 | 20 | 1.586s | 91 |",
    ]


def test_no_table_of_the_documents_is_empty():
    root = FOLDER.parent
    for page in [*root.glob("*.md"), *root.glob("docs/**/*.md")]:
        lines = page.read_text(encoding="utf-8").splitlines()
        for line, after in zip(lines, [*lines[1:], ""], strict=True):
            if set(line) <= set("|-: ") and line.startswith("|-"):
                assert after.startswith("|"), f"{page}: a table without rows"


def test_many_plants_are_compared_bit_by_bit(report, tmp_path):
    """The script on few plants: every way gives the same figures, or it fails."""
    file = tmp_path / "rows.json"
    done = subprocess.run(
        [
            sys.executable, str(FOLDER / "many_plants.py"), "--plants", "6", "--slow", "4",
            "--repeats", "1", "--no-dask", "--json", str(file),
        ],
        capture_output=True, text=True, check=False, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    rows = json.loads(file.read_text())
    assert [(row["plants"], row["way"]) for row in rows] == [
        (6, "simulate_many, one thread"),
        (6, "simulate_many, two threads"),
        (4, "simulate_many, one thread"),
        (4, "sweep, this process"),
        (4, "sweep, two processes"),
    ]
    assert len({row["digest"] for row in rows}) == 2
    section = report.many_plants_section(rows)
    assert section[0] == "## Thousands of plants"
    assert sum(line.startswith("| s") for line in section) == 5


def test_the_page_of_a_machine_has_every_section_with_its_figures(tmp_path):
    """The script of `make rt-page`, a second a part: figures of this computer, good or bad."""
    done = subprocess.run(
        [sys.executable, str(FOLDER / "machine_page.py"), str(tmp_path)],
        capture_output=True, text=True, check=False, timeout=240,
        env={**os.environ, "RT_SECONDS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    (page,) = tmp_path.iterdir()
    text = page.read_text(encoding="utf-8")
    assert text.startswith("---\norphan: true\n---\n\n# ")
    assert "Written by `make rt-page` on " in text
    head, *sections = text.split("\n## ")
    assert " processors, kernel " in head
    titles = ["Wake-ups at 1 kHz", "Ticks", "A tick on UDP", "Findings of `ilc-rt doctor`"]
    assert [section.partition("\n")[0] for section in sections] == titles
    wake, ticks, stages, findings = map(rows_of, sections)
    # Idle, then loaded.
    assert [row[0] for row in wake] == ["median", "99 %", "99.9 %", "longest"] * 2
    for table in (wake[:4], wake[4:]):
        late_us = [float(row[1]) for row in table]
        assert late_us == sorted(late_us)
    assert "\nIdle: " in sections[0]
    assert "\nEvery processor, memory and disk busy: " in sections[0]
    assert [row[:2] for row in ticks] == [
        ["one axis, 20 kHz", "50"], ["two axes, csp", "1000"], ["three axes, csp", "1000"],
    ]  # fmt: skip
    for row in ticks:
        tick_us = [float(value) for value in row[2:6]]
        assert tick_us == sorted(tick_us)
        assert tick_us[0] > 0.0
        assert int(row[6]) > 0
    assert len(stages) == 5
    assert all(0.0 < float(row[1]) <= float(row[2]) for row in stages[1:])
    assert {row[0] for row in findings} >= {"kernel", "priority", "memory", "clock"}
    assert {row[1] for row in findings} <= {"good", "poor", "unknown"}


def rows_of(section):
    """Return the cells of the tables of a section, without their headings."""
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    return [row for row in rows if row[0] not in {"us", "cell", "stage", "what"}]
