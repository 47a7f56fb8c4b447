"""Functions of sweeps that other processes can import, and a cluster of this host."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt import PdIlc, discretize, second_order, simulate

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def learned(natural_rad_s: float, kp: float, seed: int) -> dict[str, object]:
    """Return how a law learns on an axis with noise."""
    axis = discretize(second_order(natural_rad_s, 0.7), 0.002)
    result = simulate(
        axis, PdIlc(kp=kp), 0.01 * np.hanning(100), trials=5, noise_std=1e-5, seed=seed
    )
    rms = result.figures()["tracking_rms_m"]
    return {"last_m": rms[-1], "rms_m": rms, "law": "pd"}


def drawn(scale: float, rng: np.random.Generator) -> float:
    """Return a random number."""
    return scale * float(rng.normal())


def failing(number: int) -> int:
    """Fail for one case."""
    if number == 3:
        message = "no such plant"
        raise ValueError(message)
    return number


@contextmanager
def cluster(port: int, folder: Path) -> Iterator[str]:
    """Start a scheduler of Dask and two worker processes; yield its address."""
    address = f"tcp://127.0.0.1:{port}"
    python = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address]
    commands = [
        [*python, "--host", "127.0.0.1", "--port", str(port), "--no-dashboard", "--no-show"],
        *[[*worker, "--nthreads", "1", "--no-nanny", "--no-dashboard"]] * 2,
    ]
    with (folder / "cluster.log").open("wb") as log:
        processes = [
            subprocess.Popen(command, cwd=folder, stdout=log, stderr=log) for command in commands
        ]
        try:
            yield address
        finally:
            for process in processes[::-1]:
                process.terminate()
            deadline = time.monotonic() + 10.0
            for process in processes:
                while process.poll() is None and time.monotonic() < deadline:
                    time.sleep(0.05)
                process.kill()
                process.wait()
