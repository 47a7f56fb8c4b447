"""Libraries of many cells in one PostgreSQL database: sync, reading, a start from others."""

from __future__ import annotations

import json
import shutil
import sqlite3
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from typing import TYPE_CHECKING

import numpy as np
import pytest
from fleet_fixture import content, make_cell, template
from postgres_fixture import server

from ilc_rt import BadInputError, Campaign, Library, ReadOnlyLibrary
from ilc_rt.fleet import FleetLibrary, Synced, fetch, pull, push
from ilc_rt.fleet.database import connect, newest, version

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from postgres_fixture import Server

    from ilc_rt import CampaignResult

pytestmark = pytest.mark.xdist_group("postgres")


@pytest.fixture(scope="module")
def postgres() -> Iterator[Server]:
    with server() as running:
        yield running


@pytest.fixture
def address(postgres: Server) -> str:
    return postgres.database()


@pytest.fixture
def library(finished: CampaignResult, tmp_path: Path) -> str:
    """Return a copy of a library with one campaign of three runs."""
    return str(shutil.copy(finished.library, tmp_path / "gantry.db"))


@pytest.fixture
def filled(address: str, library: str) -> str:
    """Return a database with that campaign."""
    assert push(library, address).stored == 3
    return address


def renamed(gantry: Path, folder: Path, *changes: tuple[str, str]) -> Path:
    """Return the description of a second cell, with changes."""
    text = gantry.read_text(encoding="utf-8")
    for old, new in (('name = "gantry"', 'name = "gantry-2"'), *changes):
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "gantry-2.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_library_goes_there_and_back_bit_by_bit(
    filled: str, library: str, tmp_path: Path
) -> None:
    before = (tmp_path / "gantry.db").read_bytes()
    assert push(library, filled) == Synced(0, 0, 3)
    assert (tmp_path / "gantry.db").read_bytes() == before
    back = tmp_path / "back.db"
    assert pull(filled, str(back), "gantry") == Synced(3, 0, 0)
    assert pull(filled, str(back), "gantry") == Synced(0, 0, 3)
    assert Library(back).list() == Library(library).list()
    exact = ("digest", "fingerprint", "program", "law_parameters", "created_utc", "input", "tool_m")
    for one, other in zip(content(back), content(library), strict=True):
        assert {name: one[name] for name in exact} == {name: other[name] for name in exact}
    with pytest.raises(BadInputError, match="cell = press: no run of it"):
        pull(filled, str(tmp_path / "none.db"), "press")
    assert not (tmp_path / "none.db").exists()


def test_a_later_decision_of_the_law_is_renewed(filled: str, library: str) -> None:
    with sqlite3.connect(library) as file:
        file.execute("UPDATE iteration SET rolled_back = 1, remark = 'it grew' WHERE id = 2")
    file.close()
    assert push(library, filled) == Synced(0, 1, 2)
    assert push(library, filled) == Synced(0, 0, 3)
    with FleetLibrary(filled) as fleet:
        (run,) = fleet.select(remark="it grew")
        assert (run["index"], run["rolled_back"]) == (1, True)


def test_a_damaged_run_is_left_out_and_named(
    ilc: Callable[..., object], address: str, library: str
) -> None:
    with sqlite3.connect(library) as file:
        file.execute("UPDATE signals SET input = encoder_m WHERE id = 2")
    file.close()
    done = ilc("library", "sync", f"sqlite:///{library}", address)
    assert done.returncode == 2
    assert "2 runs stored, 0 renewed, 0 were there" in done.stdout
    assert "do not match their digest: 2" in done.stderr
    with FleetLibrary(address) as fleet:
        assert [run["index"] for run in fleet] == [0, 2]


def test_another_run_of_the_same_number_is_never_replaced(
    filled: str, library: str, tmp_path: Path
) -> None:
    rows = template(library)
    mine = tmp_path / "mine.db"
    make_cell(mine, [row | {"cell": "gantry"} for row in rows], 1)
    with sqlite3.connect(mine) as file:
        file.execute("UPDATE iteration SET campaign = ?", [rows[0]["campaign"]])
    file.close()
    before = content(mine)
    with pytest.raises(BadInputError, match="another run of the same number"):
        pull(filled, str(mine), "gantry")
    assert content(mine) == before


