"""Run the comparisons and write docs/benchmarks.md, with the figures of the Rust benches."""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn

import border
import bounded
import coupled
import moves
import prediction
import update
from processor import processor

ROOT = Path(__file__).resolve().parent.parent
BORDER = (1300, 30_000, 100_000)
PEERS = ("numpy", "scipy", "osqp", "clarabel", "piqp", "ruckig")


def main() -> None:
    """Measure, and write the report."""
    # Checked first: the comparisons take minutes.
    in_rust = criterion(criterion_folder())
    lines = [
        "# Benchmarks",
        "",
        "Written by `make bench`; every ratio compares two figures of the same run.",
        f"Machine: {processor()}, {os.cpu_count()} cores; Python {platform.python_version()}, "
        + ", ".join(f"{name} {metadata.version(name)}" for name in PEERS)
        + f"; {command('rustc', '--version')}.",
        "",
        "## One update of norm-optimal learning, from Python",
        "",
        "A second-order axis of 157 rad/s at 1 ms, `r = 0.01`. Factors are kept from run to run",
        "where a solver can keep them; results agree with ours (dense and SuperLU to 1e-8).",
        "",
    ]
    lengths = (400, 1300, 4000)
    lines += table({n: progress(f"N = {n}", update.compare, n) for n in lengths})
    lines += ["", "Two coupled axes, and two with contour weights along a circle:", ""]
    lines += table({n: progress(f"coupled, N = {n}", coupled.coupled, n) for n in (1300, 4000)})
    lines += [""]
    lines += table(
        {n: progress(f"contour, N = {n}", coupled.along_a_circle, n) for n in (1300, 4000)}
    )
    lines += [
        "",
        "## The way from Python and back",
        "",
        "The same update beside copies of its three arrays, below which none can fall.",
        "",
    ]
    lines += table({n: progress(f"border, N = {n}", border.compare, n) for n in BORDER})
    lines += [
        "",
        "## Prediction of convergence, from Python",
        "",
        "The factor by which the error of one axis falls in a run, `r = 0.1`; equal to 1e-8.",
        "",
    ]
    lines += table({n: progress(f"predicted, N = {n}", prediction.compare, n) for n in (400, 1300)})
    lines += ["", "Three axes; `ilc-rt` is `analyze` with `r = 0.1`.", ""]
    lines += table({4000: progress("three axes, N = 4000", prediction.three_axes, 4000)})
    lines += [
        "",
        "## One update within bounds, from Python",
        "",
        "The same axis with bounds on the input and on its change from sample to sample, both",
        "binding; solved from scratch, ours to a gap of 1e-9.",
        "",
    ]
    lines += table({1300: progress("bounded, N = 1300", bounded.compare, 1300)})
    lines += [
        "",
        "## Plans of jerk-limited moves, from Python",
        "",
        "`MovePlan` from motion to rest, and programs of many moves, none longer than by Ruckig.",
        "",
    ]
    axes = {n: progress(f"moves, {n} axes", moves.compare, n) for n in (1, 2, 6)}
    lines += table(axes, "axes")
    million = json.loads(command(sys.executable, str(ROOT / "benchmarks" / "million.py")))
    lines += [
        "",
        "## A million samples",
        "",
        f"One update takes {1e3 * million['seconds']:.1f} ms and {million['mb']:.0f} MB over input "
        "and error, the copies at the border to Python and the next input included.",
        "",
        *many_plants(),
        *past_runs(),
        *lock_step(),
        "## In Rust",
        "",
        "Medians of `cargo bench`.",
        "",
        "| bench | median |",
        "|---|--:|",
    ]
    lines += [f"| {name} | {readable(seconds)} |" for name, seconds in in_rust]
    (ROOT / "docs" / "benchmarks.md").write_text("\n".join(lines) + "\n")
    print("wrote docs/benchmarks.md")


def progress(what: str, compare: object, n_samples: int) -> dict[str, float]:
    """Print the name of a measurement, and run it."""
    print(f"{what} ...", flush=True)
    return compare(n_samples)


