"""A PostgreSQL server of one test process, on a Unix socket in a temporary folder.

Any test of the fleet may import it; it is skipped where the server of Debian is not installed.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

USER = "ilc"
#: Loss of power is no part of these tests; a kill of a client is.
FAST = ("fsync=off", "synchronous_commit=off", "full_page_writes=off", "max_connections=60")
_names = itertools.count(1)


def programs() -> Path | None:
    """Return the folder of initdb and postgres, the newest of several."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    return found[-1].parent if found else None


class Server:
    """A running server; `database` makes a new database and returns its address."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def address(self, name: str, user: str = USER) -> str:
        """Return the address of a database."""
        return f"postgresql://{user}@/{name}?host={self.folder}"

    def database(self) -> str:
        """Return the address of a new, empty database."""
        psycopg = pytest.importorskip("psycopg")
        name = f"fleet{next(_names)}"
        with psycopg.connect(self.address("postgres"), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}")
        return self.address(name)


@contextlib.contextmanager
def server() -> Iterator[Server]:
    """Start a server, and end it; skip the test where PostgreSQL is not installed."""
    pytest.importorskip("psycopg", reason="psycopg, the extra fleet, is not installed")
    bin_folder = programs()
    if bin_folder is None:
        pytest.skip("PostgreSQL (Debian package postgresql) is not installed")
    # The name of a socket is limited to about 100 characters: not in pytest's folder.
    folder = Path(tempfile.mkdtemp(prefix="ilc-pg-"))
    prefix = _unprivileged(folder)
    data = folder / "data"
    try:
        subprocess.run(
            [*prefix, bin_folder / "initdb", "-D", data, "-U", USER, "-A", "trust", "-E", "UTF8",
             "--no-sync", "--locale=C"],
            check=True, capture_output=True, cwd=folder, timeout=60,
        )  # fmt: skip
        options = [word for option in FAST for word in ("-c", option)]
        with (folder / "log").open("wb") as log:
            process = subprocess.Popen(
                [*prefix, bin_folder / "postgres", "-D", data, "-k", folder, "-h", "", *options],
                cwd=folder, stdout=log, stderr=log,
            )  # fmt: skip
        try:
            _await(process, folder)
            yield Server(folder)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _unprivileged(folder: Path) -> list[str]:
    """Return the command that drops the rights of root, which the server refuses."""
    if os.geteuid() != 0:
        return []
    tool = shutil.which("setpriv")
    if tool is None:
        pytest.skip("setpriv is needed: the server refuses to run as root")
    known = {entry.pw_name for entry in pwd.getpwall()}
    user = "postgres" if "postgres" in known else "nobody"
    shutil.chown(folder, user)
    group = str(pwd.getpwnam(user).pw_gid)
    return [tool, f"--reuid={user}", f"--regid={group}", "--clear-groups"]


def _await(process: subprocess.Popen[bytes], folder: Path) -> None:
    import psycopg

    until = time.monotonic() + 60
    is_ready = False
    while not is_ready:
        if process.poll() is not None or time.monotonic() > until:
            pytest.fail((folder / "log").read_text())
        with contextlib.suppress(psycopg.OperationalError):
            psycopg.connect(f"postgresql://{USER}@/postgres?host={folder}").close()
            is_ready = True
        time.sleep(0.05)
