"""The library of past runs against arrays kept in memory or in NumPy's files.

    python benchmarks/library.py                        # recall among 100,000 and 1,000,000 runs
    python benchmarks/library.py --runs 20000 --short 50000 --json figures.json

The runs are simulated: each has the figures and the arrays of one that was stored before, and a
disturbance of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from million import forget_peak, peak_mb

from ilc_rt import Library, PdIlc, RelevanceIlc, library_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

TOP = 30
N_RECALLS = 200
#: Samples of the runs that a law learns from, and of one whose size is measured.
N_SAMPLES, LONG = 100, 1401


def disturbances(n_runs: int) -> Any:  # noqa: ANN401 (an array)
    """Return a temperature and a load of each run."""
    draw = np.random.default_rng(7)
    return np.column_stack([draw.normal(25.0, 4.0, n_runs), draw.uniform(0.0, 10.0, n_runs)])


def signals(n_samples: int, number: int) -> tuple[Any, Any, Any]:
    """Return input, error and set points of a run of one axis."""
    draw = np.random.default_rng(number)
    reference_m = 0.1 * np.hanning(n_samples)
    return draw.normal(0, 1e-3, n_samples), draw.normal(0, 1e-5, n_samples), reference_m


def fill(path: Path, n_runs: int, n_samples: int) -> Library:
    """Return a library of simulated runs."""
    memory = Library(":memory:")
    for number in range(10):
        u, e, reference_m = signals(n_samples, number)
        memory.append(u, e, 0.001, [20.0, 1.0], reference_m, cell="press", campaign="a")
    templates = library_file.rows(memory, range(1, 11))
    at = disturbances(n_runs)

    def rows(numbers: range) -> Iterator[dict[str, Any]]:
        for number in numbers:
            row = templates[number % 10] | {
                "iteration": number,
                "disturbance": json.dumps(at[number].tolist()),
            }
            yield row | {"digest": library_file.digest(row)}

    library = Library(path)
    for start in range(0, n_runs, 20_000):
        library_file.insert(library, rows(range(start, min(start + 20_000, n_runs))))
    return library


def median_s(work: Callable[[int], object], n: int) -> float:
    """Return the median time of work that gets the number of the attempt."""
    taken = []
    for number in range(n):
        start = time.perf_counter()
        work(number)
        taken.append(time.perf_counter() - start)
    return float(np.median(taken))


def recall(folder: Path, n_runs: int) -> dict[str, float]:
    """Return the times of a recall: from the file, and by NumPy from an array in memory."""
    library = fill(folder / f"recall-{n_runs}.db", n_runs, 2)
    # A library at rest: one that was written to in the last seconds is opened for each recall.
    os.utime(library.path, times=(time.time() - 60.0,) * 2)
    at = disturbances(n_runs)
    asked = disturbances(N_RECALLS + 1)[::-1] + 0.01

    def by_numpy(number: int) -> Any:  # noqa: ANN401 (an array)
        squares = ((at - asked[number]) ** 2).sum(axis=1)
        nearest = np.argpartition(squares, TOP)[:TOP]
        return nearest[np.lexsort((nearest, squares[nearest]))]

    for number in range(5):
        found = [run["id"] - 1 for run in library.recall(asked[number], TOP)]
        assert found == by_numpy(number).tolist()
    return {
        "recall_s": median_s(lambda number: library.recall(asked[number], TOP), N_RECALLS),
        "numpy_s": median_s(by_numpy, N_RECALLS // 10),
    }


def first_use(folder: Path, library: Library, n_runs: int) -> dict[str, float]:
    """Return time and memory of a law's first update, and of NumPy from files of all arrays."""
    core, e = PdIlc(0.5, 0.0), np.full(N_SAMPLES, 1e-5)
    law = RelevanceIlc(library, core, (1.0, 0.0, 1.0), TOP)
    law.expect([25.0, 5.0])
    forget_peak()
    before, start = peak_mb(), time.perf_counter()
    law.update(np.zeros(N_SAMPLES), e, disturbance=[26.0, 5.0])
    taken = time.perf_counter() - start
    memory = peak_mb() - before
    assert len(law) == n_runs + 1
    kept = np.array([signals(N_SAMPLES, number)[:2] for number in range(10)])
    np.save(folder / "kept.npy", np.tile(kept, (n_runs // 10, 1, 1)))
    at = disturbances(n_runs)
    forget_peak()
    before, start = peak_mb(), time.perf_counter()
    runs = np.load(folder / "kept.npy")
    sums = (runs[:, 1] ** 2).sum(axis=1) + ((at - [26.0, 5.0]) ** 2).sum(axis=1)
    nearest = np.argpartition(sums, TOP)[:TOP]
    weights = 1.0 / (1.0 + sums[nearest])
    np.tensordot(weights / weights.sum(), runs[nearest, 0] + 0.5 * runs[nearest, 1], axes=1)
    by_numpy = time.perf_counter() - start
    return {
        "first_use_s": taken, "first_use_mb": memory,
        "numpy_s": by_numpy, "numpy_mb": peak_mb() - before,
    }  # fmt: skip


def trim(library: Library, keep: int) -> dict[str, float]:
    """Return time and sizes of a trimming, and NumPy's time for the relevance alone."""
    size_mb = Path(library.path).stat().st_size / 1e6
    n_runs = len(library)
    # All pairs of a fiftieth of the disturbances, times fifty: all would take minutes.
    at = disturbances(n_runs)
    at = (at - at.mean(axis=0)) / at.std(axis=0)
    start = time.perf_counter()
    for few in np.array_split(at[: n_runs // 50], max(n_runs // 5000, 1)):
        apart = ((few[:, None] - at[None]) ** 2).sum(axis=2)
        weights = 1.0 / (1.0 + 1e-6 + apart)
        weights /= weights.sum(axis=1, keepdims=True)
    by_numpy = 50.0 * (time.perf_counter() - start)
    start = time.perf_counter()
    assert library.trim(keep) == n_runs - keep
    taken = time.perf_counter() - start
    after_mb = Path(library.path).stat().st_size / 1e6
    return {"trim_s": taken, "numpy_s": by_numpy, "before_mb": size_mb, "after_mb": after_mb}


def size(folder: Path) -> dict[str, float]:
    """Return the bytes of a run in the file, and those of its input and its error."""
    library = Library(folder / "size.db")
    sizes = []
    for count in (100, 300):
        for number in range(len(library), count):
            u, e, reference_m = signals(LONG, number)
            library.append(u, e, 0.001, 20.0, reference_m)
        sizes.append(Path(library.path).stat().st_size)
    return {"run_bytes": (sizes[1] - sizes[0]) / 200, "signals_bytes": 2.0 * 8 * LONG}


def measure(n_runs: int, n_short: int) -> dict[str, Any]:
    """Return all figures."""
    with tempfile.TemporaryDirectory(prefix="ilc-library-") as name:
        folder = Path(name)
        figures: dict[str, Any] = {"size": size(folder), "runs": n_runs}
        figures["recall"] = {n: recall(folder, n) for n in (n_runs, n_short)}
        library = fill(folder / "runs.db", n_runs, N_SAMPLES)
        figures["list_s"] = median_s(lambda _: library.list(), 1)
        figures["first_use"] = first_use(folder, library, n_runs)
        figures["trim"] = trim(library, n_runs // 100)
    return figures


def report(figures: dict[str, Any]) -> list[str]:
    """Return the rows of a table in Markdown."""
    lines = ["| | library | NumPy | ratio |", "|---|--:|--:|--:|"]
    for n_runs, taken in figures["recall"].items():
        lines.append(row(f"recall of {TOP} among {n_runs:,} runs", "recall_s", taken))
    n_runs = figures["runs"]
    first, trimmed, stored = figures["first_use"], figures["trim"], figures["size"]
    lines.append(row(f"first use of {n_runs:,} runs by `RelevanceIlc`", "first_use_s", first))
    ours, theirs = first["first_use_mb"], first["numpy_mb"]
    lines.append(
        f"| its memory | {ours:.0f} MB | {theirs:.0f} MB | {theirs / max(ours, 1.0):.1f} |"
    )
    lines.append(row(f"trimming {n_runs:,} runs to {n_runs // 100:,}", "trim_s", trimmed))
    sizes = f"{trimmed['before_mb']:.0f} MB | {trimmed['after_mb']:.1f} MB"
    ours, theirs = stored["run_bytes"], stored["signals_bytes"]
    lines.append(
        f"| a run of {LONG:,} samples; u and e alone | {ours / 1e3:.1f} kB | {theirs / 1e3:.1f} kB "
        f"| {theirs / ours:.2f} |"
    )
    return [*lines, "", f"The trimmed file: {sizes.replace(' | ', ' before, ')} after."]


def row(what: str, key: str, taken: dict[str, float]) -> str:
    """Return a row: both times, and how often ours goes into the other."""
    ours, theirs = taken[key], taken["numpy_s"]
    return f"| {what} | {1e3 * ours:.2f} ms | {1e3 * theirs:.2f} ms | {theirs / ours:.1f} |"


def main() -> None:
    """Measure, and print a table or figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100_000, help="runs with arrays")
    parser.add_argument("--short", type=int, default=1_000_000, help="runs of two samples")
    parser.add_argument("--json", action="store_true", help="print figures")
    options = parser.parse_args()
    figures = measure(options.runs, options.short)
    sys.stdout.write(json.dumps(figures) if options.json else "\n".join(report(figures)) + "\n")


if __name__ == "__main__":
    main()
