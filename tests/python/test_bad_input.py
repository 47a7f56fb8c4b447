"""User errors: each is refused with one line before anything moves."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from processes_fixture import Bench, goodbye

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

#: The replaced text of the example cell, its replacement, and the names in the refusal: one of each
#: kind; `tests/rust/tests/cells.rs` has them all.
CELLS = {
    "not TOML": ('name = "gantry"', 'name = "gantry', ["cell.toml:5", "[cell]"]),
    "unknown key": ("damping = 1.0", "dampening = 1.0", ["[axis.model]", "dampening", "damping"]),
    "wrong unit in the value": (
        "following_error_max_m = 0.01", "following_error_max_m = 10.0",
        ["limits.following_error_max_m = 10", "allowed 0.0000001 to 1"],
    ),
    "node number twice": ("node = 2\n", "node = 1\n", ["y node = 1", "x node has it already"]),
    "target out of reach": (
        "to_m = [0.08, 0.04]", "to_m = [0.08, 0.4]",
        ["[[program.segment]] 1 to_m = 0.4", "axis y reaches -0.02 to 0.1"],
    ),
    "feed beyond the drive": (
        "feed_m_s = 0.1", "feed_m_s = 3.0",
        ["[program] (axis 1 is x)", "axis 1: acceleration", "limit 8 m/s^2"],
    ),
    "measure without its encoder": (
        '[tcp_encoder]                    # a cross grid under the tool\n'
        'node = 10\ncounts_per_m = 1e8\n', "",
        ['[learning] measure = tcp', '"encoder"'],
    ),
}  # fmt: skip

#: The arguments added to `ilc-rt run cell.toml`, and the names in the refusal.
OPTIONS = {
    "no such file": (["nix.toml"], ["nix.toml", "cannot be read", "No such file"]),
    "a folder for a file": (["."], ["cannot be read", "not a regular file"]),
    "unknown option": (["cell.toml", "--fast"], ["--fast", "--help"]),
    "no runs": (["cell.toml", "--iterations", "0"], ["--iterations", "'0'", "1 to 4294967295"]),
    "no such measure": (["cell.toml", "--measure", "eye"], ["'eye'", "encoder, tcp"]),
    "no bus at all": (
        ["cell.toml", "--bus", "usb:0"], ["--bus", "`usb:0`", "can:INTERFACE", "udp:GROUP"],
    ),
    "not a multicast group": (
        ["cell.toml", "--bus", "udp:10.0.0.1"], ["--bus", "`10.0.0.1`", "224.0.0.0 to 239"],
    ),
    "port 0": (["cell.toml", "--bus", "udp:239.74.163.2:0"], ["port `0`", "1 to 65535"]),
    "a key with a wildcard": (["cell.toml", "--bus", "zenoh:a/*"], ["key `a/*`", "wildcards"]),
    # A kernel without CAN support says that instead.
    "no such interface": (["cell.toml", "--bus", "can:nix0"], ["--bus", "`can:nix0`", "CAN"]),
    "interface name too long": (
        ["cell.toml", "--bus", "can:an-interface-too-long"], ["1 to 15 printable characters"],
    ),
    "drives in another program": (
        ["cell.toml", "--bus", "loopback:"], ["--bus", "loopback:", "can:INTERFACE", "udp:GROUP"],
    ),
    "library in no folder": (
        ["cell.toml", "--library", "nix/library.db"],
        ["library nix/library.db", "folder that exists"],
    ),
    "library that is a folder": (["cell.toml", "--library", "."], ["library .", "allowed: a lib"]),
    "library that is another file": (
        ["cell.toml", "--library", "cell.toml"], ["library cell.toml", "not a database"],
    ),
    "library of a newer program": (
        ["cell.toml", "--library", "newer.db"], ["library newer.db", "version 99", "version 4"],
    ),
    "nothing to resume": (
        ["cell.toml", "--library", "nix.db", "--resume"], ["--resume", "nix.db"],
    ),
    "figures in no folder": (
        ["cell.toml", "--json", "nix/figures.json"], ["--json nix/figures.json", "folder"],
    ),
}  # fmt: skip


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def check_refusal(program: str, status: int, errors: list[str], named: list[str]) -> None:
    assert status == 2, errors
    assert len(errors) == 1, errors
    assert errors[0].startswith(f"{program}: "), errors
    assert [part for part in named if part not in errors[0]] == [], errors
    for noise in ("panicked", "Traceback", "Error {", "Some("):
        assert noise not in errors[0]


@pytest.mark.parametrize("case", CELLS)
def test_a_wrong_cell_is_refused(bench: Bench, case: str) -> None:
    """Refused by `check` and `run` alike, with file, key, value and the allowed values."""
    old, new, named = CELLS[case]
    cell = bench.cell((old, new))
    check = bench.start("ilc-rt", "check", cell)
    check_refusal("ilc-rt", check.end(), check.errors, ["cell.toml", *named])
    assert check.said == []
    run = bench.controller(cell, runs=1)
    assert run.end() == 2
    assert (run.errors, run.said) == (check.errors, [])
    assert not bench.library.exists()


@pytest.mark.parametrize("case", CELLS)
def test_the_simulated_drives_refuse_a_wrong_cell_as_well(bench: Bench, case: str) -> None:
    """Only errors of the machine; the simulator ignores the program and the learning."""
    old, new, named = CELLS[case]
    drives = bench.start("ilc-sim", "run", bench.cell((old, new)), "--bus", "can:nix0")
    status = drives.end()
    if case == "feed beyond the drive":
        named = ["can:nix0"]
    check_refusal("ilc-sim", status, drives.errors, named)


@pytest.mark.parametrize("case", OPTIONS)
def test_wrong_options_are_refused(bench: Bench, case: str) -> None:
    """With the drives listening: none of them receives anything."""
    arguments, named = OPTIONS[case]
    cell = bench.cell(("udp:239.74.163.2", bench.bus))
    library = bench.folder / "newer.db"
    subprocess.run(
        [sys.executable, "-c", f"import sqlite3; c = sqlite3.connect({str(library)!r});"
         "c.execute('PRAGMA user_version = 99'); c.close()"],
        check=True,
    )  # fmt: skip
    drives = bench.drives(cell)
    before = {path for path in bench.folder.iterdir() if not path.name.startswith("stderr")}
    run = bench.start("ilc-rt", "run", *arguments, "--no-telemetry")
    check_refusal("ilc-rt", run.end(), run.errors, named)
    assert run.said == []
    after = {path for path in bench.folder.iterdir() if not path.name.startswith("stderr")}
    assert {path.name for path in after - before} <= {"ilc-library.db"}
    assert " 0 SYNC received" in goodbye(drives)
    assert not any("switched on" in line for line in drives.said)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_library_that_may_not_be_written_is_refused(bench: Bench) -> None:
    """Refused, as the first run would be lost."""
    bench.library.touch(0o400)
    run = bench.controller(bench.cell(), runs=1)
    check_refusal("ilc-rt", run.end(), run.errors, ["library", "allowed"])


def test_no_drives_on_the_bus(bench: Bench) -> None:
    """Refused once the first node's timeout has passed."""
    cell = bench.cell(more="\n[safety]\nanswer_timeout_s = 0.1\n")
    run = bench.controller(cell, runs=1)
    named = ["cell.toml", "x node = 1", bench.bus, "no boot-up within"]
    check_refusal("ilc-rt", run.end(10.0), run.errors, named)
    assert [event["state"] for event in run.events] == ["bringing_up"]


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("node = 2\n", "node = 3\n", ["y node = 2", "no boot-up"]),
        ("node = 10\n", "node = 11\n", ["[tcp_encoder] node = 10", "no boot-up"]),
    ],
)
def test_one_node_missing(bench: Bench, old: str, new: str, named: list[str]) -> None:
    """The node that does not answer is named; the others stay where they are."""
    drives = bench.drives(bench.cell((old, new), name="drives.toml"))
    cell = bench.cell(more="\n[safety]\nanswer_timeout_s = 0.5\n")
    run = bench.controller(cell, runs=1)
    check_refusal("ilc-rt", run.end(), run.errors, ["cell.toml", *named])
    assert " 0 SYNC received" in goodbye(drives)
    assert not any("switched on" in line for line in drives.said)


