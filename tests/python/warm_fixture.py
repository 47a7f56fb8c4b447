"""`ilc` by a process that has imported everything and forks for each command.

Importing takes longer than most commands run, and hundreds of tests run one. A command gets its own
process, folder, environment and descriptors, as from a shell; tests of the start itself do without.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import warm_server
from warm_server import ask

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SERVER = str(Path(warm_server.__file__))


class Warm:
    """A server, its own or that of whom it inherits the variable, and the commands that it runs."""

    VARIABLE = "ILC_TEST_WARM"

    def __init__(self) -> None:
        self.socket = os.environ.get(self.VARIABLE, "")
        self._server = None
        if not self.socket:
            self._start()

    def _start(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="warm-")
        self.socket = f"{self._folder.name}/socket"
        self._server = subprocess.Popen(
            [sys.executable, SERVER, "serve", self.socket],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        assert self._server.stdout is not None
        assert self._server.stdout.readline() == b"ready\n"

    def shell_words(self) -> list[str]:
        """Return the words that stand for `ilc` in a line of a shell."""
        return [sys.executable, "-I", "-S", SERVER, self.socket]

    def run(
        self, words: list[str], folder: Path, environment: dict[str, str], timeout_s: float
    ) -> subprocess.CompletedProcess[str]:
        """Run a command, and return its exit code and what it printed."""
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as errors, \
                Path(os.devnull).open() as nothing:  # fmt: skip
            descriptors = [nothing.fileno(), out.fileno(), errors.fileno()]
            code = ask(self.socket, words, str(folder), environment, descriptors, timeout_s)
            out.seek(0)
            errors.seek(0)
            return subprocess.CompletedProcess(["ilc", *words], code, out.read(), errors.read())

    def close(self) -> None:
        """End an own server; commands that still run go on."""
        if self._server is not None:
            self._server.communicate()
            self._folder.cleanup()


@pytest.fixture(scope="session")
def warm() -> Iterator[Warm]:
    """Return a server that runs `ilc` without importing it each time."""
    server = Warm()
    yield server
    server.close()


@pytest.fixture
def ilc(tmp_path: Path, warm: Warm) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return a function that runs `ilc` as a process in an empty folder."""

    def run(*arguments: object, timeout_s: float = 120.0) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "COLUMNS": "120"}
        return warm.run([str(word) for word in arguments], tmp_path, environment, timeout_s)

    return run
