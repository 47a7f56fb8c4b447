"""Computations of more than two seconds: progress, and Ctrl-C, after which nothing is lost."""

from __future__ import annotations

import io
import json
import re
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest
from fleet_fixture import content, make_cell, template
from ports_fixture import free_bus
from postgres_fixture import server
from processes_fixture import PATIENT, Process
from rich.console import Console

from ilc_rt import Library, ReadOnlyLibrary, library_file
from ilc_rt.commands.steps import PRINTED_EVERY_S, START_OF_LINE, TOLD_AFTER_S, Steps
from ilc_rt.errors import EXIT_INTERRUPTED
from ilc_rt.fleet import FleetLibrary, pull, push
from ilc_rt.fleet.sync import BATCH
from ilc_rt.sweeping import sweep

if TYPE_CHECKING:
    from pathlib import Path

    from ilc_rt import CampaignResult

pytestmark = pytest.mark.xdist_group("postgres")


class Told:
    """A console of its own, with a clock that is set by hand."""

    def __init__(self, *, terminal: bool) -> None:
        self.file = io.StringIO()
        self.now_s = 0.0
        console = Console(
            file=self.file, force_terminal=terminal, width=60, highlight=False, markup=False
        )
        self.steps = Steps("cases", console, lambda: self.now_s)

    def at(self, now_s: float, done: int, total: int = 20) -> str:
        """Return what is written for a step at this time."""
        self.now_s = now_s
        before = len(self.file.getvalue())
        self.steps.tell(done, total)
        return self.file.getvalue()[before:]


def test_a_short_computation_says_nothing_and_a_long_one_what_is_left() -> None:
    told = Told(terminal=False)
    assert told.at(1.9, 10) == ""
    assert told.at(TOLD_AFTER_S, 5) == "  5 of 20 cases, 0:06 left\n"
    assert told.at(TOLD_AFTER_S + 0.9 * PRINTED_EVERY_S, 6) == ""
    assert told.at(20.0, 19) == "  19 of 20 cases, 0:02 left\n"
    told.steps.begin()
    assert told.at(21.0, 1) == ""
    told.steps.close()
    assert told.file.getvalue().count("\n") == 2


def test_a_terminal_has_one_line_that_disappears() -> None:
    told = Told(terminal=True)
    drawn = told.at(3.0, 15)
    assert drawn.startswith(START_OF_LINE)
    assert drawn.endswith(" 75 %  15 of 20 cases, 0:01 left")
    assert told.at(3.05, 16) == ""
    assert len(told.at(3.2, 3).removeprefix(START_OF_LINE)) < 60
    told.steps.close()
    assert told.file.getvalue().endswith(START_OF_LINE)
    length = len(told.file.getvalue())
    told.steps.close()
    assert len(told.file.getvalue()) == length


def test_what_cannot_tell_its_steps_tells_its_time() -> None:
    """One native call, watched from a thread; nothing is left of its line."""
    told = Told(terminal=True)
    told.now_s = TOLD_AFTER_S + 1.0
    with told.steps.clocked("weighing"):
        for _ in range(6000):
            if told.file.getvalue():
                break
            time.sleep(0.01)
    assert told.file.getvalue() == f"{START_OF_LINE}weighing, 0:03 so far{START_OF_LINE}"
    plain = Told(terminal=False)
    plain.steps.tell_time("weighing")
    plain.now_s = 70.0
    plain.steps.tell_time("weighing")
    plain.steps.tell_time("weighing")
    assert plain.file.getvalue() == "  weighing, 1:10 so far\n"


def test_every_long_computation_tells_its_steps(
    finished: CampaignResult, gantry: Path, tmp_path: Path
) -> None:
    """From nothing to nearly all, in order; the verbs show these calls."""
    from ilc_rt.report import write_report
    from ilc_rt.tuning import propose_weights

    told: dict[str, list[tuple[int, int]]] = {}

    def steps(name: str) -> object:
        return lambda done, total: told.setdefault(name, []).append((done, total))

    propose_weights(gantry, progress=steps("tune"))
    write_report(finished, tmp_path / "r.html", steps("plot"))
    for name, calls in told.items():
        done = [call[0] for call in calls]
        assert done[0] == 0, name
        assert done == sorted(done), name
        assert {total for _, total in calls} == {calls[0][1]}, name
        assert done[-1] <= calls[0][1], name
    assert len(told["tune"]) > 3
    assert len(told["plot"]) == 6


def filled(path: Path, n_runs: int) -> Path:
    """Make a library of runs of 16 kB."""
    library = Library(path)
    library.append(np.zeros((500, 2)), np.ones((500, 2)), 0.002, cell="gantry", campaign="c")
    (row,) = library_file.rows(library, [1])
    more = (row | {"iteration": number} for number in range(1, n_runs))
    library_file.insert(library, [run | {"digest": library_file.digest(run)} for run in more])
    return path


