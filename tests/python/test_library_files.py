"""Files that are not a library, cannot be written, or disappear: nothing is changed or lost."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import shutil
import signal
import sqlite3
import stat
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ports_fixture import free_bus
from processes_fixture import Bench

from ilc_rt import Library

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from ilc_rt import CampaignResult

    Ilc = Callable[..., subprocess.CompletedProcess[str]]

MS_RDONLY, MS_REMOUNT, MS_BIND = 1, 32, 4096
LIBC = ctypes.CDLL(None, use_errno=True)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


@contextlib.contextmanager
def mounted(source: str, place: Path, kind: str, flags: int, data: str = "") -> Iterator[None]:
    """Mount something temporarily; skip the test where that is not permitted."""
    place.mkdir(exist_ok=True)
    if LIBC.mount(source.encode(), str(place).encode(), kind.encode(), flags, data.encode()):
        pytest.skip(f"no mounts here: {os.strerror(ctypes.get_errno())}")
    try:
        if flags & MS_BIND:
            remount = MS_RDONLY | MS_REMOUNT | MS_BIND
            assert LIBC.mount(b"none", str(place).encode(), None, remount, None) == 0
        yield
    finally:
        LIBC.umount2(str(place).encode(), 2)


def files(folder: Path) -> dict[str, bytes]:
    """Return the contents of a folder."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


def foreign(kind: str, path: Path) -> None:
    """Make a file that is not a library of this program."""
    if kind == "text":
        path.write_text("this is no database, it only looks like a file")
        return
    connection = sqlite3.connect(path)
    if kind == "write-ahead log":
        connection.execute("PRAGMA journal_mode = WAL")
    table = "iteration" if kind == "same table" else "customers"
    connection.execute(f"CREATE TABLE {table} (id INTEGER, name TEXT)")
    connection.execute(f"INSERT INTO {table} VALUES (1, 'Miller')")
    if kind in {"numbered", "same table"}:
        connection.execute("PRAGMA user_version = 2")
    if kind == "marked":
        connection.execute("PRAGMA application_id = 42")
    connection.commit()
    connection.close()


FOREIGN = ["text", "plain", "numbered", "marked", "same table", "write-ahead log"]
VERBS: list[list[str]] = [
    ["library", "list", "c.db"],
    ["library", "show", "c.db", "1"],
    ["library", "export", "c.db", "1", "run.csv"],
    ["library", "trim", "c.db", "1"],
    ["plot", "c.db"],
]


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_file_is_left_as_it_is(kind: str, tmp_path: Path) -> None:
    """For every request: one line, and not a byte is changed or added."""
    path = tmp_path / "c.db"
    foreign(kind, path)
    before = files(tmp_path)
    found = "not a database" if kind == "text" else "the database of another program"
    with pytest.raises(OSError, match=found):
        Library(path)
    assert files(tmp_path) == before


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_every_verb_refuses_a_foreign_database(ilc: Ilc, verb: list[str], tmp_path: Path) -> None:
    """Exit status 2, one line that names the file."""
    foreign("plain", tmp_path / "c.db")
    before = files(tmp_path)
    refused = ilc(*verb)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert "c.db: the database of another program; allowed: " in line
    assert files(tmp_path) == before


def test_a_campaign_does_not_write_into_a_foreign_database(
    ilc: Ilc, gantry: Path, tmp_path: Path
) -> None:
    """Refused before anything moves."""
    foreign("plain", tmp_path / "c.db")
    before = files(tmp_path)
    refused = ilc("run", gantry, "--bus", "loopback:", "-n", 1, "--library", "c.db")
    assert refused.returncode == 2
    assert "the database of another program" in refused.stderr
    assert files(tmp_path) == before


def test_what_is_no_file_is_refused_without_waiting(ilc: Ilc, tmp_path: Path) -> None:
    """A folder, a FIFO without a writer, a device."""
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name, found in [("folder", "a folder"), ("pipe", "no regular file"), ("/dev/zero", "no")]:
        with pytest.raises(OSError, match=found):
            Library(tmp_path / name)
        refused = ilc("library", "list", name, timeout_s=30.0)
        assert refused.returncode == 2
        assert len(refused.stderr.splitlines()) == 1
    (tmp_path / "empty").touch()
    refused = ilc("library", "list", "empty")
    assert (refused.returncode, (tmp_path / "empty").stat().st_size) == (2, 0)


