"""Run `ilc demo` repeatedly on a busy computer, and tally the outcomes.

Kinds of disturbance:

load
    Three processes write 400 MB files with fsync in a loop, one calls sync in a loop.
stalls
    The controller, the drives or both are stopped for 20 to 300 ms at random moments.
kills
    The controller, the drives or `ilc` itself are killed at random moments; the next start must
    find every reported run, and continue.

Example: .venv/bin/python tests/soak/demo.py load --times 40
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
from children_fixture import children

if TYPE_CHECKING:
    from collections.abc import Iterator

BIN = Path(sys.executable).parent
N_WRITERS = 3
FILE_BYTES = 400 << 20
CHUNK = bytes(4 << 20)
DEADLINE_S = 600.0


def write_for_ever(path: str) -> None:
    """Write a large file with fsync, repeatedly."""
    while True:
        with open(path, "wb") as file:  # noqa: PTH123 (no time for niceties)
            for _ in range(FILE_BYTES // len(CHUNK)):
                file.write(CHUNK)
            file.flush()
            os.fsync(file.fileno())


def sync_for_ever() -> None:
    """Call sync, repeatedly."""
    while True:
        os.sync()
        time.sleep(0.05)


@contextlib.contextmanager
def disk_load(folder: Path) -> Iterator[None]:
    """Keep the disk busy."""
    pids = []
    for number in range(N_WRITERS + 1):
        pid = os.fork()
        if pid == 0:
            if number < N_WRITERS:
                write_for_ever(str(folder / f"load-{number}"))
            sync_for_ever()
        pids.append(pid)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)


def start_demo(folder: Path, *more: str) -> subprocess.Popen[bytes]:
    """Start the demo in its own folder."""
    report = ["--report", str(folder / "report.html"), "--json", str(folder / "figures.json")]
    argv = [str(BIN / "ilc"), "demo", "--library", str(folder / "library.db"), *report, *more]
    with (folder / "said").open("ab") as said:
        return subprocess.Popen(argv, cwd=folder, stdout=said, stderr=said)


def stall_at_random(demo: subprocess.Popen[bytes], draw: random.Random) -> None:
    """Stop and continue its programs until it ends."""
    while demo.poll() is None:
        time.sleep(draw.uniform(0.3, 2.0))
        with contextlib.suppress(OSError):
            programs = children(demo.pid)
            who = draw.choice([["ilc-rt"], ["ilc-sim"], ["ilc-rt", "ilc-sim"]])
            pids = [programs[name] for name in who if name in programs]
            for pid in pids:
                os.kill(pid, signal.SIGSTOP)
            time.sleep(draw.uniform(0.02, 0.3))
            for pid in pids:
                os.kill(pid, signal.SIGCONT)


def kill_at_random(demo: subprocess.Popen[bytes], draw: random.Random) -> str:
    """Kill one of the three programs once; return its name."""
    time.sleep(draw.uniform(1.0, 12.0))
    who = draw.choice(["ilc", "ilc-rt", "ilc-sim"])
    with contextlib.suppress(OSError):
        pid = demo.pid if who == "ilc" else children(demo.pid).get(who, 0)
        if pid:
            os.kill(pid, signal.SIGKILL)
    return who


def kept(folder: Path) -> list[int]:
    """Return the run numbers of the newest campaign; check the file's integrity."""
    if not (folder / "library.db").exists():
        return []
    connection = sqlite3.connect(folder / "library.db")
    try:
        (verdict,) = connection.execute("PRAGMA integrity_check").fetchone()
        assert verdict == "ok", verdict
        query = (
            "SELECT iteration FROM iteration WHERE campaign = "
            "(SELECT campaign FROM iteration ORDER BY id DESC LIMIT 1) ORDER BY id"
        )
        return [index for (index,) in connection.execute(query)]
    finally:
        connection.close()


def one(trouble: str, folder: Path, draw: random.Random) -> str:
    """Run the demo once; return the outcome in a few words."""
    demo = start_demo(folder)
    try:
        if trouble == "stalls":
            stall_at_random(demo, draw)
        if trouble == "kills":
            who = kill_at_random(demo, draw)
            demo.wait(DEADLINE_S)
            before = kept(folder)
            demo = start_demo(folder)
            if demo.wait(DEADLINE_S):
                return f"no clean start after {who} was killed"
            return "lost a run" if before != list(range(len(before))) else "completed"
        status = demo.wait(DEADLINE_S)
    finally:
        if demo.poll() is None:
            demo.kill()
            demo.wait()
    if status:
        return f"exit {status}: {(folder / 'said').read_text().splitlines()[-1]}"
    runs = json.loads((folder / "figures.json").read_text())["iterations"]
    if len(runs) != 10:
        return f"{len(runs)} of 10 runs"
    said = (folder / "said").read_text()
    return "completed after going on" if "going on after" in said else "completed"


def main() -> int:
    """Run the requested demos; return 0 if all were completed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("trouble", choices=["load", "stalls", "kills"])
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    # A request to end must also end the child processes.
    signal.signal(signal.SIGTERM, lambda number, _frame: sys.exit(128 + number))
    draw = random.Random(arguments.seed)
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name, contextlib.ExitStack() as stack:
        if arguments.trouble == "load":
            stack.enter_context(disk_load(Path(name)))
        for number in range(arguments.times):
            folder = Path(name) / str(number)
            folder.mkdir()
            began = time.monotonic()
            came = one(arguments.trouble, folder, draw)
            tally[came] += 1
            last = (folder / "said").read_text().splitlines()
            sentence = next((line for line in last if " within " in line), "")
            took_s = time.monotonic() - began
            print(f"{number + 1:3}  {took_s:5.1f} s  {came}  {sentence}", flush=True)
    print()
    for came, count in tally.most_common():
        print(f"{count:3} of {arguments.times}  {came}")
    completed = sum(count for came, count in tally.items() if came.startswith("completed"))
    return 0 if completed == arguments.times else 1


if __name__ == "__main__":
    sys.exit(main())