def interrupt(process: Process) -> list[str]:
    """Press Ctrl-C, and return the errors beside lines of progress; none is a traceback."""
    process.signal(signal.SIGINT)
    try:
        assert process.end() == EXIT_INTERRUPTED, process.errors
    finally:
        process.close()
    assert not any("Traceback" in line for line in process.errors), process.errors
    return [line for line in process.errors if not re.match(r"  [0-9.]+ of [0-9]+ ", line)]


def ilc(folder: Path, *words: str | Path, before: str = "") -> Process:
    """Start `ilc`, after some lines of Python that make it slow at one place."""
    source = f"import sys\n{before}\nfrom ilc_rt.cli import main\nsys.exit(main(sys.argv[1:]))"
    return Process([sys.executable, "-c", source, *map(str, words)], folder)


#: Waits in the middle of a function until a signal comes, having said so.
WAITING = """
import importlib, time
module, name, at = {module!r}, {name!r}, {at}
place = importlib.import_module(module)
owner = place
*path, last = name.split(".")
for part in path:
    owner = getattr(owner, part)
function, calls = getattr(owner, last), []
def waiting(*arguments, **keywords):
    calls.append(1)
    if len(calls) == at:
        print("waiting", flush=True)
        time.sleep(60)
    return function(*arguments, **keywords)
setattr(owner, last, waiting)
"""


def slow(module: str, name: str, at: int = 1) -> str:
    """Return the lines that stop a function at a call."""
    return WAITING.format(module=module, name=name, at=at)


def test_ctrl_c_in_tune_leaves_the_cell_as_it_was(gantry: Path, tmp_path: Path) -> None:
    cell = tmp_path / "gantry.toml"
    cell.write_bytes(gantry.read_bytes())
    process = ilc(
        tmp_path, "tune", cell, "--write", before=slow("ilc_rt.trials", "Bench.try_weights", 5)
    )
    process.line_with("waiting")
    assert interrupt(process) == []
    assert cell.read_bytes() == gantry.read_bytes()


def test_ctrl_c_in_a_sweep_keeps_every_finished_case(gantry: Path, tmp_path: Path) -> None:
    """And the same command continues with the others."""
    words = ["sweep", gantry, "--vary", "axis.y.simulation.mass_kg=15:25", "--samples", "3",
             "--iterations", "2", "--file", "kept.jsonl", "--json", "found.json"]  # fmt: skip
    process = ilc(tmp_path, *words, before=slow("ilc_rt.cell_sweep", "Campaign.run", 3))
    process.line_with("waiting")
    (said,) = interrupt(process)
    assert "kept.jsonl has every finished case" in said
    kept = (tmp_path / "kept.jsonl").read_text()
    assert [json.loads(line).get("case") for line in kept.splitlines()] == [None, 0, 1]
    again = ilc(tmp_path, *words)
    assert again.end() == 0, again.errors
    again.close()
    assert (tmp_path / "kept.jsonl").read_text().startswith(kept)
    assert json.loads((tmp_path / "found.json").read_text())["cases"]


def test_ctrl_c_in_an_experiment_stops_the_axes_and_keeps_the_library(
    gantry: Path, tmp_path: Path
) -> None:
    """The experiment before stays; the one that was stopped is not stored."""
    library, cell = tmp_path / "l.db", tmp_path / "gantry.toml"
    cell.write_text(gantry.read_text(encoding="utf-8") + PATIENT, encoding="utf-8")
    words = ["identify", cell, "--axis", "y", "--library", library, "--bus"]
    first = ilc(tmp_path, *words, "loopback:")
    assert first.end() == 0, first.errors
    first.close()
    before = content(library)
    # In real time one takes 50 s.
    process = ilc(tmp_path, *words, free_bus())
    process.line_with("exciting axis y")
    said = interrupt(process)
    assert said[-1].startswith("ilc: stopped on request; the axes are at rest")
    assert content(library) == before


@pytest.mark.parametrize("out", ["pictures", "r.html"])
def test_ctrl_c_in_plot_keeps_the_former_pictures(
    finished: CampaignResult, tmp_path: Path, out: str
) -> None:
    first = ilc(tmp_path, "plot", finished.library, "--out", out)
    assert first.end() == 0, first.errors
    first.close()
    files = sorted(path for path in tmp_path.glob("**/*") if path.suffix in {".png", ".html"})
    assert files
    before = [path.read_bytes() for path in files]
    # While the third picture is drawn, as bytes that no file has yet.
    slowed = slow("matplotlib.figure", "Figure.savefig", 3)
    process = ilc(tmp_path, "plot", finished.library, "--out", out, before=slowed)
    process.line_with("waiting")
    assert interrupt(process) == []
    assert [path.read_bytes() for path in files] == before


