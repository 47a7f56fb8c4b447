"""A run of a million samples: time and memory of one update, as figures on standard output."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from problem import R, axis, median_s

from ilc_rt import NormOptimalIlc


def forget_peak() -> None:
    """Reset the peak memory of this process to the current value."""
    Path("/proc/self/clear_refs").write_text("5")


def peak_mb() -> float:
    """Return the peak memory of this process since then."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1024.0


def main() -> None:
    """Print the median seconds, and the memory beyond that of input and error."""
    n_samples = 1_000_000
    u, e = np.zeros(n_samples), np.sin(0.01 * np.arange(n_samples))
    law = NormOptimalIlc(axis(), 100, r=R)
    law.update(u[:100], e[:100])
    forget_peak()
    before = peak_mb()
    law = NormOptimalIlc(axis(), n_samples, r=R)
    law.update(u, e)
    after = peak_mb()
    print(json.dumps({"seconds": median_s(lambda: law.update(u, e)), "mb": after - before}))


if __name__ == "__main__":
    main()