@pytest.mark.parametrize(
    "name", ["file:c.db?mode=memory", "file:c.db", "c.db?mode=ro", "100 %41 #1.db", "é.db"]
)
def test_a_name_is_never_an_address(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file has exactly the given name, and is read by it."""
    monkeypatch.chdir(tmp_path)
    Library(name).append(np.zeros(3), np.ones(3), 0.01)
    assert (tmp_path / name).is_file()
    assert len(Library(name).list()) == 1
    with pytest.raises(OSError, match=r"sqlite:///c\.db"):
        Library("sqlite:///c.db")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_readers_leave_nothing_beside_the_file(
    ilc: Ilc, finished: CampaignResult, tmp_path: Path
) -> None:
    """Listing, showing and exporting neither change nor add files."""
    (tmp_path / "a").mkdir()
    shutil.copy(finished.library, tmp_path / "a" / "l.db")
    before = files(tmp_path / "a")
    assert ilc("library", "list", "a/l.db").returncode == 0
    assert ilc("library", "show", "a/l.db", 1).returncode == 0
    assert ilc("library", "export", "a/l.db", 1, "run.json").returncode == 0
    assert files(tmp_path / "a") == before


def test_an_archive_that_cannot_be_written_is_read(
    ilc: Ilc, finished: CampaignResult, gantry: Path, tmp_path: Path
) -> None:
    """A read-only file system: listed and exported; a campaign into it is refused."""
    (tmp_path / "a").mkdir()
    shutil.copy(finished.library, tmp_path / "a" / "l.db")
    with mounted(str(tmp_path / "a"), tmp_path / "ro", "none", MS_BIND):
        assert "3 runs in ro/l.db" in ilc("library", "list", "ro/l.db").stdout
        assert ilc("library", "export", "ro/l.db", 1, "run.json").returncode == 0
        for verb in (
            ["library", "trim", "ro/l.db", "1"],
            ["run", gantry, "--bus", "loopback:", "--library", "ro/l.db"],
            ["run", gantry, "--bus", "loopback:", "--library", "ro/new.db"],
        ):
            refused = ilc(*verb)
            assert refused.returncode == 2, verb
            (line,) = refused.stderr.splitlines()
            assert ".db: cannot be" in line
    assert len(Library(tmp_path / "a" / "l.db").list()) == 3


def test_files_are_tried_before_anything_moves(ilc: Ilc, gantry: Path, tmp_path: Path) -> None:
    """--json and --report in an unwritable place: exit status 2, and no run is made."""
    (tmp_path / "a").mkdir()
    (tmp_path / "file").touch()
    run = ["run", gantry, "--bus", "loopback:", "-n", 1]
    cases = [("--json", "none/f.json"), ("--json", "a"), ("--report", "file/r.html")]
    for option, name in cases:
        refused = ilc(*run, option, name)
        assert refused.returncode == 2, name
        (line,) = refused.stderr.splitlines()
        assert line.startswith(f"ilc: {option} ")
    with mounted(str(tmp_path / "a"), tmp_path / "ro", "none", MS_BIND):
        for option in ("--json", "--report"):
            assert ilc(*run, option, "ro/f.html").returncode == 2
    assert not (tmp_path / "ilc-library.db").exists()
    assert ilc(*run, "--report", "new", "--json", "f.json").returncode == 0
    assert (tmp_path / "new" / "ilc-report.html").exists()


def lock(path: Path) -> sqlite3.Connection:
    """Hold the lock of a writer."""
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("BEGIN IMMEDIATE")
    return connection


def test_a_locked_library_stops_the_campaign_soon(bench: Bench) -> None:
    """In real time: a run that cannot be kept stops the axes, and the others are counted."""
    cell = bench.cell(short=True)
    bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=20)
    controller.event(event="iteration", index=1)
    holder = lock(bench.library)
    controller.event(event="state", state="returning", iteration=3)
    assert controller.end() == 3
    holder.close()
    (line,) = controller.errors
    assert "locked by another program" in line
    assert line.endswith("; run 2 could not be kept, 2 runs are kept")
    assert [index for _, index, _ in bench.kept()] == [0, 1]
    started = {event["iteration"] for event in controller.events if event.get("state") == "running"}
    assert max(started) <= 4, "stopped before many runs were made in vain"
    # The next start is clean, with the same drives.
    resumed = bench.controller(cell, "--simulated-drives", "--resume", runs=3)
    assert resumed.end() == 0, resumed.errors
    assert [index for _, index, _ in bench.kept()] == [0, 1, 2]


def test_a_lock_that_is_let_go_costs_nothing(bench: Bench) -> None:
    """A writer that holds the file for a second is waited for."""
    cell = bench.cell(short=True)
    bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=3)
    controller.event(event="progress", iteration=1)
    holder = lock(bench.library)
    controller.event(event="state", state="returning", iteration=2)
    holder.close()
    assert controller.end() == 0, controller.errors
    assert [index for _, index, _ in bench.kept()] == [0, 1, 2]


def test_a_library_locked_from_the_beginning_is_refused(bench: Bench) -> None:
    """Exit status 2 and nothing moves."""
    cell = bench.cell(short=True)
    Library(bench.library)
    bench.drives(cell)
    holder = lock(bench.library)
    controller = bench.controller(cell, "--simulated-drives", runs=3)
    assert controller.end() == 2
    assert "locked by another program" in controller.errors[-1]
    holder.close()


@pytest.mark.parametrize("pace", ["realtime", "lockstep"])
def test_a_deleted_library_stops_the_campaign(bench: Bench, pace: str) -> None:
    """A library that cannot keep runs is refused before anything moves."""
    cell = bench.cell(short=True)
    options = ["--lockstep"] if pace == "lockstep" else []
    bench.drives(cell, *options)
    controller = bench.controller(cell, "--simulated-drives", *options, runs=200)
    controller.event(event="iteration", index=1)
    bench.library.unlink()
    assert controller.end() == 3
    (line,) = controller.errors
    assert "deleted or replaced while it was in use; run " in line


def test_a_full_disk_stops_the_campaign_and_loses_nothing(bench: Bench) -> None:
    """All reported runs are there, and once there is space the campaign can be resumed."""
    small = bench.folder / "small"
    with mounted("tmpfs", small, "tmpfs", 0, "size=2m"):
        bench.library = small / "l.db"
        cell = bench.cell(short=True)
        bench.drives(cell, "--lockstep")
        controller = bench.controller(cell, "--lockstep", runs=200)
        assert controller.end() == 3
        told = [e["index"] for e in controller.events if e["event"] == "iteration"]
        assert (
            f"; run {len(told)} could not be kept, {len(told)} runs are kept"
            in (controller.errors[-1])
        )
        assert [index for _, index, _ in bench.kept()] == told == list(range(len(told)))
        assert LIBC.mount(b"tmpfs", str(small).encode(), b"tmpfs", MS_REMOUNT, b"size=16m") == 0
        resumed = bench.controller(cell, "--lockstep", "--resume", runs=len(told) + 2)
        assert resumed.end() == 0, resumed.errors
        assert len(bench.kept()) == len(told) + 2


def test_a_campaign_is_gone_on_with_by_one_program_only(bench: Bench) -> None:
    """The second --resume is refused in one line, and disturbs nothing."""
    cell = bench.cell(short=True)
    bench.drives(cell, "--lockstep")
    assert bench.controller(cell, "--lockstep", runs=1).end() == 0
    first = bench.controller(cell, "--lockstep", "--resume", runs=10_000)
    first.event(event="iteration", index=1)
    second = bench.controller(cell, "--lockstep", "--resume", runs=10_000, bus=free_bus())
    assert second.end() == 2
    (line,) = second.errors
    assert line.startswith("ilc-rt: --resume: campaign ")
    assert line.endswith("is going on in another program")
    first.signal(signal.SIGINT)
    assert first.end() == 130


def old_library(path: Path, runs: int) -> None:
    """Make a library in the old format, without application id and incremental vacuum."""
    library = Library(path)
    for run in range(runs):
        library.append(np.zeros((500, 2)), np.full((500, 2), 1e-6 * (run + 1)), 0.002)
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA application_id = 0")
    connection.execute("PRAGMA journal_mode = DELETE")
    connection.execute("PRAGMA auto_vacuum = NONE")
    connection.execute("VACUUM")
    connection.close()


@pytest.mark.parametrize("age", ["new", "old"])
def test_trimming_makes_the_file_smaller(age: str, tmp_path: Path) -> None:
    """Also for an old file."""
    path = tmp_path / "l.db"
    if age == "old":
        old_library(path, 60)
    else:
        library = Library(path)
        for run in range(60):
            library.append(np.zeros((500, 2)), np.full((500, 2), 1e-6 * (run + 1)), 0.002)
    before = path.stat().st_size
    assert Library(path).trim(6) == 54
    assert path.stat().st_size < 0.25 * before
    assert [row["index"] for row in Library(path).list()] == list(range(6))
    assert stat.S_ISREG(path.stat().st_mode)


def test_a_trim_that_is_killed_loses_no_run_that_stays(tmp_path: Path) -> None:
    """Whenever it is killed: either all runs are there, or all that were to stay."""
    for delay_s in (0.0, 0.005, 0.02, 0.05):
        path = tmp_path / f"{delay_s}.db"
        old_library(path, 60)
        code = f"from ilc_rt import Library; print(flush=True); Library({str(path)!r}).trim(6)"
        trim = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
        assert trim.stdout is not None
        trim.stdout.readline()
        time.sleep(delay_s)
        trim.kill()
        trim.wait()
        trim.stdout.close()
        library = Library(path)
        kept = [library.load(row["id"])["index"] for row in library.list()]
        assert kept in (list(range(60)), list(range(6)))
        assert library.trim(6) in {0, 54}
        assert len(library.list()) == 6


@pytest.mark.parametrize("n_axes", [1, 2])
def test_a_run_from_elsewhere_has_all_its_figures(n_axes: int, tmp_path: Path) -> None:
    """The figures are those of the arrays."""
    draw = np.random.default_rng(n_axes)
    reference_m = np.cumsum(draw.normal(size=(40, n_axes)), axis=0) * 1e-3
    e = draw.normal(size=(40, n_axes)) * 1e-5
    library = Library(tmp_path / "l.db")
    library.append(np.zeros((40, n_axes)), e, 0.002, reference_m=reference_m)
    (row,) = library.list()
    # The positions are stored, and the error is their difference: equal up to rounding.
    assert row["tracking_inf_m"] == pytest.approx(np.abs(e).max(), rel=1e-9)
    assert row["encoder_tracking_inf_m"] == pytest.approx(np.abs(e).max(), rel=1e-9)
    if n_axes == 1:
        assert row["contour_inf_m"] is None, "one axis has no contour"
        return
    contour_m = library.load(1)["contour_m"]
    assert row["contour_inf_m"] == np.abs(contour_m).max() > 0
    assert row["contour_rms_m"] == pytest.approx(np.sqrt(np.mean(contour_m**2)))
    assert np.all(contour_m <= np.linalg.norm(e, axis=1) * (1 + 1e-9))


def test_what_is_no_run_is_not_kept(tmp_path: Path) -> None:
    """Nothing is stored that could not be listed again."""
    library = Library(tmp_path / "l.db")
    for wrong in ({"cell": ""}, {"law": "a\x1b[31m"}, {"campaign": "x" * 1000}):
        with pytest.raises(ValueError, match="control characters"):
            library.append(np.zeros(3), np.zeros(3), 0.01, **wrong)
    with pytest.raises(ValueError, match="at least one sample"):
        library.append(np.zeros((0, 2)), np.zeros((0, 2)), 0.01)
    with pytest.raises(ValueError, match="too large"):
        library.append(np.zeros(3), np.full(3, 1e300), 0.01)
    assert library.list() == []


def test_the_list_fits_a_terminal_of_80_columns(
    ilc: Ilc, finished: CampaignResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Everything that `show` and `export` need is complete, at every width."""
    for width in (80, 100, 200):
        monkeypatch.setenv("COLUMNS", str(width))
        argv = [sys.executable, "-m", "ilc_rt.cli", "library", "list", finished.library]
        listed = subprocess.run(argv, capture_output=True, text=True, check=True)
        lines = listed.stdout.splitlines()
        head = next(line for line in lines if "campaign" in line)
        assert {"id", "campaign", "run", "cell", "law"} <= set(head.split())
        rows = [line for line in lines if finished.campaign in line]
        assert [line.split()[0] for line in rows] == ["1", "2", "3"]
        assert [line.split()[2] for line in rows] == ["0", "1", "2"]
        assert max(len(line) for line in (head, *rows)) <= width


def test_the_list_as_json_and_csv(ilc: Ilc, finished: CampaignResult, tmp_path: Path) -> None:
    """All stored data of a run except its arrays; `-` is standard output, without other text."""
    listed = ilc("library", "list", finished.library, "--json", "-")
    rows = json.loads(listed.stdout)
    assert [row["index"] for row in rows] == [0, 1, 2]
    assert rows[0]["axis_names"] == ["x", "y"]
    assert ilc("library", "list", finished.library, "--csv", "runs.csv").returncode == 0
    head, *lines = (tmp_path / "runs.csv").read_text().splitlines()
    assert head.split(",")[:4] == ["id", "created_utc", "cell", "campaign"]
    assert len(lines) == 3