#: Runs go ten by ten, also where few are left.
IN_BATCHES = """
import ilc_rt.library
ilc_rt.library.DELETED_AT_ONCE = 10
ilc_rt.library.DELETED_TOGETHER = 0
"""


@pytest.mark.parametrize(("at", "left"), [(1, 60), (3, 40)])
def test_ctrl_c_in_trim_deletes_whole_batches_and_the_next_one_goes_on(
    at: int, left: int, tmp_path: Path
) -> None:
    path = filled(tmp_path / "l.db", 60)
    before, size = content(path), path.stat().st_size
    words = ["library", "trim", path, "--newest", "10"]
    process = ilc(
        tmp_path, *words, before=IN_BATCHES + slow("ilc_rt.library", "Library._remove", at)
    )
    process.line_with("waiting")
    assert interrupt(process) == [f"ilc: stopped; {60 - left} runs are deleted, {left} are there"]
    assert content(path) == before[-left:]
    again = ilc(tmp_path, *words)
    assert again.end() == 0, again.errors
    again.close()
    assert again.said == [f"{left - 10} runs deleted from {path}"]
    assert content(path) == before[-10:]
    assert path.stat().st_size < size


def test_ctrl_c_in_trim_by_relevance_leaves_the_rest(tmp_path: Path) -> None:
    path = filled(tmp_path / "l.db", 60)
    size, words = path.stat().st_size, ["library", "trim", path, "10"]
    process = ilc(
        tmp_path, *words, before=IN_BATCHES + slow("ilc_rt.library", "Library._remove", 3)
    )
    process.line_with("waiting")
    assert interrupt(process) == ["ilc: stopped; 20 runs are deleted, 40 are there"]
    again = ilc(tmp_path, *words)
    assert again.end() == 0, again.errors
    again.close()
    assert again.said == [f"30 runs deleted from {path}"]
    assert len(ReadOnlyLibrary(path)) == 10
    assert path.stat().st_size < size


def test_ctrl_c_in_sync_keeps_whole_batches_and_the_next_one_goes_on(
    finished: CampaignResult, tmp_path: Path
) -> None:
    rows = template(finished.library)[:1]
    library, back = tmp_path / "l.db", tmp_path / "back.db"
    make_cell(library, rows, 1)
    (row,) = library_file.rows(ReadOnlyLibrary(library), [1])
    more = (row | {"iteration": number} for number in range(1, 2 * BATCH + 5))
    runs = [run | {"digest": library_file.digest(run)} for run in more]
    library_file.insert(Library(library), runs)
    there = len(ReadOnlyLibrary(library))
    with server() as postgres:
        address = postgres.database()
        # In the middle of the second batch.
        slowed = slow("psycopg", "Cursor.fetchone", 8 + BATCH + 20)
        for words, at in (
            (["library", "sync", library, address], slowed),
            (["library", "sync", address, back, "--cell", "cell-001"],
             slow("ilc_rt.library_file", "insert", 2)),
        ):  # fmt: skip
            process = ilc(tmp_path, *words, before=at)
            process.line_with("waiting")
            said = interrupt(process)
            assert said == ["ilc: stopped; what was stored stays, and the next sync goes on"]
            if words[2] == library:
                with FleetLibrary(address) as fleet:
                    assert len(fleet) == BATCH
                assert push(str(library), address).stored == there - BATCH
            else:
                assert len(ReadOnlyLibrary(back)) == BATCH
                assert pull(address, str(back), "cell-001").stored == there - BATCH
        told: list[tuple[int, int]] = []
        pull(address, str(tmp_path / "third.db"), "cell-001", lambda *step: told.append(step))
        assert told == [(0, there), (BATCH, there), (2 * BATCH, there)]
    assert content(back) == content(library)


def test_a_sweep_in_python_is_interrupted_without_loss(tmp_path: Path) -> None:
    """KeyboardInterrupt passes through, and the file has what was finished."""

    def case(number: int) -> int:
        if number == 2:
            raise KeyboardInterrupt
        return number

    with pytest.raises(KeyboardInterrupt):
        sweep(case, [{"number": n} for n in range(4)], file=tmp_path / "s.jsonl")
    assert len((tmp_path / "s.jsonl").read_text().splitlines()) == 3


def test_a_pipe_that_is_closed_is_no_traceback(finished: CampaignResult, tmp_path: Path) -> None:
    """As in `ilc library list | head -1`."""
    done = subprocess.run(
        f"{sys.executable} -m ilc_rt.cli library list {finished.library} | head -1",
        shell=True, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
