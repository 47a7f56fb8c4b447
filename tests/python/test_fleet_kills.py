"""A hundred cells into one database by processes that are killed: nothing is lost or doubled."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from fleet_fixture import content, make_cell, template
from postgres_fixture import server

from ilc_rt import ReadOnlyLibrary, library_file
from ilc_rt.fleet import FleetLibrary, pull, push
from ilc_rt.fleet.database import connect

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from ilc_rt import CampaignResult

pytestmark = pytest.mark.xdist_group("postgres")

N_CELLS = 100
N_PROCESSES = 3
N_KILLS = 6

#: Pushes libraries; kills itself before the given statement, if that is not 0.
PUSHER = """
import os, signal, sys
import psycopg
from ilc_rt.fleet import push

address, kill_at, *libraries = sys.argv[1:]
left = int(kill_at)
execute = psycopg.Cursor.execute

def counted(self, *arguments, **keywords):
    global left
    left -= 1
    if left == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return execute(self, *arguments, **keywords)

psycopg.Cursor.execute = counted
for library in libraries:
    push(library, address)
"""

#: Brings the runs of a cell back; kills itself before the second run of a transaction is stored.
PULLER = """
import os, signal, sys
from ilc_rt import library_file
from ilc_rt.fleet import pull

insert = library_file.insert

def counted(rows):
    for number, row in enumerate(rows):
        if number == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        yield row

# The rows are read inside the transaction.
library_file.insert = lambda library, rows: insert(library, counted(rows))
pull(*sys.argv[1:])
"""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with server() as running:
        yield running.database()


@pytest.fixture(scope="module")
def libraries(finished: CampaignResult, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("cells")
    rows = template(finished.library)
    paths = [folder / f"{number:03}.db" for number in range(N_CELLS)]
    for number, path in enumerate(paths):
        make_cell(path, rows[: 1 + number % 3], number)
    return paths


def start(script: str, *arguments: object) -> subprocess.Popen[bytes]:
    """Start a process of Python."""
    return subprocess.Popen([sys.executable, "-c", script, *map(str, arguments)])


def rows_of(address: str) -> list[Any]:
    """Return every run of the database with its arrays, in the order of cell and number."""
    query = f"""
    SELECT cell, campaign, iteration, run.digest, created_utc, fingerprint, law, program,
        law_parameters, disturbance::text, figures::text, {", ".join(library_file.ARRAYS)}
    FROM run JOIN signals ON signals.run = run.id
        JOIN provenance ON provenance.digest = run.provenance ORDER BY cell, iteration
    """
    with connect(address, read_only=True) as connection:
        return connection.execute(query.encode()).fetchall()


def test_a_hundred_cells_by_processes_that_are_killed(
    address: str, libraries: Sequence[Path]
) -> None:
    draw = random.Random(7)
    # Many libraries are pushed by several of the processes, each in an order of its own.
    shares = [draw.sample(list(libraries), N_CELLS // 2) for _ in range(N_PROCESSES)]
    missing = set(libraries) - {path for share in shares for path in share}
    shares[0] += sorted(missing)
    # All begin at an empty database: the tables are made by one of them.
    kills = [[draw.randrange(4, 150) for _ in range(N_KILLS // N_PROCESSES)] for _ in shares]
    n_killed = 0
    running = {number: start(PUSHER, address, kills[number].pop(), *shares[number])
               for number in range(N_PROCESSES)}  # fmt: skip
    try:
        while running:
            for number, process in list(running.items()):
                code = process.wait(100)
                if code == 0:
                    del running[number]
                    continue
                assert code == -signal.SIGKILL
                n_killed += 1
                kill_at = kills[number].pop() if kills[number] else 0
                running[number] = start(PUSHER, address, kill_at, *shares[number])
    finally:
        for process in running.values():
            process.kill()
            process.wait()
    assert n_killed == N_KILLS

    expected = []
    for path in libraries:
        for row, run in zip(content(path), ReadOnlyLibrary(path).list(), strict=True):
            expected.append((row, run))
    found = rows_of(address)
    assert len(found) == len(expected) == sum(1 + number % 3 for number in range(N_CELLS))
    for (row, _), stored in zip(expected, found, strict=True):
        keys = ("cell", "campaign", "iteration", "digest", "created_utc", "fingerprint", "law",
                "program", "law_parameters", "disturbance")  # fmt: skip
        assert stored[:10] == tuple(row[key] for key in keys)
        assert stored[11:] == tuple(row[name] for name in library_file.ARRAYS)
    with FleetLibrary(address) as fleet:
        assert len(fleet) == len(expected)
        for run, (_, mine) in zip(
            sorted(fleet, key=lambda run: (run["cell"], run["index"])), expected, strict=True
        ):
            assert run == mine | {"id": run["id"], "has_signals": True}
        assert len(fleet.cells()) == N_CELLS
    with connect(address) as connection:
        assert connection.execute("SELECT version FROM fleet_version").fetchall() == [(1,)]
        assert connection.execute("SELECT count(*) FROM provenance").fetchone() == (1,)


def test_a_pull_that_is_killed_stores_all_or_nothing(
    address: str, libraries: Sequence[Path], tmp_path: Path
) -> None:
    back = tmp_path / "back.db"
    name = "cell-002"
    push(str(libraries[2]), address)
    assert start(PULLER, address, back, name).wait(100) == -signal.SIGKILL
    assert ReadOnlyLibrary(back).list() == []
    assert pull(address, str(back), name).stored == 3
    assert ReadOnlyLibrary(back).list() == ReadOnlyLibrary(libraries[2]).list()
