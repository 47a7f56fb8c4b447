"""Refusals of the verbs that hear controllers: one line, exit code 2, whichever verb it is."""

from __future__ import annotations

import socket
import sqlite3
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from ports_fixture import free_port

from ilc_rt import BadInputError
from ilc_rt.addresses import reached
from ilc_rt.cli import main
from ilc_rt.monitor import checked_name

pytest.importorskip("zenoh")

if TYPE_CHECKING:
    from pathlib import Path

HEARING = (
    ["monitor"], ["dashboard", "--port", "0"], ["bridge", "plotjuggler"],
    ["bridge", "foxglove", "--port", "0"],
)  # fmt: skip
#: At once at an end if nothing is refused.
BRIEF = ["--no-scouting", "--timeout", "0"]


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Return the only line that a verb says when it refuses something."""
    assert main([*arguments]) == 2, arguments
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert "unexpected" not in line
    return line


def heard(*arguments: str) -> str:
    """Return the notes of a verb that ends well, in a process of its own: it may be a server."""
    argv = [sys.executable, "-m", "ilc_rt.cli", *arguments, *BRIEF]
    done = subprocess.run(argv, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.mark.parametrize("verb", HEARING, ids=" ".join)
@pytest.mark.parametrize("name", ["my cell", "gan*", "**", "a$*", "größe", "a{b}", "a" * 65, ""])
def test_a_name_that_no_cell_can_have_is_refused(
    verb: list[str], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, *verb, name, *BRIEF)
    assert "1 to 64 letters, digits, - and _" in said


def test_every_name_of_several_cells_is_looked_at(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("nicegui", reason="nicegui is not installed")
    assert "'a b'" in refused(capsys, "dashboard", "gantry", "a b", "--port", "0", *BRIEF)


def test_names_of_cells_are_those_of_descriptions() -> None:
    for name in ("*", "gantry", "Press-7_b", "a" * 64):
        assert checked_name(name) == name
    with pytest.raises(BadInputError, match=r"cell = 'a\\\\nb'"):
        checked_name("a\nb")


@pytest.mark.parametrize(
    "verb", [*HEARING, ["library", "collect", "postgresql:///x"]], ids=" ".join
)
@pytest.mark.parametrize("seconds", ["-1", "nan", "inf"])
def test_a_time_that_cannot_pass_is_refused(
    verb: list[str], seconds: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, *verb, "--no-scouting", "--timeout", seconds)
    assert f"--timeout {seconds}: seconds from 0" in said


def test_a_monitor_sees_one_run_at_least(capsys: pytest.CaptureFixture[str]) -> None:
    assert "greater than or equal to 1" in refused(capsys, "monitor", "-n", "0", *BRIEF)


@pytest.mark.parametrize("verb", HEARING, ids=" ".join)
def test_what_is_no_library_is_refused_and_a_missing_one_told(
    verb: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A campaign may make it later; a name may also be mistyped."""
    if verb[0] == "dashboard":
        pytest.importorskip("nicegui", reason="nicegui is not installed")
    foreign = tmp_path / "foreign.db"
    with sqlite3.connect(foreign) as other:
        other.execute("CREATE TABLE things (name TEXT)")
    other.close()
    (tmp_path / "garbage.db").write_bytes(b"hello world" * 1000)
    for name, told in (("foreign.db", "another program"), ("garbage.db", "not a database"),
                       ("", "a folder")):  # fmt: skip
        assert told in refused(capsys, *verb, *BRIEF, "--library", str(tmp_path / name))
    (tmp_path / "empty.db").touch()
    assert "no such library" not in heard(*verb, "--library", str(tmp_path / "empty.db"))
    assert f"{tmp_path / 'none.db'}: no such library yet" in heard(
        *verb, "--library", str(tmp_path / "none.db")
    )
    assert not (tmp_path / "none.db").exists()
    assert (tmp_path / "empty.db").stat().st_size == 0


@pytest.mark.parametrize("verb", [["dashboard"], ["bridge", "foxglove"]], ids=" ".join)
def test_a_port_in_use_is_named(verb: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("nicegui" if verb == ["dashboard"] else "foxglove")
    with socket.socket() as other:
        other.bind(("127.0.0.1", free_port(socket.SOCK_STREAM)))
        other.listen()
        port = str(other.getsockname()[1])
        said = refused(capsys, *verb, "--port", port, *BRIEF)
    assert said == (
        f"ilc: --host 127.0.0.1 --port {port}: Address already in use; "
        "an own address and a free port are needed"
    )


def test_a_bridge_tells_its_own_address_and_who_else_reaches_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("foxglove")
    port = free_port(socket.SOCK_STREAM)
    argv = ["bridge", "foxglove", "--host", "127.0.0.2", "--port", str(port), *BRIEF]
    assert main(argv) == 0
    said = capsys.readouterr().err
    assert f"every cell to ws://127.0.0.2:{port};" in said
    assert "anyone on that network" not in said
    assert main(["bridge", "foxglove", "--host", "0.0.0.0", "--port", "0", *BRIEF]) == 0
    said = capsys.readouterr().err
    assert "anyone on that network can watch; nobody can command" in said
    assert "every cell to ws://127.0.0.1:" in said
    assert reached("fe80::1", 1) == "[fe80::1]:1"


@pytest.mark.parametrize("tool", ["plotjuggler", "foxglove"])
def test_a_layout_that_cannot_be_written_is_refused_before(
    tool: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(tmp_path / "none" / "layout")
    said = refused(capsys, "bridge", tool, "gantry.toml", "--layout", file, *BRIEF)
    assert f"--layout {file}: cannot be written" in said
