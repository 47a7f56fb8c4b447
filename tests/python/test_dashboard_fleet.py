"""The pages of the dashboard over a fleet database: runs, comparison, relevance, loss."""

from __future__ import annotations

import json
import shutil
import socket
import sys
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

import pytest
from fleet_fixture import make_cell, template
from ports_fixture import free_port
from postgres_fixture import server
from processes_fixture import BROWSER_WAIT_MS, Process

from ilc_rt import BadInputError, Library
from ilc_rt.cli import main
from ilc_rt.dashboard import charts
from ilc_rt.dashboard.archive import Archive, distance, relevance
from ilc_rt.events import parse_event
from ilc_rt.fleet import Collector, FleetLibrary, push
from ilc_rt.fleet.database import connect
from ilc_rt.monitor import Message
from ilc_rt.sources import RETRY_S, FleetSource

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from postgres_fixture import Server

    from ilc_rt import CampaignResult

pytestmark = pytest.mark.xdist_group("postgres")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="module")
def running() -> Iterator[Server]:
    with server() as started:
        yield started


@pytest.fixture
def address(running: Server, finished: CampaignResult, tmp_path: Path) -> str:
    """Return a database with the campaign of the gantry, and with two small cells."""
    found = running.database()
    push(str(finished.library), found)
    rows = template(finished.library)
    for number in (1, 2):
        make_cell(tmp_path / "small.db", rows, number)
    push(str(tmp_path / "small.db"), found)
    return found


@pytest.fixture
def archive_of() -> Iterator[Callable[..., Archive]]:
    """Return a function that opens an archive, which is closed after the test."""
    with ExitStack() as stack:
        yield lambda *addresses: stack.enter_context(Archive(addresses))


def test_pages_read_a_database_as_they_read_a_file(
    address: str, finished: CampaignResult, archive_of: Callable[..., Archive]
) -> None:
    fleet, file = archive_of(address), archive_of(finished.library)
    own = ("id", "library", "has_signals")
    for there, here in zip(fleet.campaign("gantry"), file.campaign("gantry"), strict=True):
        assert there["has_signals"]
        assert {k: v for k, v in there.items() if k not in own} == {
            k: v for k, v in here.items() if k not in own
        }
    assert {row["cell"] for row in fleet.rows()} == {"gantry", "cell-001", "cell-002"}
    captured, same = fleet.capture("gantry", None), file.capture("gantry", None)
    assert captured is not None
    assert same is not None
    assert (captured.reference_m == same.reference_m).all()
    assert fleet.flight("gantry", fleet.campaign("gantry")) is None


def test_runs_of_several_cells_are_compared_and_weighed(
    address: str, archive_of: Callable[..., Archive]
) -> None:
    archive = archive_of(address)
    rows = archive.rows()
    one, other = (next(r for r in rows if r["cell"] == f"cell-00{n}") for n in (1, 2))
    runs = archive.aligned([(0, one["id"]), (0, other["id"])], axis=0)
    assert runs[1].is_same
    assert len(charts.compared(runs, "error", 0)["series"]) == 2
    assert distance(one, other) == pytest.approx(1 / 7)
    small = [row for row in rows if row["cell"] != "gantry"]
    shares = relevance(small, one)
    assert sum(shares) == pytest.approx(1.0)
    assert shares[small.index(one)] > shares[small.index(other)]


def test_a_file_and_a_database_are_shown_together_and_a_run_once(
    address: str, finished: CampaignResult, archive_of: Callable[..., Archive]
) -> None:
    archive = archive_of(finished.library, address)
    assert [row["index"] for row in archive.campaign("gantry")] == [0, 1, 2]
    first = archive.rows()[0]
    runs = archive.aligned([(0, first["id"]), (1, archive.campaign("gantry")[0]["id"])], axis=1)
    assert runs[1].shift_s == 0.0


