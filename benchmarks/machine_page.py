"""Measure how punctual this computer is, and write docs/machines/NAME.md: bad figures, too.

An argument names another folder for the page.
"""

from __future__ import annotations

import json
import os
import platform
import re
import socket
import statistics
import subprocess
import sys
import tempfile
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from processor import processor

ROOT = Path(__file__).resolve().parent.parent
SECONDS = os.environ.get("RT_SECONDS") or "20"
#: Of each cell whose tick is measured.
TICK_S = str(min(5, int(SECONDS)))
#: Campaigns on UDP with telemetry, each with one without, and their runs.
PAIRS = 3 if int(SECONDS) >= 10 else 1
RUNS = str(PAIRS + 1)
QUANTILES = {"p50": "median", "p99": "99 %", "p999": "99.9 %", "max": "longest"}
#: Stages of a tick.
STAGES = {
    "wake_late_us": "wake-up, late by",
    "receive_us": "receive: system calls and decoding",
    "control_us": "control: the loop's own",
    "send_us": "send: system calls and encoding",
    "execution_us": "the whole tick",
}
#: Cells whose tick is measured, with their cycles; None is one axis.
TICKS = (
    (None, 50, "one axis, 20 kHz"),
    ("examples/01_gantry.toml", 1000, "two axes, csp"),
    ("examples/09_delta.toml", 1000, "three axes, csp"),
)


def figures(*arguments: str) -> dict[str, Any]:
    """Return the figures of a verb of `ilc-rt`."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "figures.json"
        program = Path(sys.executable).parent / "ilc-rt"
        # `doctor` fails where it finds something: that is a finding.
        subprocess.run([program, *arguments, "--json", file], check=False, stdout=sys.stderr)
        found: dict[str, Any] = json.loads(file.read_text())
        return found


def lateness(measured: dict[str, Any], title: str) -> list[str]:
    """Return the table of wake-ups beside cyclictest, and a loop that hardly sleeps."""
    ours, theirs = measured["wake_late_us"], measured["cyclictest_us"]
    least = measured["sleepless_us"]
    lines = [f"{title}: {measured['grade']}.", "",
             "| us | loop | cyclictest | ratio | without sleep |",
             "|---|---:|---:|---:|---:|"]  # fmt: skip
    for key, name in QUANTILES.items():
        peer = "not installed" if theirs is None else f"{theirs[key]:.0f}"
        ratio = f"{ours[key] / theirs[key]:.2f}" if theirs and theirs[key] > 0 else ""
        lines.append(f"| {name} | {ours[key]:.1f} | {peer} | {ratio} | {least[key]:.1f} |")
    return [*lines, ""]


def campaign(*options: str) -> dict[str, Any]:
    """Return the timing of a campaign of the gantry, whose drives are a process on UDP."""
    folder = Path(sys.executable).parent
    cell = str(ROOT / "examples" / "01_gantry.toml")
    with tempfile.TemporaryDirectory() as scratch, socket.socket(type=socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        bus = ["--bus", f"udp:239.74.163.9:{free.getsockname()[1]}"]
        free.close()
        drives = subprocess.Popen([folder / "ilc-sim", "run", cell, *bus], stdout=subprocess.PIPE)
        try:
            assert drives.stdout is not None
            drives.stdout.readline()
            runs = [
                "--simulated-drives",
                "-n",
                RUNS,
                "--library",
                f"{scratch}/library.db",
                "--events",
            ]
            argv = [folder / "ilc-rt", "run", cell, *bus, *runs, *options]
            said = subprocess.run(argv, check=True, stdout=subprocess.PIPE).stdout.splitlines()
        finally:
            drives.terminate()
            drives.communicate()
    events = [json.loads(line) for line in said]
    found: dict[str, Any] = next(event for event in events if event["event"] == "latency")
    return found


def on_udp() -> list[str]:
    """Return the stages of a tick on UDP, and the 99 % with telemetry beside those without."""
    pairs = [(campaign(), campaign("--no-telemetry")) for _ in range(PAIRS)]
    lines = ["| stage | median (us) | 99 % | 99 % without telemetry | ratio |",
             "|---|---:|---:|---:|---:|"]  # fmt: skip
    for key, name in STAGES.items():
        median = statistics.median(told[key]["p50"] for told, _ in pairs)
        told, silent = (statistics.median(pair[k][key]["p99"] for pair in pairs) for k in (0, 1))
        ratio = f"{told / silent:.2f}" if silent > 0 else ""
        lines.append(f"| {name} | {median:.1f} | {told:.1f} | {silent:.1f} | {ratio} |")
    return lines


def main() -> None:
    """Measure, and write the page."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "machines"
    examined = figures("doctor")
    # The last processor: the system prefers the first.
    own = str((os.cpu_count() or 1) - 1)
    wake = figures("latency", "--seconds", SECONDS, "--load", "--cpu", own)
    lines = [
        # A page of its own: the site lists no machines.
        "---",
        "orphan: true",
        "---",
        "",
        f"# {platform.node()}",
        "",
        f"Written by `make rt-page` on {datetime.now(timezone.utc):%Y-%m-%d}. {processor()}, "
        f"{os.cpu_count()} processors, kernel {wake['rt']['kernel']}; {wake['rt']['policy']} "
        f"{wake['rt']['priority']} on processor {own}, "
        f"busy-waiting {wake['rt']['spin_us']:.0f} us.",
        "",
        "## Wake-ups at 1 kHz",
        "",
        "Three programs in turns. Without sleep: the loop busy-waits for 90 % of each cycle, which",
        "shows how late the kernel, the firmware or a host of this computer makes any program.",
        "",
        *lateness(wake, "Idle"),
        *lateness(wake["loaded"], "Every processor, memory and disk busy"),
        "## Ticks",
        "",
        "Axes in memory; receive, control and send together.",
        "",
        "| cell | cycle (us) | median (us) | 99 % | 99.9 % | longest | wake-ups |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for cell, cycle_us, title in TICKS:
        where = [str(ROOT / cell)] if cell else []
        measured = figures("latency", *where, "--cycle-us", str(cycle_us), "--seconds", TICK_S)
        tick = measured["execution_us"]
        values = " | ".join(f"{tick[key]:.1f}" for key in QUANTILES)
        lines.append(f"| {title} | {cycle_us} | {values} | {tick['count']} |")
    lines += [
        "",
        "## A tick on UDP",
        "",
        f"The gantry at 500 Hz, its drives in another process here; medians of {PAIRS} campaigns",
        "with telemetry and as many without, in turns.",
        "",
        *on_udp(),
    ]
    lines += ["", "## Findings of `ilc-rt doctor`", "", "| what | verdict | found | remedy |",
              "|---|---|---|---|"]  # fmt: skip
    for one in examined["findings"]:
        words = [one["what"], one["verdict"], one["found"], one["mend"] or ""]
        lines.append("| " + " | ".join(word.replace("|", "\\|") for word in words) + " |")
    page = folder / (re.sub(r"[^a-z0-9]+", "-", platform.node().lower()) + ".md")
    folder.mkdir(exist_ok=True)
    page.write_text("\n".join(lines) + "\n")
    sys.stderr.write(f"{page} written\n")


if __name__ == "__main__":
    main()
