"""Runs every command and block that a document or a help text gives.

Runs are shortened, the bus of a real machine is replaced by one of this host, and the folder holds
the files that a reader would have by then. The action of a line is unchanged.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from documentation_fixture import (
    DOCUMENTS,
    LANGUAGES,
    PROGRAMS,
    ROOT,
    Block,
    Command,
    blocks,
    commands_of_blocks,
    commands_of_help,
    help_of,
    launcher,
    outside_of_blocks,
    verbs_of,
)
from ports_fixture import free_bus, free_port
from postgres_fixture import server
from processes_fixture import Process, program

if TYPE_CHECKING:
    from collections.abc import Iterator

    from postgres_fixture import Server
    from warm_fixture import Warm

    from ilc_rt import CampaignResult

pytestmark = pytest.mark.timeout(300)

COMMANDS = list({one.text: one for one in [*commands_of_blocks(), *commands_of_help()]}.values())
PYTHON = [
    block for document in DOCUMENTS for block in blocks(document) if block.language == "python"
]
NETWORK_CELL = "examples/01_gantry.toml"

#: Each option and its replacement: as short as its purpose allows.
SHORTER = (
    (r"^ilc (run|demo)(?!.* --iterations)(.*)$", r"ilc \1\2 --iterations 2"),
    (r"--iterations \d+", "--iterations 2"),
    # The library has three runs by then.
    (r"--iterations 2(.*) --resume|--resume(.*) --iterations 2", r"--resume\1\2 --iterations 5"),
    (r"^ilc (run|demo|identify|repeatability)(?!.* --bus)(.*)$", r"ilc \1\2 --bus loopback:"),
    (r"^ilc repeatability(.*) --runs \d+", r"ilc repeatability\1 --runs 2"),
    # Each paper is computed, on reduced sizes, by the tests beside it.
    (r"^ilc reproduce all(.*)$", r"ilc reproduce haas2016\1"),
    (r"^ilc reproduce(?!.* --from)(.*)$", r"ilc reproduce\1 --reduced"),
    (r"^ilc-rt latency(?!.* --seconds)(.*)$", r"ilc-rt latency\1 --seconds 1"),
    (r"--seconds \d+", "--seconds 1"),
    # Long enough for a cell to be missed.
    (r"^ilc bridge (plotjuggler|foxglove)(.*)$", r"ilc bridge \1\2 --timeout 0.2 --no-scouting"),
    (r"^ilc bridge foxglove(.*)$", r"ilc bridge foxglove\1 --port 0"),
    (
        r"^ilc dashboard(.*?)(?: --port \d+)?$",
        r"ilc dashboard\1 --timeout 0.2 --no-scouting --port 0",
    ),
    (r"--samples \d+", "--samples 2"),
    (r"^ilc sweep(?!.* --iterations)(.*)$", r"ilc sweep\1 --iterations 2"),
    (r"^ilc library collect( \S+).*$", r"ilc library collect\1 --timeout 0.2 --no-scouting"),
    (r"^(ilc library (?:show|export) \S+) \d+", r"\1 1"),
    # These run this very test, or its prerequisites.
    (r"^make ([a-z-]+)", r"make --dry-run --directory {root} \1"),
    (r"/var/lib/ilc/|/etc/bash_completion.d/|~/.zfunc/", "./"),
)


def shorter(text: str) -> str:
    """Return the line to run in place of the documented one."""
    for pattern, replacement in SHORTER:
        text = re.sub(pattern, replacement, text)
    return text.replace("{root}", str(ROOT))


@pytest.fixture
def folder(tmp_path: Path, finished: CampaignResult) -> Path:
    """Return a folder with a reader's files: the examples, a cell, a library of a few runs."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    gantry = (ROOT / NETWORK_CELL).read_text(encoding="utf-8")
    # A cell that learns in this process, unless a line names a bus.
    (tmp_path / "gantry.toml").write_text(
        re.sub(r'^address = "udp:[^"]*"', 'address = "loopback:"', gantry, flags=re.MULTILINE),
        encoding="utf-8",
    )
    for name in ("ilc-library.db", "gantry.db"):
        (tmp_path / name).write_bytes(Path(finished.library).read_bytes())
    sheet = run(f"ilc-sim eds {NETWORK_CELL} --node 1", tmp_path)
    for name in ("servo.eds", "servo.dcf"):
        (tmp_path / name).write_text(sheet, encoding="utf-8")
    figures = ROOT / "docs" / "gallery" / "figures.json"
    (tmp_path / "figures.json").write_bytes(figures.read_bytes())
    return tmp_path