def test_a_fleet_is_read_like_a_library(filled: str, library: str, tmp_path: Path) -> None:
    make_cell(tmp_path / "press.db", template(library), 7)
    push(str(tmp_path / "press.db"), filled)
    own = ReadOnlyLibrary(library)
    with FleetLibrary(filled) as fleet:
        assert len(fleet) == 6
        assert fleet.cells() == ["cell-007", "gantry"]
        assert [campaign["runs"] for campaign in fleet.campaigns()] == [3, 3]
        (campaign,) = fleet.campaigns("gantry")
        best = min(run["tracking_rms_m"] for run in own)
        assert (campaign["with_signals"], campaign["best_tracking_rms_m"]) == (3, best)
        listed = fleet.list("gantry")
        for run, mine in zip(listed, own.list(), strict=True):
            assert run == mine | {"id": run["id"], "has_signals": True}
            assert list(run)[:-1] == list(mine)
        assert fleet.page("gantry", limit=1, offset=1) == listed[1:2]
        assert fleet.page(campaign="c-007", limit=9) == fleet.list("cell-007")
        assert [run["cell"] for run in fleet.select(disturbance=(20.5, 21.5))] == ["cell-007"] * 3
        assert len(fleet.to_dataframe(cell="gantry")) == 3
        loaded, mine = fleet.load(listed[2]["id"]), own.load(3)
        assert set(loaded) == set(mine) | {"has_signals"}
        for name in ("reference_m", "input", "encoder_m", "tool_m", "error_m", "contour_m"):
            np.testing.assert_array_equal(loaded[name], mine[name])
        assert loaded["program"] == mine["program"]
        with pytest.raises(BadInputError, match="id = 99: no such run"):
            fleet.load(99)
        with pytest.raises(BadInputError, match="temperature: a run has"):
            fleet.select(temperature=3.0)


def test_a_dashboard_has_the_right_to_read_alone(postgres: Server, filled: str) -> None:
    import psycopg

    with connect(filled) as owner:
        owner.execute("CREATE ROLE reader LOGIN")
        owner.execute("GRANT USAGE ON SCHEMA public TO reader")
        owner.execute("GRANT SELECT ON ALL TABLES IN SCHEMA public TO reader")
    as_reader = filled.replace("//ilc@", "//reader@")
    with FleetLibrary(as_reader) as fleet:
        assert len(fleet) == 3
    with psycopg.connect(as_reader) as reader:
        (n_runs,) = reader.execute("SELECT count(*) FROM run_summary WHERE has_signals").fetchone()
        assert n_runs == 3
        with pytest.raises(psycopg.errors.InsufficientPrivilege):
            reader.execute("DELETE FROM run")
    with (
        connect(filled, read_only=True) as own,
        pytest.raises(psycopg.errors.ReadOnlySqlTransaction),
    ):
        own.execute("DELETE FROM run")


def test_what_is_no_fleet_is_refused_in_a_line(
    ilc: Callable[..., object], address: str, library: str
) -> None:
    for words, part in (
        (["sync", library, "other.db"], "one is a library file, the other a database"),
        (["sync", address, library], "--cell NAME"),
        (["sync", "sqlite:///none.db", address], "none.db: no such library"),
        (
            ["sync", library, "postgresql://ilc:secret@/none?host=/nowhere"],
            "postgresql://ilc@/none",
        ),
    ):
        refused = ilc("library", *words)
        assert (refused.returncode, len(refused.stderr.splitlines())) == (2, 1), words
        assert part in refused.stderr
        assert "secret" not in refused.stderr
    with pytest.raises(BadInputError, match="no tables of a fleet; version 1 is needed"):
        FleetLibrary(address)
    with connect(address) as newer:
        newer.execute("INSERT INTO fleet_version (version) VALUES (99)")
    for refused in (lambda: FleetLibrary(address), lambda: push(library, address)):
        with pytest.raises(BadInputError, match=f"version 99; version {newest()} is needed"):
            refused()


def test_programs_that_begin_together_make_the_tables_once(postgres: Server) -> None:
    """Each has seen an empty database before it waited for the others."""
    n_programs = 4
    for _ in range(5):
        address = postgres.database()
        together = Barrier(n_programs)

        def begin(_: int, address: str = address, together: Barrier = together) -> int:
            together.wait(60)
            with connect(address) as connection:
                return version(connection)

        with ThreadPoolExecutor(n_programs) as pool:
            assert list(pool.map(begin, range(n_programs))) == [newest()] * n_programs


