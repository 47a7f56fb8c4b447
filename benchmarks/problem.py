"""The problem for all solvers: an axis, its cost, and that cost as a sparse system."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ilc_rt import discretize, second_order

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

DT_S = 1e-3
R = 1e-2


@dataclass(frozen=True)
class Problem:
    """A second-order axis of 157 rad/s at 1 ms: ``min |e - P v|^2 + R |v|^2``.

    ``variables = (x_1 .. x_N, v_0 .. v_(N-1))`` with ``x_(k+1) = A x_k + B v_k``, so that all
    sparse solvers see ``min 1/2 z'Hz + g(e)'z`` subject to ``E z = 0``.
    """

    n_samples: int
    hessian: sparse.csc_matrix
    equality: sparse.csc_matrix
    output: sparse.csr_matrix
    lifted: Array
    error: Array

    def gradient(self, error: Array) -> Array:
        """Return g for an error that is paired one sample ahead of the input."""
        ahead = np.append(error[1:], 0.0)
        return np.concatenate([-2.0 * (self.output.T @ ahead), np.zeros(self.n_samples)])


def axis() -> object:
    """Return the model of the axis."""
    return discretize(second_order(157.0, 0.5), DT_S)


def problem(n_samples: int, *, dense: bool = True) -> Problem:
    """Return the problem for runs of a length; without the dense operator if it would not fit."""
    model = discretize(second_order(157.0, 0.5), DT_S)
    a, b, c = model.a, model.b, model.c
    n_states = a.shape[0]
    # The error of sample k + 1 belongs to v[k]; the last input affects no sample of the run.
    weights = np.ones(n_samples)
    weights[-1] = 0.0
    eye = sparse.identity(n_samples, format="csc")
    shift = sparse.eye(n_samples, k=-1, format="csc")
    equality = sparse.hstack(
        [
            sparse.kron(eye, sparse.identity(n_states)) - sparse.kron(shift, a),
            -sparse.kron(eye, b),
        ],
        format="csc",
    )
    output = sparse.kron(sparse.diags(weights), c, format="csr")
    hessian = 2.0 * sparse.block_diag([output.T @ output, R * eye], format="csc")
    lifted = np.empty((0, 0))
    if dense:
        impulse = np.zeros(n_samples)
        impulse[0] = 1.0
        markov = model.simulate(impulse)[1:]
        lifted = np.zeros((n_samples - 1, n_samples))
        for k in range(n_samples - 1):
            lifted[k:, k] = markov[: n_samples - 1 - k]
    error = np.sin(0.01 * np.arange(n_samples))
    return Problem(n_samples, hessian, equality, output, lifted, error)


def median_s(work: Callable[[], object], least_s: float = 0.3, most: int = 2000) -> float:
    """Return the median duration of a call, repeated for some time after a warm-up."""
    work()
    durations: list[float] = []
    while len(durations) < 3 or (sum(durations) < least_s and len(durations) < most):
        start = time.perf_counter()
        work()
        durations.append(time.perf_counter() - start)
    return float(np.median(durations))
