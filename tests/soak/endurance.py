"""Run a cell by the clock for a long time, and watch what must not grow.

Controller and drives are two processes on a bus of their own, with telemetry. In the first half of
the time one campaign goes on without an end; in the second half the power of a drive is taken again
and again, and the controller started again. It fails if

- a stop has another cause than the drive without power, or a fault is reported more than once;
- a campaign does not go on after a fault;
- memory, open files or threads of a process grow after the first third of its life.

Example: .venv/bin/python tests/soak/endurance.py --seconds 1200
"""

from __future__ import annotations

import argparse
import signal
import statistics
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
from processes_fixture import Bench, Process

#: Growth of the resident memory that is the allocator's: pages, not objects.
SLACK_BYTES = 1 << 20
#: Faults in the second half.
N_FAULTS = 8
PAUSE_S = 0.5
PAGE_BYTES = 4096


@dataclass
class Life:
    """Memory, open files and threads of a process over its life."""

    name: str
    pid: int
    resident_bytes: list[int] = field(default_factory=list)
    files: list[int] = field(default_factory=list)
    threads: list[int] = field(default_factory=list)

    def look(self) -> None:
        """Add the present figures."""
        proc = Path(f"/proc/{self.pid}")
        self.resident_bytes.append(PAGE_BYTES * int((proc / "statm").read_text().split()[1]))
        self.files.append(len(list((proc / "fd").iterdir())))
        self.threads.append(len(list((proc / "task").iterdir())))

    def growth(self) -> list[str]:
        """Return what has grown from the second to the last third."""
        third = len(self.files) // 3
        found = []
        for what, values, slack in (
            ("bytes", self.resident_bytes, SLACK_BYTES),
            ("open files", self.files, 0),
            ("threads", self.threads, 0),
        ):
            before, after = (
                statistics.median(part) for part in (values[third : 2 * third], values[2 * third :])
            )
            if after > before + slack:
                found.append(f"{self.name}: {before:.0f} {what}, later {after:.0f}")
        resident_kb = self.resident_bytes[-1] >> 10
        last = f"{resident_kb} kB, {self.files[-1]} files, {self.threads[-1]} threads"
        print(f"{self.name}: {last}", flush=True)
        return found


def controller(bench: Bench, cell: Path, *more: str) -> Process:
    """Start a campaign without an end, with its events on standard output."""
    return bench.start(
        "ilc-rt", "run", cell, "--bus", bench.bus, "--library", bench.library,
        "--simulated-drives", "--forever", "--keep", "best", "--events", *more,
    )  # fmt: skip


def undisturbed(bench: Bench, cell: Path, seconds: float) -> list[str]:
    """Run for some time, and return what was wrong."""
    drives = bench.drives(cell)
    running = controller(bench, cell)
    running.event(event="state", state="running")
    lives = [Life("ilc-rt", running.pid), Life("ilc-sim", drives.pid)]
    until = time.monotonic() + seconds
    while time.monotonic() < until and running.is_running:
        time.sleep(PAUSE_S)
        if running.is_running:
            for life in lives:
                life.look()
    wrong = [] if running.is_running else ["the campaign ended by itself"]
    running.signal(signal.SIGINT)
    running.end()
    wrong += [f"stopped: {event['reason']}" for event in faults(running)]
    for life in lives:
        wrong += life.growth()
    drives.signal(signal.SIGINT)
    drives.end()
    return wrong


def without_power(bench: Bench, cell: Path, seconds: float, number: int) -> list[str]:
    """Take the power of a drive after some time, and return what was wrong."""
    drives = bench.drives(cell, "--mute", f"{1 + number % 2}@{seconds}")
    running = controller(bench, cell, *(["--resume"] if number else []))
    status = running.end(seconds + 60.0)
    told = faults(running)
    drives.signal(signal.SIGINT)
    drives.end()
    wrong = [] if status == 3 else [f"episode {number}: exit {status}, {running.errors}"]
    if len(told) != 1 or "is silent" not in told[0]["reason"]:
        wrong.append(f"episode {number}: {[event['reason'] for event in told]}")
    n_runs = sum(event["event"] == "iteration" for event in running.events)
    print(
        f"episode {number}: {n_runs} runs, {told[0]['reason'] if told else 'no fault'}", flush=True
    )
    return wrong if n_runs else [*wrong, f"episode {number}: no run"]


def faults(process: Process) -> list[dict[str, str]]:
    """Return the faults that a controller has told."""
    return [event for event in process.events if event["event"] == "fault"]


def main() -> int:
    """Run both halves; return 0 if nothing was wrong."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=1200.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name, Bench(Path(name)) as bench:
        cell = bench.cell(short=True)
        wrong = undisturbed(bench, cell, seconds / 2)
        for number in range(N_FAULTS):
            wrong += without_power(bench, cell, seconds / 2 / N_FAULTS, number)
    print("\n".join(wrong) or "nothing has grown, and every stop had its cause")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