def table(columns: dict[int, dict[str, float]], counted: str = "N") -> list[str]:
    """Return a row for each solver, with its time absolute and relative to ours."""
    names = list(next(iter(columns.values()), {}))
    if not names or any("ilc-rt" not in seconds for seconds in columns.values()):
        sizes = ", ".join(f"{counted} = {n}" for n in columns)
        fail(f"a table of {sizes or 'nothing'} has no figures")
    head = "| solver |" + "".join(f" {counted} = {n} | times ours |" for n in columns)
    rows = [head, "|---|" + "--:|--:|" * len(columns)]
    for name in names:
        cells = "".join(
            f" {readable(seconds[name])} | {seconds[name] / seconds['ilc-rt']:.0f} |"
            if seconds[name] / seconds["ilc-rt"] >= 10
            else f" {readable(seconds[name])} | {seconds[name] / seconds['ilc-rt']:.1f} |"
            for seconds in columns.values()
        )
        rows.append(f"| {name} |{cells}")
    return rows


def many_plants() -> list[str]:
    """Return the section on thousands of plants."""
    print("many plants ...", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "rows.json")
        command(sys.executable, str(ROOT / "benchmarks" / "many_plants.py"), "--json", str(file))
        rows = json.loads(file.read_text())
    return many_plants_section(rows)


def many_plants_section(rows: list[dict[str, Any]]) -> list[str]:
    """Return the section from the rows of `many_plants.py`: one and two threads come first."""
    each_s = [row["seconds"] / row["plants"] for row in rows]
    ratio = rows[0]["seconds"] / rows[1]["seconds"]
    return [
        "## Thousands of plants",
        "",
        "20 runs of 1300 samples with noise on each of many plants that differ from the model",
        "(second order), norm-optimal; every way gives the same figures bit by bit. Two threads "
        f"are worth {ratio:.2f} of one.",
        "",
        "| way | plants | time | per plant | times ours |",
        "|---|--:|--:|--:|--:|",
        *(
            f"| {row['way']} | {row['plants']} | {readable(row['seconds'])} | {readable(each)} "
            f"| {each / each_s[1]:.3g} |"
            for row, each in zip(rows, each_s, strict=True)
        ),
        "",
    ]


def past_runs() -> list[str]:
    """Return the section on the library of past runs."""
    print("library ...", flush=True)
    text = command(sys.executable, str(ROOT / "benchmarks" / "library.py"))
    return [
        "## The library of past runs",
        "",
        "Simulated runs of one axis under two disturbances; NumPy has all disturbances in memory,",
        "and all inputs and errors in one file of its own.",
        "",
        *text.splitlines(),
        "",
    ]


def lock_step() -> list[str]:
    """Return the section on campaigns in lock-step."""
    print("lock-step ...", flush=True)
    return lock_step_section(command("cargo", "bench", "--workspace", "--bench", "main_job"))


def lock_step_section(text: str) -> list[str]:
    """Return the section from what the bench of the main job prints."""
    campaigns = re.findall(r"(\d+) axes, (\d+) runs in ([^,]+), (\d+) times faster", text)
    if not campaigns:
        fail("the bench of the main job has no figures of campaigns in lock-step")
    return [
        "## Campaigns in lock-step",
        "",
        "The example gantry, its pair of axes repeated, with simulated drives in one process; each",
        "run is kept on disk.",
        "",
        "| axes | runs | time | times faster than real time |",
        "|--:|--:|--:|--:|",
        *(f"| {axes} | {runs} | {took} | {times} |" for axes, runs, took, times in campaigns),
        "",
    ]


def criterion_folder() -> Path:
    """Return the folder of the Rust benches' figures."""
    if home := os.environ.get("CRITERION_HOME"):
        return Path(home)
    described = json.loads(command("cargo", "metadata", "--no-deps", "--format-version", "1"))
    return Path(described["target_directory"]) / "criterion"


def criterion(folder: Path) -> list[tuple[str, float]]:
    """Return the medians of the Rust benches by name; fail if no bench has run."""
    found = []
    for about in folder.glob("**/new/benchmark.json"):
        estimates = json.loads((about.parent / "estimates.json").read_text())
        name = json.loads(about.read_text())["full_id"]
        found.append((name, estimates["median"]["point_estimate"] * 1e-9))
    if not found:
        fail(f"no figures of the Rust benches in {folder}; `make bench` runs them before this")
    return sorted(found)


def fail(reason: str) -> NoReturn:
    """Exit with one line; the report stays unchanged."""
    sys.exit(f"benchmarks/report.py: {reason}")


def readable(seconds: float) -> str:
    """Return a duration with a unit in which it has one to three digits."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def command(*words: str) -> str:
    """Return the output of a command."""
    done = subprocess.run(words, check=True, capture_output=True, text=True, cwd=ROOT)
    return done.stdout.strip()


if __name__ == "__main__":
    main()