def test_a_port_that_another_program_has(bench: Bench) -> None:
    """A UDP port in exclusive use by another program."""
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        other.bind(("", 0))
        bus = f"udp:239.74.163.2:{other.getsockname()[1]}"
        run = bench.controller(bench.cell(), runs=1, bus=bus)
        check_refusal("ilc-rt", run.end(), run.errors, ["--bus", bus, "in use"])


def test_latency_refuses_as_well(bench: Bench) -> None:
    """Before it measures, not after."""
    run = bench.start("ilc-rt", "latency", "--seconds", "86400", "--json", "nix/latency.json")
    check_refusal("ilc-rt", run.end(10.0), run.errors, ["--json nix/latency.json"])


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["run", "cell.toml", "--mute", "1"], ["--mute", "'1'", "NODE@SECONDS"]),
        (["run", "cell.toml", "--mute", "3@1"], ["--mute 3", "1, 2, 10"]),
        (["run", "cell.toml", "--bus", "loopback:"], ["loopback:", "--bus"]),
        (["eds", "cell.toml", "--node", "4"], ["--node 4", "1, 2, 10"]),
        (["fly"], ["'fly'", "--help"]),
    ],
)
def test_the_simulated_drives_refuse_wrong_options(
    bench: Bench, arguments: list[str], named: list[str]
) -> None:
    """One line each."""
    bench.cell()
    drives = bench.start("ilc-sim", *arguments)
    check_refusal("ilc-sim", drives.end(), drives.errors, named)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["nix.toml"], ["nix.toml", "cannot be read"]),
        (["cell.toml", "--bus", "usb:0"], ["usb:0", "can:"]),
        (["cell.toml", "--bus", "can:nix0"], ["`can:nix0`"]),
        (["cell.toml", "--library", "nix/library.db"], ["nix/library.db", "folder"]),
        (["cell.toml", "--library", "cell.toml"], ["cell.toml", "not a database"]),
        (["wrong.toml"], ["wrong.toml", "[[program.segment]] 1 to_m = 0.4", "axis y"]),
    ],
)
def test_the_python_program_passes_it_on(
    bench: Bench, arguments: list[str], named: list[str]
) -> None:
    """`ilc run` prints the same line under its own name."""
    bench.cell()
    bench.cell(("to_m = [0.08, 0.04]", "to_m = [0.08, 0.4]"), name="wrong.toml")
    bus = [] if "--bus" in arguments else ["--bus", bench.bus]
    done = subprocess.run(
        [sys.executable, "-m", "ilc_rt.cli", "run", *bus, *arguments],
        cwd=bench.folder,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    check_refusal("ilc", done.returncode, done.stderr.splitlines(), named)
