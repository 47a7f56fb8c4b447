"""Learning on thousands of plants that differ from the model: `simulate_many` against sweeps.

    python benchmarks/many_plants.py                    # 10,000 plants; the slow ways with 200
    python benchmarks/many_plants.py --plants 1000 --slow 50 --json figures.json

Times depend on what else the machine does: every way is repeated in turn, and its best time counts.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt import (
    ManyResult,
    NormOptimalIlc,
    StateSpace,
    discretize,
    latin_hypercube,
    second_order,
    simulate,
    simulate_many,
    sweep,
)

if TYPE_CHECKING:
    from collections.abc import Callable

N_SAMPLES = 1300
TRIALS = 20
DT_S = 1e-3
NOISE_STD = 1e-6
SEED = 7
REFERENCE = 0.01 * np.hanning(N_SAMPLES)
RANGES = {"natural_rad_s": (80.0, 300.0, "log"), "damping": (0.3, 1.0)}


def plant(natural_rad_s: float, damping: float) -> StateSpace:
    """Return an axis."""
    return discretize(second_order(natural_rad_s, damping), DT_S)


@cache
def law() -> NormOptimalIlc:
    """Return the law, which knows the axis of 157 rad/s alone and is made once per process."""
    return NormOptimalIlc(plant(157.0, 0.5), N_SAMPLES, r=1e-2)


def learned(natural_rad_s: float, damping: float, noise_std: float, seed: int) -> dict[str, Any]:
    """Return the figures of one plant: a case of a sweep."""
    result = simulate(
        plant(natural_rad_s, damping), law(), REFERENCE, trials=TRIALS, noise_std=noise_std,
        seed=seed,
    )  # fmt: skip
    figures = result.figures()
    return {"rms": figures["tracking_rms_m"], "inf": figures["tracking_inf_m"]}


def swept(cases: list[dict[str, float]], executor: Any) -> str:  # noqa: ANN401 (any executor)
    """Return the digest of a sweep over the cases."""
    values = sweep(learned, cases, executor, seed=SEED).values
    found = {name: np.array([value[name] for value in values]) for name in ("rms", "inf")}
    return ManyResult(**found).digest


def best_s(
    ways: dict[str, Callable[[], str]], repeats: int
) -> tuple[dict[str, float], dict[str, str]]:
    """Return the least seconds of each way, all in turn, and the digests of their results."""
    seconds, digests = dict.fromkeys(ways, float("inf")), {}
    for _ in range(repeats):
        for name, way in ways.items():
            begun = time.perf_counter()
            digests[name] = way()
            seconds[name] = min(seconds[name], time.perf_counter() - begun)
    return seconds, digests


def compare(
    n_plants: int, n_slow: int, noise_std: float, repeats: int, *, with_dask: bool
) -> list[dict[str, Any]]:
    """Return a row for each way: its plants, best seconds and digest."""
    cases = latin_hypercube(RANGES, n_plants, seed=1)
    plants = [plant(**case) for case in cases]

    def native(threads: int, count: int) -> Callable[[], str]:
        return lambda: simulate_many(
            plants[:count], law(), REFERENCE, trials=TRIALS, noise_std=noise_std, seed=SEED,
            threads=threads,
        ).digest  # fmt: skip

    slow = [{**case, "noise_std": noise_std} for case in cases[:n_slow]]
    rows = []

    def measured(count: int, repeats: int, ways: dict[str, Callable[[], str]]) -> None:
        seconds, digests = best_s(ways, repeats)
        rows.extend(
            {"way": name, "plants": count, "seconds": seconds[name], "digest": digests[name]}
            for name in ways
        )

    one, two = "simulate_many, one thread", "simulate_many, two threads"
    measured(n_plants, repeats, {one: native(1, n_plants), two: native(2, n_plants)})
    measured(n_slow, repeats, {one: native(1, n_slow)})
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        ways = {"sweep, this process": lambda: swept(slow, None)}
        ways["sweep, two processes"] = lambda: swept(slow, pool)
        # The first turn also starts the processes.
        measured(n_slow, repeats, ways)
    if with_dask:
        from distributed import Client, LocalCluster

        with (
            LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster) as client,
            client.get_executor() as executor,
        ):
            measured(n_slow, repeats, {"sweep, Dask, two workers": lambda: swept(slow, executor)})
    return rows


def main() -> None:
    """Print the rows, and fail if results of the same plants differ in a bit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=10_000)
    parser.add_argument("--slow", type=int, default=200, help="plants of the slow ways")
    parser.add_argument("--noise-std", type=float, default=NOISE_STD)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--no-dask", action="store_true")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows = compare(
        given.plants, min(given.slow, given.plants), given.noise_std, given.repeats,
        with_dask=not given.no_dask,
    )  # fmt: skip
    for row in rows:
        each_us = 1e6 * row["seconds"] / row["plants"] / TRIALS
        print(
            f"{row['way']:28} {row['plants']:6} plants {row['seconds']:9.3f} s "
            f"{each_us:9.1f} us per trial  {row['digest'][:16]}"
        )
    print(f"two threads are worth {rows[0]['seconds'] / rows[1]['seconds']:.2f} of one")
    for count in {row["plants"] for row in rows}:
        if len({row["digest"] for row in rows if row["plants"] == count}) > 1:
            sys.exit(f"the results of {count} plants differ")
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    # Under its name, as the functions go to other processes.
    import many_plants

    many_plants.main()