def test_a_run_that_arrives_and_one_that_changes_are_read_again(
    address: str, finished: CampaignResult, archive_of: Callable[..., Archive]
) -> None:
    archive = archive_of(address)
    n_before = len(archive.rows())
    rows = Library(finished.library).list()
    same = ("n_samples", "n_axes", "axis_names", "cycle_s", "measure", "law", "input_units")
    start = {key: rows[0][key] for key in same} | {
        "event": "start", "cell": "press", "campaign": "c9", "first_index": 0, "iterations": 1,
        "bus": "loopback:", "mode": "lock-step",
    }  # fmt: skip
    judged = {"event": "judged", "id": 1, "index": 0, "rolled_back": True, "learning_off": False,
              "remark": "the error grew"}  # fmt: skip
    run = rows[0] | {"event": "iteration"}
    with Collector(address) as collector:
        for event in (start, run):
            collector.take(Message("press", "", event, parse_event(json.dumps(event))))
        assert len(archive.rows()) == n_before + 1
        (arrived,) = archive.campaign("press")
        assert not arrived["rolled_back"]
        with pytest.raises(BadInputError, match="`ilc library sync` brings its arrays"):
            archive.load((0, arrived["id"]))
        collector.take(Message("press", "", judged, parse_event(json.dumps(judged))))
    (arrived,) = archive.campaign("press")
    assert (arrived["rolled_back"], arrived["remark"]) == (True, "the error grew")
    with pytest.raises(BadInputError, match=r"@/fleet\d+: no run 999 any more"):
        archive.load((0, 999))


def test_a_lost_database_is_not_asked_all_the_time_and_found_again(address: str) -> None:
    now = [0.0]
    with closing(FleetSource(address, lambda: now[0])) as source:
        n_runs = len(source.rows())
        with connect(address) as admin:
            admin.execute(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
                "WHERE pid <> pg_backend_pid() AND datname = current_database()"
            )
        for _ in range(2):
            with pytest.raises(BadInputError, match="@/fleet"):
                source.stamp()
        now[0] = RETRY_S
        assert len(source.rows()) == n_runs


def test_nothing_is_written_to_the_database(address: str) -> None:
    psycopg = pytest.importorskip("psycopg")
    with FleetLibrary(address) as fleet, pytest.raises(psycopg.errors.ReadOnlySqlTransaction):
        fleet._connection.execute("DELETE FROM run")


def test_a_database_that_cannot_be_read_is_one_line_without_its_password(
    running: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("nicegui", reason="nicegui is not installed")
    closed = f"postgresql://ilc:secret@127.0.0.1:{free_port(socket.SOCK_STREAM)}/ilc"
    for library, told in ((closed, "refused"), (running.database(), "no tables of a fleet")):
        assert main(["dashboard", "--no-scouting", "--library", library]) == 2
        said = capsys.readouterr().err.splitlines()
        assert len(said) == 1
        assert told in said[0]
        assert "secret" not in said[0]


@pytest.mark.timeout(600)
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this computer")
def test_a_browser_compares_runs_of_a_fleet(address: str, tmp_path: Path) -> None:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    pytest.importorskip("nicegui", reason="nicegui is not installed")
    argv = [sys.executable, "-m", "ilc_rt.cli", "dashboard", "--port", "0", "--no-scouting",
            "--library", address]  # fmt: skip
    process = Process(argv, tmp_path)
    try:
        url = process.line_with("dashboard: ").partition(": ")[2]
        with sync_api.sync_playwright() as tools:
            browser = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            page = browser.new_page()
            page.set_default_timeout(BROWSER_WAIT_MS)
            page.goto(f"{url}/library")
            page.fill('input[type="search"]', "cell-00")
            sync_api.expect(page.locator("[data-run]")).to_have_count(6, timeout=BROWSER_WAIT_MS)
            for box in page.locator("[data-run]").all()[:2]:
                box.check()
            page.wait_for_function("ilc.option('compare-error')?.series.length === 2")
            told = page.get_by_text("notes belong to library files")
            sync_api.expect(told).to_be_visible(timeout=BROWSER_WAIT_MS)
            browser.close()
    finally:
        process.close()
