"""The way of an update's arrays between Python and the law, beside plain copies of them."""

from __future__ import annotations

import numpy as np
from problem import R, axis, median_s

from ilc_rt import NormOptimalIlc


def compare(n_samples: int) -> dict[str, float]:
    """Return the median seconds of an update, one with `out`, and copies of its three arrays."""
    law = NormOptimalIlc(axis(), n_samples, r=R)
    u, e = np.zeros(n_samples), np.sin(0.01 * np.arange(n_samples))
    given, copies = u.copy(), [np.empty(n_samples) for _ in range(3)]

    def copied() -> None:
        for copy, signal in zip(copies, (u, e, given), strict=True):
            np.copyto(copy, signal)

    seconds = {
        "ilc-rt": median_s(lambda: law.update(u, e)),
        "ilc-rt, `out=`": median_s(lambda: law.update(u, e, out=given)),
        "copies of u, e and the next input (NumPy)": median_s(copied),
    }
    if not np.array_equal(given, law.update(u, e)):
        message = f"`out=` gives another input at N = {n_samples}"
        raise AssertionError(message)
    return seconds
