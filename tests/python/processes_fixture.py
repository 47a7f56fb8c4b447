"""Drives the programs `ilc-rt` and `ilc-sim` like a person at two terminals.

All output of a program is read as it arrives, and every wait has a deadline that only a hanging
program reaches.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ports_fixture import free_bus

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from types import TracebackType

    from typing_extensions import Self

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "01_gantry.toml"
DEADLINE_S = 60.0

#: Two corners in place of five: a run takes 1.1 s instead of 3.
SHORT_PROGRAM = """\
[[program.segment]]
to_m = [0.08, 0.04]

[[program.segment]]
to_m = [0.06, 0.06]

"""
#: For what a browser shows within a second on an idle machine.
BROWSER_WAIT_MS = 180_000
#: For real-time tests that do not concern punctuality: a busy machine may delay a process.
PATIENT = """
[safety]
silent_cycles_max = 500
overrun_cycles_max = 500
"""


def program(name: str) -> Path:
    """Return a program of the project: beside the interpreter, or in the folder ILC_BIN.

    Raises
    ------
    FileNotFoundError
        If it is in neither place.
    """
    folders = [Path(sys.executable).parent]
    if "ILC_BIN" in os.environ:
        folders.append(Path(os.environ["ILC_BIN"]))
    for folder in folders:
        if os.access(folder / name, os.X_OK):
            return folder / name
    message = f"{name} is not in {' or '.join(map(str, folders))}: run `make build` or set ILC_BIN"
    raise FileNotFoundError(message)


class Process:
    """A running program and its output so far.

    Attributes
    ----------
    said : list of str
        The lines of standard output that were read.
    """

    def __init__(self, argv: Iterable[str | Path], folder: Path, stdout: int | None = None) -> None:
        self.argv = [str(argument) for argument in argv]
        self.said: list[str] = []
        self._errors = folder / f"stderr-{time.monotonic_ns()}"
        with self._errors.open("wb") as errors:
            self._process = subprocess.Popen(
                self.argv,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if stdout is None else stdout,
                stderr=errors,
                text=True,
            )
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self._process.stdout or ():
            self._lines.put(line.rstrip("\n"))
        self._lines.put(None)

    def _next(self, until: float, wanted: str) -> str | None:
        try:
            line = self._lines.get(timeout=max(0.0, until - time.monotonic()))
        except queue.Empty:
            raise AssertionError(self._story(f"did not say {wanted} in time")) from None
        if line is not None:
            self.said.append(line)
        return line

    def _story(self, what: str) -> str:
        return "\n".join([f"{' '.join(self.argv)} {what}", *self.said[-20:], *self.errors])

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def errors(self) -> list[str]:
        """The lines on standard error."""
        return self._errors.read_text().splitlines()

    def line(
        self, is_wanted: Callable[[str], bool], wanted: str, deadline_s: float = DEADLINE_S
    ) -> str:
        """Read until a line equals the wanted one, and return it."""
        until = time.monotonic() + deadline_s
        while (line := self._next(until, wanted)) is not None:
            if is_wanted(line):
                return line
        self._process.wait(DEADLINE_S)
        raise AssertionError(self._story(f"ended without {wanted}"))

    def line_with(self, part: str, deadline_s: float = DEADLINE_S) -> str:
        """Read until a line contains `part`, and return it."""
        return self.line(lambda line: part in line, f'"{part}"', deadline_s)

    def event(self, deadline_s: float = DEADLINE_S, **fields: object) -> dict[str, Any]:
        """Read until an event has all these fields, and return it."""
        line = self.line(lambda line: fields.items() <= json.loads(line).items(), str(fields))
        event: dict[str, Any] = json.loads(line)
        return event

    @property
    def events(self) -> list[dict[str, Any]]:
        """All events that were read."""
        return [json.loads(line) for line in self.said]

    @property
    def is_running(self) -> bool:
        """True until the program has ended."""
        return self._process.poll() is None

    def signal(self, number: int) -> None:
        """Send a signal."""
        self._process.send_signal(number)

    def end(self, deadline_s: float = DEADLINE_S) -> int:
        """Read until the program ends, and return its exit status; it may be silent for so long."""
        # A busy computer makes a campaign long, not its program silent.
        while self._next(time.monotonic() + deadline_s, "good-bye") is not None:
            pass
        return self._process.wait(deadline_s)

    def close(self) -> None:
        """Kill the program if it still runs."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        self._reader.join()
        if self._process.stdout is not None:
            self._process.stdout.close()


class Bench:
    """A folder, a bus of its own, and the programs started on it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.bus = free_bus()
        self.library = folder / "library.db"
        self._processes: list[Process] = []

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End all programs."""
        self.close()

    def close(self) -> None:
        """End all programs; others can be started afterwards."""
        while self._processes:
            self._processes.pop().close()

    def cell(
        self,
        *changes: tuple[str, str],
        short: bool = False,
        more: str = "",
        name: str = "cell.toml",
    ) -> Path:
        """Write the example cell with some text replaced (its first place), and return its path."""
        text = EXAMPLE.read_text()
        if short:
            before, _, rest = text.partition("[[program.segment]]")
            text = before + SHORT_PROGRAM + rest[rest.index("[learning]") :]
        for old, new in changes:
            assert old in text, f"the example has no {old!r} any more"
            text = text.replace(old, new, 1)
        path = self.folder / name
        path.write_text(text + more)
        return path

    def start(self, *argv: str | Path, stdout: int | None = None) -> Process:
        """Start a program of the project; `stdout` is a descriptor to use instead of a pipe."""
        process = Process([program(str(argv[0])), *argv[1:]], self.folder, stdout)
        self._processes.append(process)
        return process

    def drives(self, cell: Path, *arguments: str | Path, bus: str | None = None) -> Process:
        """Start simulated drives and wait until they listen."""
        drives = self.start("ilc-sim", "run", cell, "--bus", bus or self.bus, *arguments)
        drives.line_with("ready:")
        return drives

    def controller(
        self,
        cell: Path,
        *arguments: str | Path,
        runs: int,
        bus: str | None = None,
        stdout: int | None = None,
    ) -> Process:
        """Start the controller with events on standard output, and without Zenoh."""
        return self.start(
            "ilc-rt", "run", cell, "--bus", bus or self.bus, "--iterations", str(runs),
            "--library", self.library, "--events", "--no-telemetry", *arguments,
            stdout=stdout,
        )  # fmt: skip

    def kept(self) -> list[tuple[str, int, str]]:
        """Return campaign, number and digest of every run in the library, oldest first."""
        connection = sqlite3.connect(self.library)
        try:
            query = "SELECT campaign, iteration, digest FROM iteration ORDER BY id"
            return connection.execute(query).fetchall()
        finally:
            connection.close()


def goodbye(drives: Process) -> str:
    """Interrupt simulated drives and return their last line, which states their states."""
    drives.signal(signal.SIGINT)
    last = drives.line_with("stopped after")
    assert drives.end() == 0
    return last
