"""Find, start, read and end the programs `ilc-rt` and `ilc-sim`.

Both run in a session of their own: Ctrl-C in a terminal must reach the
controller alone, which stops the axes while the drives still answer. They end
with the process that started them, also if it is killed: their standard input
closes then.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ilc_rt.closing import Closing
from ilc_rt.errors import EXIT_BAD_INPUT, EXIT_FAILURE, CampaignError

if TYPE_CHECKING:
    from collections.abc import Sequence


READY_DEADLINE_S = 60.0
END_DEADLINE_S = 5.0


def find_program(name: str) -> Path:
    """Find one of the two programs.

    Searched where the wheel installs it, which depends on the kind of installation: beside the
    running interpreter (a virtual environment's ``bin``), in the scripts folder of this
    installation or user, under ``pip install --target``; then on ``PATH``.
    """
    folders = [
        str(Path(sys.executable).parent),
        sysconfig.get_path("scripts"),
        sysconfig.get_path("scripts", sysconfig.get_preferred_scheme("user")),
        str(Path(__file__).resolve().parents[1] / "bin"),
    ]
    for path in (os.pathsep.join(folders), None):
        found = shutil.which(name, path=path)
        if found is not None:
            return Path(found)
    message = (
        f"the program {name} is neither beside {sys.executable} nor on the PATH: "
        "install the wheel of ilc-rt, or run `make build` in a checkout"
    )
    raise CampaignError(message)


class Program(Closing):
    """A running program whose lines are read as they arrive.

    Notes
    -----
    Standard error goes to its own file, so that verbose output never blocks; its last line is the
    reason in `failure`.
    """

    def __init__(self, argv: Sequence[str | Path]) -> None:
        self.name = Path(argv[0]).name
        self.lines: list[str] = []
        self.at_end = False
        self._partial = b""
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed by close)
        try:
            self._process = subprocess.Popen(
                [str(argument) for argument in argv],
                # Open for the lifetime of this process: programs started with it end with it.
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                start_new_session=True,
            )
        except OSError as error:
            self._errors.close()
            message = f"cannot start {argv[0]}: {error.strerror}"
            raise CampaignError(message) from error

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Exit code; None while it runs, negative if a signal ended it."""
        return self._process.poll()

    def fileno(self) -> int:
        """Return the descriptor of the pipe to wait on."""
        assert self._process.stdout is not None
        return self._process.stdout.fileno()

    def receive(self) -> None:
        """Move the content of the pipe to `lines`; call it when readable."""
        chunk = os.read(self.fileno(), 65536)
        self.at_end = not chunk
        *whole, self._partial = (self._partial + chunk).split(b"\n")
        if self.at_end and self._partial:
            whole.append(self._partial)
            self._partial = b""
        self.lines.extend(line.decode("utf-8", "replace") for line in whole)

    def wait_for_line(self, start: str, deadline_s: float) -> str:
        """Read until a line begins with `start` and return it.

        A program that ends first, or passes the deadline, is an error.
        """
        until = time.monotonic() + deadline_s
        with selectors.DefaultSelector() as selector:
            selector.register(self, selectors.EVENT_READ)
            while True:
                while self.lines:
                    line = self.lines.pop(0)
                    if line.startswith(start):
                        return line
                if self.at_end:
                    raise self.failure()
                if not selector.select(max(0.0, until - time.monotonic())):
                    message = f'{self.name} did not say "{start}" within {deadline_s:g} s'
                    raise CampaignError(message)
                self.receive()

    def signal(self, number: int) -> None:
        """Send a signal, if it is still running."""
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(number)

    def failure(self) -> CampaignError:
        """Return the error with the reason of its end: its own last line."""
        code = self._wait(END_DEADLINE_S)
        reason = self.last_error_line()
        if not reason and code is not None and code < 0:
            reason = f"{self.name} was ended by {signal.Signals(-code).name}"
        elif not reason:
            reason = f"{self.name} ended with exit code {code} and no word"
        return CampaignError(reason, code if code is not None and code > 0 else EXIT_FAILURE)

    def last_error_line(self) -> str:
        """Return the last line on its standard error, or ``""``."""
        self._errors.seek(0)
        lines = self._errors.read().decode("utf-8", "replace").split("\n")
        said = [line.strip() for line in lines if line.strip()]
        return said[-1].removeprefix(f"{self.name}: ") if said else ""

    def close(self) -> None:
        """Terminate it if it is still running, then kill it, and reap it."""
        if self.returncode is None:
            self.signal(signal.SIGTERM)
            if self._wait(END_DEADLINE_S) is None:
                self.signal(signal.SIGKILL)
                self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._errors.close()

    def _wait(self, deadline_s: float) -> int | None:
        try:
            return self._process.wait(deadline_s)
        except subprocess.TimeoutExpired:
            return None


def start_simulated_drives(cell_file: str | Path, bus: str | None, *, lockstep: bool) -> Program:
    """Start `ilc-sim` and wait until its drives listen."""
    argv: list[str | Path] = [find_program("ilc-sim"), "run", cell_file, "--with-parent"]
    if bus is not None:
        argv += ["--bus", bus]
    if lockstep:
        argv.append("--lockstep")
    drives = Program(argv)
    try:
        drives.wait_for_line("ready:", READY_DEADLINE_S)
    except CampaignError as error:
        drives.close()
        code = EXIT_BAD_INPUT if error.exit_code == EXIT_BAD_INPUT else EXIT_FAILURE
        message = f"simulated drives did not start: {error.reason}"
        raise CampaignError(message, code) from error
    except BaseException:
        drives.close()
        raise
    return drives
