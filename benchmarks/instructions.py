"""Count the instructions of a tick of the servo loop by callgrind, beside the stored figures.

Times vary with the computer and its load; instructions do not. The figures are kept in
instructions.json, with the compiler that they belong to; more than 3 % above them fails.
`--write` stores new ones.

Example: .venv/bin/python benchmarks/instructions.py
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STORED = ROOT / "benchmarks" / "instructions.json"
AXES = (1, 2, 6)
#: Ticks of the two runs whose difference is taken: both end in the first run of the program.
TICKS = (2000, 10_000)
GROWTH_ALLOWED = 0.03


def command(*argv: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command; fail with its last words."""
    done = subprocess.run(argv, cwd=ROOT, text=True, capture_output=True, check=False)
    if done.returncode:
        sys.exit(f"benchmarks/instructions.py: {argv[0]}: {done.stderr.strip() or done.returncode}")
    return done


def built() -> Path:
    """Build the ticks, and return the program."""
    command("cargo", "build", "--release", "--workspace", "--example", "ticks")
    described = json.loads(
        command("cargo", "metadata", "--no-deps", "--format-version", "1").stdout
    )
    return Path(described["target_directory"]) / "release" / "examples" / "ticks"


def instructions(program: Path, n_axes: int, n_ticks: int) -> int:
    """Return the instructions of a whole run."""
    with tempfile.TemporaryDirectory() as folder:
        tool = ("valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out")
        told = command(*tool, program, str(n_axes), str(n_ticks)).stderr
    found = re.search(r"Collected : (\d+)", told)
    if found is None:
        sys.exit(f"benchmarks/instructions.py: valgrind counts nothing: {told}")
    return int(found[1])


def main() -> int:
    """Count, print, and compare or store; return 1 if a figure has grown."""
    if shutil.which("valgrind") is None:
        sys.exit("benchmarks/instructions.py: valgrind is not installed (Debian: valgrind)")
    program = built()
    counted = {}
    for n_axes in AXES:
        few, many = (instructions(program, n_axes, n) for n in TICKS)
        counted[str(n_axes)] = round((many - few) / (TICKS[1] - TICKS[0]))
    compiler = command("rustc", "--version").stdout.strip()
    if "--write" in sys.argv:
        figures = {"compiler": compiler, "instructions_per_tick": counted}
        STORED.write_text(json.dumps(figures, indent=2) + "\n")
    stored = json.loads(STORED.read_text())
    print(f"instructions of a tick in csp; stored for {stored['compiler']}, now {compiler}")
    grown = False
    for n_axes, count in counted.items():
        before = stored["instructions_per_tick"][n_axes]
        grown |= count > (1.0 + GROWTH_ALLOWED) * before
        print(f"{n_axes} axes: {count}, stored {before} ({100.0 * (count / before - 1.0):+.1f} %)")
    return int(grown)


if __name__ == "__main__":
    sys.exit(main())