def test_without_psycopg_the_extra_is_named(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(BadInputError, match=r"pip install ilc-rt\[fleet\]"):
        push(library, "postgresql://ilc@fleet.local/ilc")


def test_a_cell_starts_from_what_another_learned(
    ilc: Callable[..., object], filled: str, gantry: Path, tmp_path: Path, library: str
) -> None:
    cell = renamed(gantry, tmp_path)
    got = ilc("library", "fetch", filled, "--cell", cell, "--into", "two.db")
    assert got.returncode == 0, got.stderr
    assert "3 of 3 runs of gantry stored as campaign" in got.stdout
    again = fetch(filled, cell, str(tmp_path / "two.db"))
    assert (again.stored, again.runs) == (0, 3)
    assert sorted(path.name for path in tmp_path.glob("*.toml")) == ["gantry-2.toml"]
    run = ("run", cell, "--bus", "loopback:", "--library", "two.db")
    assert ilc(*run, "--resume", "--iterations", 4).returncode == 0
    runs = Library(tmp_path / "two.db").list()
    assert [(run["cell"], run["index"]) for run in runs] == [("gantry-2", k) for k in range(4)]
    assert runs[3]["tracking_rms_m"] < runs[0]["tracking_rms_m"] / 5
    assert ilc(*run, "--frozen", "--iterations", 1).returncode == 0
    # What it learned goes to the database under its own name; a fetched one is not fetched on.
    assert push(str(tmp_path / "two.db"), filled).stored == 5
    with pytest.raises(BadInputError, match="no campaign of gantry-2 fits"):
        fetch(filled, gantry, library, from_cell="gantry-2")


@pytest.mark.parametrize("disturbances", [0, 1, 2])
def test_a_fresh_campaign_recalls_what_was_fetched(
    address: str, gantry: Path, tmp_path: Path, disturbances: int
) -> None:
    """A law that weighs runs begins with those of the other cell."""
    example = gantry.with_name("07_warm_and_cold.toml").read_text(encoding="utf-8")
    example = example.replace("disturbances = 1", f"disturbances = {disturbances}")
    if disturbances == 0:
        example = example.replace("disturbance = [0.5]", "")
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text(example, encoding="utf-8")
    second.write_text(example.replace('"warm-and-cold"', '"second"', 1), encoding="utf-8")
    measured = np.full((5, disturbances), 293.15) if disturbances else None
    told = {}
    for cell, library in ((first, "first.db"), (second, "second.db"), (second, "alone.db")):
        if library == "second.db":
            push(str(tmp_path / "first.db"), address)
            got = fetch(address, second, str(tmp_path / library))
            assert (got.from_cell, got.stored) == ("warm-and-cold", 5)
        n_runs = 5 if cell == first else 2
        campaign = Campaign(cell, library=tmp_path / library, disturbance=measured)
        told[library] = [record.tracking_rms_m for record in campaign.run(n_runs)]
    taught, alone, learned = told["second.db"], told["alone.db"], told["first.db"]
    assert alone == learned[:2], "nothing is known: the first run has no input"
    # As good as the fifth run of the other cell, from the first on.
    assert max(taught) < 1.1 * learned[4] < 0.9 * alone[1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("cycle_us = 2000", "cycle_us = 4000"), "cycle_s is 0.002 there and 0.004 here"),
        (('name = "x"', 'name = "z"'), r'axis_names\[0\] is "x" there and "z" here'),
        (
            ("feed_m_s = 0.1", "feed_m_s = 0.05"),
            r"program\.segments\[0\]\.feed_m_s is 0\.1 there and 0\.05 here",
        ),
        (
            ('law = "norm_optimal"', 'law = "none"'),
            'law is "norm_optimal" there and "none" here',
        ),
        (("damping = 1.0", "damping = 0.9"), "fingerprint is .* limits, models"),
    ],
)
def test_a_campaign_that_does_not_fit_is_refused_with_the_difference(
    filled: str, gantry: Path, tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    cell = renamed(gantry, tmp_path, change)
    with pytest.raises(BadInputError, match=f"campaign .* of gantry: {words}"):
        fetch(filled, cell, str(tmp_path / "two.db"))
    assert not (tmp_path / "two.db").exists()


def test_other_drives_are_accepted_on_demand(filled: str, gantry: Path, tmp_path: Path) -> None:
    cell = renamed(gantry, tmp_path, ("damping = 1.0", "damping = 0.9"))
    got = fetch(filled, cell, str(tmp_path / "two.db"), other_drives=True)
    assert (got.from_cell, got.stored) == ("gantry", 3)
    (row, *_) = content(tmp_path / "two.db")
    assert json.loads(row["axis_names"]) == ["x", "y"]