@pytest.fixture(autouse=True)
def path(
    tmp_path_factory: pytest.TempPathFactory, warm: Warm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Put the programs on the path, as they are on a reader's."""
    folder = tmp_path_factory.mktemp("bin")
    for name, words in (("ilc", warm.shell_words()), ("python", [sys.executable])):
        (folder / name).write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n')
        (folder / name).chmod(0o755)
    folders = [str(folder), str(program("ilc-rt").parent), os.environ["PATH"]]
    monkeypatch.setenv("PATH", ":".join(folders))


def run(text: str, folder: Path) -> str:
    """Run a line in a shell, and return its output; it must succeed."""
    done = subprocess.run(
        ["bash", "-c", text], cwd=folder, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@cache
def ask_make(target: str) -> None:
    """Let `make` say what it would do for a target; it must know it."""
    run(shorter(f"make {target}"), ROOT)


def with_drives(text: str, folder: Path) -> None:
    """Run a line of `ilc-rt` with simulated drives of this host on its bus."""
    address = free_bus()
    text, found = re.subn(r"--bus \S+", f"--bus {address}", text)
    if not found:
        text = f"{text} --bus {address}"
    if " run " in text and "--iterations" not in text:
        text = f"{text} --iterations {5 if '--resume' in text else 2}"
    cell = ROOT / NETWORK_CELL
    drives = Process([program("ilc-sim"), "run", cell, "--bus", address, "--lockstep"], folder)
    try:
        drives.line_with("ready")
        run(f"{text} --lockstep", folder)
    finally:
        drives.close()


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run in real time: library, late cycles and recording."""
    folder = tmp_path_factory.mktemp("made")
    address = free_bus()
    cell = ROOT / NETWORK_CELL
    drives = Process([program("ilc-sim"), "run", cell, "--bus", address], folder)
    argv = [
        program("ilc-rt"), "run", cell, "--bus", address, "--library", folder / "made.db",
        "--iterations", "1", "--simulated-drives", "--no-telemetry", "--record",
        folder / "gantry.mcap",
    ]  # fmt: skip
    try:
        drives.line_with("ready")
        controller = Process(argv, folder)
        assert controller.end() == 0, controller.errors
        controller.close()
    finally:
        drives.close()
    return folder


def after_a_run(text: str, folder: Path, made: Path) -> None:
    """Run a line about the last run in real time, or about its recording, after such a run."""
    library = next((word for word in text.split() if word.endswith(".db")), "ilc-library.db")
    for path in [*made.glob("made.*"), made / "gantry.mcap"]:
        name = path.name.replace("made", Path(library).stem)
        (folder / name).write_bytes(path.read_bytes())
    assert re.search("cycles|frames", run(text, folder))


def with_drives_by_hand(text: str, folder: Path) -> None:
    """Run a line of commissioning with simulated drives of this host on its bus."""
    address = free_bus()
    text, is_bus = re.subn(r"can:\S+", address, text)
    if not is_bus:
        text = f"{text} --bus {address}"
    if re.search(r"ilc-rt (enable|jog|goto|home) ", text):
        text = f"{text} --simulated-drives"
    cell = ROOT / NETWORK_CELL
    if "ilc-rt home " in text:
        cell = homed_by_drive(folder)
    drives = Process([program("ilc-sim"), "run", cell, "--bus", address], folder)
    try:
        drives.line_with("ready")
        run(text, folder)
    finally:
        drives.close()


def homed_by_drive(folder: Path) -> Path:
    """Let the drive of x search its home, and return the cell."""
    cell = folder / "gantry.toml"
    homing = '[axis.homing]\nkind = "drive"\nmethod = 33\nspeed_zero_m_s = 0.01\noffset_m = 0.04\n'
    text = cell.read_text(encoding="utf-8")
    cell.write_text(text.replace("[axis.model]", f"{homing}\n[axis.model]", 1), encoding="utf-8")
    return cell


def with_hands(text: str, folder: Path) -> None:
    """Switch an input of simulated drives of this host."""
    address = free_bus()
    cell = ROOT / "examples" / "08_inputs.toml"
    (folder / "gantry.toml").write_text(cell.read_text(encoding="utf-8"), encoding="utf-8")
    drives = Process([program("ilc-sim"), "run", cell, "--bus", address], folder)
    try:
        drives.line_with("ready")
        run(f"{text} --bus {address}", folder)
    finally:
        drives.close()


def drives_alone(text: str, folder: Path) -> None:
    """Run the simulated drives, and end them with Ctrl-C."""
    text = re.sub(r"--bus \S+", "", text) + f" --bus {free_bus()}"
    drives = Process([program("ilc-sim"), *shlex.split(text)[1:]], folder)
    try:
        drives.line_with("ready")
        drives.signal(signal.SIGINT)
        assert drives.end() == 0, drives.errors
    finally:
        drives.close()


def watched(text: str, folder: Path) -> None:
    """Run a line that monitors a cell, and a campaign to monitor."""
    endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    name, *rest = shlex.split(text)
    if name == "python":
        argv = [sys.executable, rest[0], "2", endpoint]
    else:
        if "--connect" in rest:
            del rest[rest.index("--connect") : rest.index("--connect") + 2]
        argv = [
            *launcher("ilc"),
            *rest,
            "--connect",
            endpoint,
            "--no-scouting",
            "--iterations",
            "2",
        ]
    cell = folder / "watched.toml"
    listen = f'[telemetry]\nlisten = ["{endpoint}"]\nscouting = false\n'
    cell.write_text(f"{(folder / 'gantry.toml').read_text(encoding='utf-8')}\n{listen}", "utf-8")
    watcher = Process(argv, folder)
    try:
        # Runs are made until the monitor, which needs a moment to connect, has seen two.
        bus = free_bus()
        argv = [
            *launcher("ilc"),
            "run",
            str(cell),
            "--bus",
            bus,
            "--lockstep",
            "--iterations",
            "500",
        ]
        campaign = Process(argv, folder)
        try:
            assert watcher.end() == 0, watcher.errors
        finally:
            campaign.signal(signal.SIGINT)
            campaign.end()
            campaign.close()
    finally:
        watcher.close()
    assert any(re.search(r"\d", line) for line in watcher.said)


@pytest.fixture(scope="session")
def postgres() -> Iterator[Server]:
    with server() as running:
        yield running


def with_database(text: str, folder: Path, postgres: Server) -> None:
    """Run a line of the fleet with a database that has a campaign, and a second cell."""
    address = postgres.database()
    run(f"ilc library sync ilc-library.db '{address}'", folder)
    cell = (folder / "gantry.toml").read_text(encoding="utf-8")
    second = cell.replace('name = "gantry"', 'name = "gantry-2"', 1)
    (folder / "gantry-2.toml").write_text(second, encoding="utf-8")
    said = run(re.sub(r"postgresql://\S+", lambda _: f"'{address}'", text), folder)
    wanted = r"dashboard: http" if "dashboard" in text else r"\d( of \d+)? runs? .*stored"
    assert re.search(wanted, said)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda one: f"{one.where}: {one.text}")
def test_a_line_that_one_is_told_to_type_works(
    command: Command, folder: Path, request: pytest.FixtureRequest
) -> None:
    """As documented, or shortened."""
    text = shorter(command.text)
    if "postgresql://" in text:
        with_database(text, folder, request.getfixturevalue("postgres"))
    elif re.match(r"ilc monitor|python examples/02_monitor", text):
        watched(text, folder)
    elif text.startswith("ilc-sim input"):
        with_hands(text, folder)
    elif text.startswith("ilc-sim run"):
        drives_alone(text, folder)
    elif re.match(r"ilc-rt (why|replay|record) ", text):
        after_a_run(text, folder, request.getfixturevalue("made"))
    elif re.match(r"ilc-rt (run|identify)", text):
        with_drives(text, folder)
    elif re.match(r"(yes \| )?ilc-rt (scan|sdo|status|reset|enable|home|jog|goto|disable) ", text):
        with_drives_by_hand(text, folder)
    else:
        run(text, folder)


@pytest.mark.parametrize(
    "document", sorted({block.document for block in PYTHON}), ids=lambda path: path.name
)
def test_the_python_of_a_document_runs(
    document: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All blocks of a document run in order, in one namespace."""
    monkeypatch.chdir(folder)
    known: dict[str, object] = {"__name__": "__main__"}
    for block in blocks(document):
        if block.language == "python" and not block.excuse:
            # Blank lines before the block keep the document's line numbers in a traceback.
            source = "\n" * (block.line - 1) + block.text
            exec(compile(source, str(document), "exec"), known)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_block_says_what_it_is(document: Path) -> None:
    """A fence names a language, and indented blocks contain no commands."""
    for block in blocks(document):
        assert block.language in LANGUAGES, (
            f"{document}:{block.line - 1}: ``` and one of {LANGUAGES}"
        )
    for number, line in outside_of_blocks(document):
        hidden = re.match(rf"(?: {{4,}}|\t)({'|'.join(PROGRAMS)}) ", line)
        assert hidden is None, f"{document}:{number}: a command belongs in a ```sh block"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_verbs_and_options_in_running_text_exist(document: Path) -> None:
    """`ilc verb --option` in running text names an existing option."""
    for number, line in outside_of_blocks(document):
        for code in re.findall(r"`((?:ilc|ilc-rt|ilc-sim) [^`]+)`", line):
            name, *rest = code.split()
            verb = [word for word in rest if re.fullmatch(r"[a-z][a-z-]*", word)][:2]
            said = help_of(name, *verb[: 2 if verb in verbs_of(name) else 1])
            for option in (word.split("=")[0] for word in rest if word.startswith("--")):
                assert re.search(rf"{option}\b", said), f"{document}:{number}: {code}"
        for target in re.findall(r"`make ([a-z-]+)`", line):
            ask_make(target)


def test_there_is_something_to_run() -> None:
    """The collector finds known lines."""
    texts = [command.text for command in COMMANDS]
    assert "make demo" in texts
    assert "ilc demo" in texts
    assert "ilc-rt check gantry.toml" in texts
    assert "ilc-sim run examples/01_gantry.toml --mute 1@5" in texts
    assert len(texts) > 35
    assert [block.document.name for block in PYTHON if not block.excuse].count("README.md") >= 2
    assert all(isinstance(block, Block) for block in PYTHON)
