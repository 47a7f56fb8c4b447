"""Prediction of convergence and choice of weights: ours against dense matrices, in one process."""

from __future__ import annotations

import numpy as np
from problem import axis, median_s

from ilc_rt import NormOptimalIlc, analyze, tune

R = 0.1


def compare(n_samples: int) -> dict[str, float]:
    """Return the median seconds to predict the factor of one axis, and those of dense matrices."""
    model = axis()
    law = NormOptimalIlc(model, n_samples, r=R)
    impulse = np.zeros(n_samples)
    impulse[0] = 1.0
    markov = model.simulate(impulse)

    def dense() -> float:
        lifted = np.zeros((n_samples, n_samples))
        for k in range(n_samples):
            lifted[k:, k] = markov[: n_samples - k]
        # The last input has no effect.
        lifted = lifted[1:, :-1]
        hessian = lifted.T @ lifted + R * np.eye(n_samples - 1)
        # R times the inverse of the Hessian: symmetric, its norm from the smallest eigenvalue.
        return R / float(np.linalg.eigvalsh(hessian)[0])

    ours = analyze(law, model).monotonic_factor
    if abs(dense() - ours) > 1e-8:
        message = f"the factors differ at N = {n_samples}: {dense()!r} and {ours!r}"
        raise AssertionError(message)
    return {
        "ilc-rt": median_s(lambda: analyze(law, model)),
        "dense matrices: Hessian, its eigenvalues (NumPy)": median_s(dense),
    }


def three_axes(n_samples: int) -> dict[str, float]:
    """Return the median seconds of prediction and choice of weights for three axes."""
    model = axis().append(axis()).append(axis())
    by_change = NormOptimalIlc(model, n_samples, r=R)
    by_rate = NormOptimalIlc(model, n_samples, rate=3.0)
    return {
        "ilc-rt": median_s(lambda: analyze(by_change, model)),
        "`analyze` with `rate`": median_s(lambda: analyze(by_rate, model)),
        "`tune`": median_s(lambda: tune(model, n_samples, uncertainty=0.1, noise_std=1e-6)),
    }
