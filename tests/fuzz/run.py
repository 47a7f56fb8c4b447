"""`make fuzz`: new problems for every property test, and mutated inputs for every reader.

Takes about FUZZ_S seconds (60 by default) once everything is built, from the seed FUZZ_SEED (a new
one by default). Prints the seed, and after a failure the steps that make it a case that `make test`
tries first.
"""

from __future__ import annotations

import os
import re
import secrets
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CARGO = ["cargo", "test", "--release", "--workspace"]
#: Shares of the time for readers and for the Python border; property tests have the rest.
READERS_SHARE, BORDER_SHARE = 0.4, 0.2
KEEP = """
What was found becomes a test that is tried first:
  Rust, property test    the line that is now in the file *.regressions beside it: commit it
  Rust, reader           the file found-* in tests/fuzz/corpus: name it after what it shows
  Python, property test  the arguments that were printed, as @example(...) above the test
  Python border          the call that was printed, among those of tests/python/test_border.py
The same problems again: make fuzz FUZZ_SEED={seed}
"""


def property_tests() -> list[str]:
    """Return the names of the Rust tests that draw their problems."""
    names = []
    for folder in ("crates", "sim", "tests"):
        for source in sorted((ROOT / folder).rglob("*.rs")):
            text = source.read_text(encoding="utf-8")
            for block in re.finditer(
                r"^( *)proptest! \{\n(.*?)^\1\}", text, re.DOTALL | re.MULTILINE
            ):
                names += re.findall(r"#\[test\]\s+fn (\w+)", block.group(2))
    return sorted(set(names))


class Hunt:
    """A search with a seed and a time limit."""

    def __init__(self, seconds: float, seed: int) -> None:
        self.seconds = seconds
        self.seed = seed
        self.failed: list[str] = []

    def run(self, what: str, argv: list[str], seed: int, **variables: str) -> None:
        """Run a program; its output is shown if it finds something."""
        environment = {**os.environ, "ILC_FUZZ_SEED": str(seed), **variables}
        done = subprocess.run(
            argv, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            print(done.stdout)
            self.failed.append(f"{what}, seed {seed}")
        for line in re.findall(r"^\w+: \d+ kept, \d+ drawn.*$", done.stdout, re.MULTILINE):
            print(f"  {line}")

    def readers(self) -> None:
        """Run every reader on mutated inputs, as many at a time as there are processors."""
        listed = subprocess.run(
            [*CARGO, "--test", "fuzz", "--", "--list"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        )  # fmt: skip
        n_readers = len(re.findall(r": test$", listed.stdout, re.MULTILINE))
        n_rounds = -(-n_readers // (os.cpu_count() or 1))
        each_s = READERS_SHARE * self.seconds / max(1, n_rounds)
        print(f"{n_readers} readers, {each_s:.1f} s each", flush=True)
        self.run("reader", [*CARGO, "--test", "fuzz", "--", "--nocapture"], self.seed,
                 ILC_FUZZ_S=f"{each_s:.3f}")  # fmt: skip

    def border(self) -> None:
        """Call the whole public Python interface with unexpected arguments."""
        script = ROOT / "tests" / "fuzz" / "border.py"
        seconds = BORDER_SHARE * self.seconds
        print(f"the border to Python, {seconds:.1f} s", flush=True)
        self.run("border", [sys.executable, str(script), "--seconds", f"{seconds:.3f}",
                            "--seed", str(self.seed)], self.seed)  # fmt: skip

    def property_tests(self, until: float) -> None:
        """Draw new problems for every property test, repeatedly."""
        names = property_tests()
        seed = self.seed
        rounds, before = 0, len(self.failed)
        while time.monotonic() < until and len(self.failed) == before:
            self.run(
                "property tests in Rust",
                [*CARGO, "--lib", "--tests", "--quiet", "--", *names],
                seed,
            )
            self.run("property tests in Python",
                     [sys.executable, "-m", "pytest", "-q", "-m", "hypothesis",
                      f"--hypothesis-seed={seed}"], seed)  # fmt: skip
            seed += 1
            rounds += 1
        print(
            f"{len(names)} property tests in Rust and those in Python, {rounds} rounds", flush=True
        )


def main() -> int:
    """Run the search and report."""
    seconds = float(os.environ.get("FUZZ_S") or 60)
    seed = int(os.environ.get("FUZZ_SEED") or secrets.randbelow(2**32))
    print(f"seed {seed}, {seconds:g} s; building", flush=True)
    subprocess.run([*CARGO, "--lib", "--tests", "--no-run", "--quiet"], cwd=ROOT, check=True)
    began = time.monotonic()
    hunt = Hunt(seconds, seed)
    hunt.readers()
    hunt.border()
    hunt.property_tests(began + seconds)
    print(f"{time.monotonic() - began:.0f} s")
    if hunt.failed:
        print("FOUND by", "; ".join(hunt.failed), KEEP.format(seed=seed))
        return 1
    print(f"nothing found with seed {seed}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
