"""`ilc reproduce`: its output, files and refusals, with papers made for the purpose."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import papers_fixture
import pytest
from rich.console import Console

from ilc_papers import command as reproduce
from ilc_papers import outcome, papers, workers
from ilc_papers.paper import Claim, Paper
from ilc_papers.progress import ReproductionView
from ilc_papers.quantity import pair
from ilc_rt.cli import main
from ilc_rt.errors import EXIT_INTERRUPTED, CampaignError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Ilc = Callable[..., subprocess.CompletedProcess[str]]

NAMES = ("one", "two-halves")


@pytest.fixture
def two_papers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put two quick papers in the place of the real ones."""

    def chosen(name: str) -> tuple[str, ...]:
        return NAMES if name == "all" else (name,)

    def side_by_side(names, **options):
        return workers.compute_side_by_side(names, load_paper=papers_fixture.load, **options)

    def read(path, names):
        return outcome.read_json(path, names, papers_fixture.load)

    monkeypatch.setattr(outcome, "NAMES", NAMES)
    monkeypatch.setattr(reproduce, "chosen", chosen)
    monkeypatch.setattr(reproduce, "load", papers_fixture.load)
    monkeypatch.setattr(reproduce, "compute_side_by_side", side_by_side)
    monkeypatch.setattr(reproduce, "read_json", read)


@pytest.mark.usefixtures("two_papers")
def test_one_paper_prints_its_claims_beside_ours(capsys, tmp_path: Path) -> None:
    """Figures in one unit, their ratio, what holds; progress before, remarks after."""
    assert main(["reproduce", "one", "--json", str(tmp_path / "f.json")]) == 0
    said = capsys.readouterr().out
    lines = [" ".join(line.split()) for line in said.splitlines()]
    assert lines[0] == "one: halving"
    assert "error after 2 runs [max] 400 µm 500 µm 1.25 Table 9" in lines
    assert "error falls - - yes Fig. 9" in lines
    assert "error vanishes - - no section 9" in lines
    assert "error after 2 runs [max]: Ours | is more." in lines
    entry = json.loads((tmp_path / "f.json").read_text())
    assert list(entry) == ["one"]
    assert list(entry["one"]) == ["halved", "claims", "seconds"]
    assert entry["one"]["halved"]["error_m"] == [2e-3 * 0.5**run for run in range(6)]
    assert entry["one"]["claims"][0] == {
        "what": "error after 2 runs [max]", "ours": 5e-4, "printed": 4e-4, "unit": "m",
        "source": "Table 9", "holds": None, "remark": "Ours | is more.", "ratio": 1.25,
    }  # fmt: skip


