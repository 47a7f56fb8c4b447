"""Libraries of many runs: pages, readers that change nothing, rules of trimming, relevance."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ilc_rt import BadInputError, Library, ReadOnlyLibrary, library_file
from ilc_rt.retention import kept_by

if TYPE_CHECKING:
    from collections.abc import Callable

    from ilc_rt import CampaignResult

N_RUNS = 12


@pytest.fixture
def library(tmp_path: Path) -> Library:
    """Return two campaigns of six runs each, one of each cell after the other."""
    library = Library(tmp_path / "l.db")
    for number in range(N_RUNS):
        cell = ("press", "lathe")[number % 2]
        error = np.full(4, 1e-4 * (1 + (number * 5) % 7))
        library.append(np.zeros(4), error, 0.01, 20.0 + number, cell=cell, campaign=f"{cell}-1")
    return library


def test_a_page_is_a_part_of_the_list(library: Library, finished: CampaignResult) -> None:
    runs = library.list()
    assert len(library) == len(runs) == N_RUNS
    assert library.page(limit=5, offset=4) == runs[4:9]
    assert library.page(limit=5, offset=11) == runs[11:]
    assert library.page("lathe", limit=2, offset=1) == [runs[3], runs[5]]
    assert library.page(campaign="press", limit=100) == runs[::2]
    assert library.page(campaign="press-2", limit=100) == []
    real = Library(finished.library)
    (page,) = real.page(limit=1, offset=1)
    assert page == real.list()[1]
    assert list(page) == list(real.list()[1])
    with pytest.raises(BadInputError, match="offset = -1: a number of runs, 0 or more"):
        library.page(limit=1, offset=-1)


def test_the_list_of_the_command_line_has_pages(ilc: Callable[..., object], library: Library):
    listed = ilc("library", "list", library.path, "--limit", 3, "--offset", 2)
    rows = [line.split() for line in listed.stdout.splitlines() if "-1 " in line]
    assert [row[0] for row in rows] == ["3", "4", "5"]
    assert f"3 of 12 runs in {library.path}" in listed.stdout
    for wrong in (["--offset", 2], ["--json", "-", "--csv", "-"]):
        refused = ilc("library", "list", library.path, *wrong)
        assert (refused.returncode, len(refused.stderr.splitlines()), refused.stdout) == (2, 1, "")
    # A mistyped name is seen.
    listed = ilc("library", "list", library.path, "--cell", "pres")
    assert f"0 of 12 runs in {library.path}" in listed.stdout


def test_a_run_is_shown_without_a_list_of_all(
    ilc: Callable[..., object], library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ilc_rt.commands.library import _load

    assert [run["id"] for run in library.page(limit=1, offset=6)] == [7]
    with sqlite3.connect(library.path) as writer:
        writer.execute("UPDATE signals SET input = zeroblob(8) WHERE id = 3")
    writer.close()
    for run, told in ((3, "digest"), (99, "no run 99; there are 1 to 12"), (-1, "1 to 12")):
        refused = ilc("library", "show", library.path, "--", run)
        assert (refused.returncode, len(refused.stderr.splitlines())) == (2, 1)
        assert told in refused.stderr
    monkeypatch.setattr(ReadOnlyLibrary, "page", None)
    assert _load(Path(library.path), 7)["id"] == 7


def test_wide_letters_keep_the_columns(ilc: Callable[..., object], tmp_path: Path) -> None:
    library = Library(tmp_path / "l.db")
    for cell in ("press", "機械"):
        library.append(np.zeros(2), np.ones(2), 0.01, cell=cell, law="pd", campaign="a")
    lines = ilc("library", "list", "l.db").stdout.splitlines()
    narrow, wide = (line for line in lines if " pd " in line)
    assert narrow.index(" pd ") == wide.index(" pd ") + 2


def test_two_long_names_share_the_width(ilc: Callable[..., object], tmp_path: Path) -> None:
    library = Library(tmp_path / "l.db")
    library.append(np.zeros(2), np.ones(2), 0.01, cell="c" * 200, law="l" * 90, campaign="a")
    (row,) = (line for line in ilc("library", "list", "l.db").stdout.splitlines() if "cc" in line)
    assert len(row) <= 140
    assert abs(row.count("c") - row.count("l")) <= 1
    assert row.count("l") > 20


def test_a_reader_creates_and_changes_nothing(library: Library, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.db: no such library"):
        ReadOnlyLibrary(tmp_path / "none.db")
    (tmp_path / "empty.db").touch()
    with pytest.raises(OSError, match="an empty file"):
        ReadOnlyLibrary(tmp_path / "empty.db")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    reader = ReadOnlyLibrary(library.path)
    assert len(reader) == N_RUNS
    assert reader.page(limit=2) == library.list()[:2]
    assert reader.recall(20.0, 1)[0]["id"] == 1
    for write in (
        lambda: reader.append(np.zeros(2), np.ones(2), 0.01),
        lambda: reader.trim(1),
        lambda: reader.retain(newest=1),
    ):
        with pytest.raises(PermissionError, match="opened to be read only"):
            write()
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_reader_sees_the_log_of_a_writer(library: Library) -> None:
    with sqlite3.connect(library.path) as writer:
        writer.execute("UPDATE iteration SET remark = 'seen' WHERE id = 3")
        writer.commit()
        assert library.page(limit=1, offset=2)[0]["remark"] == "seen"
        assert len(ReadOnlyLibrary(library.path)) == N_RUNS
    writer.close()


def test_rules_keep_the_newest_and_the_best(library: Library) -> None:
    by_error = {run["id"]: run["tracking_rms_m"] for run in library.list() if run["id"] % 2}
    best = min(by_error, key=by_error.__getitem__)
    assert library.retain(best=1, cell="press") == 4
    left = [run["id"] for run in library.list()]
    assert left == sorted({best, 11} | set(range(2, 13, 2)))
    assert library.retain(newest=3) == len(left) - 3
    assert [run["id"] for run in library.list()] == left[-3:]
    assert library.retain(days=1) == 0
    assert library.load(left[-1])["digest"] == library.list()[-1]["digest"]
    with pytest.raises(BadInputError, match="no rule: at least one of newest, days, best"):
        library.retain()
    with pytest.raises(BadInputError, match=r"days = -1: a number of 0 or more"):
        library.retain(days=-1)


@pytest.mark.parametrize(
    ("together", "firsts"), [(0, [0, 4, 8]), (9, [0, 4, 8]), (10, [0]), (200_000, [0])]
)
def test_runs_are_deleted_in_batches_that_are_told(
    library: Library, monkeypatch: pytest.MonkeyPatch, together: int, firsts: list[int]
) -> None:
    """No writer waits for all of them; oldest first, so that the rest is a library, too."""
    monkeypatch.setattr("ilc_rt.library.DELETED_AT_ONCE", 4)
    monkeypatch.setattr("ilc_rt.library.DELETED_TOGETHER", together)
    told: list[tuple[int, int]] = []
    left: list[list[int]] = []

    def tell(done: int, total: int) -> None:
        told.append((done, total))
        left.append([run["id"] for run in library])

    assert library.retain(newest=2, progress=tell) == 10
    assert told == [(first, 10) for first in firsts]
    assert left == [list(range(1 + first, 13)) for first in firsts]
    assert [run["id"] for run in library] == [11, 12]


def test_age_counts_from_now_and_the_newest_run_of_a_campaign_stays() -> None:
    from datetime import datetime, timezone

    runs = [
        {
            "id": day, "campaign": "a" if day < 20 else "b", "phase": None, "rolled_back": False,
            "tracking_rms_m": 1.0, "created_utc": f"2026-11-{day:02}T12:00:00.000Z",
        }
        for day in (1, 10, 19, 21, 28)
    ]  # fmt: skip
    now = datetime(2026, 11, 29, tzinfo=timezone.utc)
    assert kept_by(runs, days=10, now=now) == {19, 21, 28}
    assert kept_by(runs, days=0, now=now) == {19, 28}
    # To the millisecond: a run of this very second is older than 0 days.
    soon = datetime(2026, 11, 10, 12, 0, 0, 1000, tzinfo=timezone.utc)
    assert kept_by(runs[:3], days=0, now=soon) == {19}
    assert kept_by(runs[:3], days=1e-7, now=soon) == {10, 19}


def test_the_space_of_deleted_runs_is_returned(tmp_path: Path) -> None:
    library = Library(tmp_path / "l.db")
    for _ in range(30):
        library.append(np.zeros(5000), np.ones(5000), 0.01)
    size = (tmp_path / "l.db").stat().st_size
    assert library.retain(newest=3) == 27
    assert (tmp_path / "l.db").stat().st_size < size / 5


def test_trim_wants_a_number_or_rules(ilc: Callable[..., object], library: Library) -> None:
    for arguments in ([], [3, "--best", 1]):
        refused = ilc("library", "trim", library.path, *arguments)
        assert (refused.returncode, len(refused.stderr.splitlines())) == (2, 1)
    assert "10 runs deleted" in ilc("library", "trim", library.path, "--days", 0).stdout


def test_recall_weighs_distance_and_error(tmp_path: Path) -> None:
    library = Library(tmp_path / "l.db")
    for error, temperature in ((1e-3, 20.0), (1e-5, 22.0), (1e-6, 30.0)):
        library.append(np.zeros(4), np.full(4, error), 0.01, temperature)

    def order(error: float) -> list[int]:
        return [run["id"] for run in library.recall(20.0, error=error)]

    assert order(0.0) == [1, 2, 3]
    assert order(1e7) == [2, 1, 3]
    assert order(1e12) == [3, 2, 1]
    assert [run["id"] for run in library.recall(20.0, 1, error=1e12)] == [3]
    with pytest.raises(BadInputError, match=r"error = -1\.0: a weight of 0 or more"):
        library.recall(20.0, error=-1.0)


def test_the_digest_of_a_row_is_that_of_the_controller(finished: CampaignResult) -> None:
    rows = library_file.rows(ReadOnlyLibrary(finished.library), [1, 2, 3])
    assert [library_file.digest(row) for row in rows] == [row["digest"] for row in rows]
    damaged = rows[0] | {"input": rows[0]["input"][:-1] + b"\x01"}
    assert library_file.digest(damaged) != damaged["digest"]
