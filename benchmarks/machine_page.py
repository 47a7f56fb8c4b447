"""Measure how punctual this computer is, and write docs/machines/NAME.md: bad figures, too.

An argument names another folder for the page.
"""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from report import processor

ROOT = Path(__file__).resolve().parent.parent
SECONDS = os.environ.get("RT_SECONDS") or "20"
#: Of each cell whose tick is measured.
TICK_S = str(min(5, int(SECONDS)))
QUANTILES = {"p50": "median", "p99": "99 %", "p999": "99.9 %", "max": "longest"}
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
    """Return the table of wake-ups beside cyclictest."""
    ours, theirs = measured["wake_late_us"], measured["cyclictest_us"]
    lines = [f"{title}: {measured['grade']}.", "", "| us | loop | cyclictest | ratio |",
             "|---|---:|---:|---:|"]  # fmt: skip
    for key, name in QUANTILES.items():
        peer = "not installed" if theirs is None else f"{theirs[key]:.0f}"
        ratio = f"{ours[key] / theirs[key]:.2f}" if theirs and theirs[key] > 0 else ""
        lines.append(f"| {name} | {ours[key]:.1f} | {peer} | {ratio} |")
    return [*lines, ""]


def main() -> None:
    """Measure, and write the page."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "machines"
    examined = figures("doctor")
    wake = figures("latency", "--seconds", SECONDS, "--load")
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
        f"{wake['rt']['priority']}, busy-waiting {wake['rt']['spin_us']:.0f} us.",
        "",
        "## Wake-ups at 1 kHz",
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