@pytest.mark.usefixtures("two_papers")
def test_all_papers_in_processes_give_the_same_figures_as_one(capsys, tmp_path: Path) -> None:
    """Side by side or alone: the order is that of the names, the figures are equal."""
    assert main(["reproduce", "all", "--reduced", "--json", str(tmp_path / "all.json")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert {"one: halving", "one: done", "two-halves: halving", "two-halves: done"} <= set(said)
    assert main(["reproduce", "one", "--reduced", "--json", str(tmp_path / "one.json")]) == 0
    every = json.loads((tmp_path / "all.json").read_text())
    alone = json.loads((tmp_path / "one.json").read_text())
    assert list(every) == list(NAMES)
    assert every["one"]["halved"] == alone["one"]["halved"]
    assert every["one"]["reduced"] is True
    assert len(every["one"]["halved"]["error_m"]) == 3


@pytest.mark.usefixtures("two_papers")
def test_pages_from_a_file_are_those_of_the_computation(
    capsys, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The file is all that a page needs; the plots are identical byte for byte."""
    file, first, second = tmp_path / "f.json", tmp_path / "first", tmp_path / "second"
    assert main(["reproduce", "all", "--json", str(file), "--report", str(first)]) == 0
    monkeypatch.setattr(reproduce, "_compute", None)
    assert main(["reproduce", "all", "--from", str(file), "--report", str(second)]) == 0
    assert f"report:  {second / 'index.md'}" in capsys.readouterr().out
    names = ["index.md", "one-error.png", "one.md", "two-halves-error.png", "two-halves.md"]
    for folder in (first, second):
        assert sorted(path.name for path in folder.iterdir()) == names
    # The seconds are rounded in the file, and to whole ones in the page.
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name
    page = (first / "one.md").read_text()
    assert "| error after 2 runs [max] (1) | 400 µm | 500 µm | 1.25 |  | Table 9 |" in page
    assert "1. Ours | is more." in page
    assert "![The error against the run.](one-error.png)" in page
    index = (first / "index.md").read_text()
    assert "## [two-halves](two-halves.md)" in index
    assert "1 of 2 statements hold; 1 printed figures are compared." in index
    # A single page leaves the index unchanged.
    (first / "index.md").unlink()
    assert main(["reproduce", "one", "--from", str(file), "--report", str(first)]) == 0
    assert not (first / "index.md").exists()


def test_a_wrong_name_is_refused_with_what_is_allowed(ilc: Ilc) -> None:
    done = ilc("reproduce", "haas2017")
    assert done.returncode == 2
    allowed = ", ".join([*papers.NAMES, "all"])
    assert done.stderr == f"ilc: paper = haas2017: allowed {allowed}\n"


def test_help_has_examples(ilc: Ilc) -> None:
    done = ilc("reproduce", "--help")
    assert done.returncode == 0
    assert done.stdout.count("Example: ilc reproduce") == 3


@pytest.mark.usefixtures("two_papers")
@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ["--json", "nowhere/f.json"],
            "--json nowhere/f.json: cannot be written: No such file or directory",
        ),
        (["--json", "."], "--json .: cannot be written: Is a directory"),
        (["--report", "file"], "--report file: is a file; a folder"),
        (["--from", "nothing.json"], "nothing.json: cannot be read: No such file or directory"),
        (["--from", "file"], "file: no JSON: Expecting value: line 1 column 1 (char 0)"),
        (["--from", "list.json"], "list.json: holds no papers; `ilc reproduce all --json"),
        (["--from", "other.json"], "other.json: no figures of one; there is two-halves"),
        (["--from", "old.json"], "old.json: one: figures of another version: KeyError('halved')"),
        (["--from", "old.json", "--reduced"], "--reduced: nothing is computed with --from"),
    ],
)
def test_what_cannot_be_is_refused_before_computing(
    capsys, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, options: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reproduce, "_compute", None)
    (tmp_path / "file").write_text("no JSON")
    (tmp_path / "list.json").write_text("[]")
    (tmp_path / "other.json").write_text('{"two-halves": {}}')
    (tmp_path / "old.json").write_text('{"one": {"doubled": {}}}')
    assert main(["reproduce", "one", *options]) == 2
    assert capsys.readouterr().err.startswith(f"ilc: {says}")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("broken", "broken: ValueError: reduced = True: cannot be"),
        ("silent", "silent: its process ended with 7 and said nothing"),
    ],
)
def test_a_paper_that_fails_is_named_and_ends_the_others(name: str, says: str) -> None:
    with pytest.raises(CampaignError, match=says):
        workers.compute_side_by_side(
            [name, "one", "two"],
            reduced=True,
            tell=lambda *_: None,
            load_paper=papers_fixture.load,
        )


def test_figures_that_json_does_not_know_are_not_written(tmp_path: Path) -> None:
    """A NaN would not be read by other programs."""
    bad = Paper("bad", "", "", lambda *_: {"error_m": [float("nan")]}, lambda _: [], [])
    found = outcome.compute(bad, reduced=False, tell=lambda _: None)
    with pytest.raises(ValueError, match="not JSON compliant"):
        outcome.write_json([found], tmp_path / "f.json")


def test_quantities_share_a_unit_and_ratios_need_both() -> None:
    assert pair(2.5e-3, 9e-4, "m") == ("2500 µm", "900 µm")
    assert pair(None, 0.52, "") == ("-", "0.52")
    assert pair(0.0, None, "m") == ("0 m", "-")
    assert pair(3e-12, None, "m") == ("0.003 nm", "-")
    assert pair(12.0, 10.0, "Hz") == ("12 Hz", "10 Hz")
    assert Claim("", 1.0, None).ratio is None
    assert Claim("", 1.0, 0.0).ratio is None
    assert Claim("", 1.0, 4.0).ratio == 0.25


@pytest.mark.usefixtures("two_papers")
def test_ctrl_c_keeps_the_papers_that_are_done(
    capsys, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """In the file of --json; another one is computed again."""
    tell = ReproductionView.tell

    def interrupted(view: ReproductionView, name: str, what: str | None) -> None:
        tell(view, name, what)
        if what is None:
            raise KeyboardInterrupt

    monkeypatch.setattr(ReproductionView, "tell", interrupted)
    file = tmp_path / "f.json"
    assert main(["reproduce", "all", "--json", str(file)]) == EXIT_INTERRUPTED
    (name,) = json.loads(file.read_text())
    assert capsys.readouterr().err == f"ilc: {file} has the figures of {name}\n"
    assert main(["reproduce", name, "--from", str(file)]) == 0


def test_the_time_left_is_told_where_the_number_of_steps_is_known() -> None:
    """A line for each step: its number, and the time of as many steps as are left."""
    now = [0.0]
    console = Console(file=io.StringIO(), width=100)
    with ReproductionView(console, {"one": 3}, lambda: now[0]) as view:
        view.tell("one", "first")
        now[0] = 10.0
        view.tell("one", "second")
        view.tell("two", "uncounted")
        now[0] = 30.0
        for what in ("third", "fourth", None):
            view.tell("one", what)
    assert console.file.getvalue().splitlines() == [
        "one: first (1 of 3)", "one: second (2 of 3, about 0:20 left)", "two: uncounted",
        "one: third (3 of 3, about 0:15 left)", "one: fourth", "one: done",
    ]  # fmt: skip


def test_ctrl_c_ends_every_process_with_one_code(tmp_path: Path) -> None:
    """The terminal interrupts the whole group, and no process leaves a trace."""
    process = subprocess.Popen(
        [sys.executable, "-m", "ilc_rt.cli", "reproduce", "all", "--reduced"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert ": " in process.stdout.readline()
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60.0)
    assert process.returncode == EXIT_INTERRUPTED
    assert said == ""
