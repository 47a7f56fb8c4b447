"""One update of two coupled axes, and of two axes with contour weights: ours against SuperLU."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from problem import DT_S, R, median_s
from scipy import sparse
from scipy.sparse.linalg import splu

from ilc_rt import NormOptimalIlc, discretize, second_order
from ilc_rt.weights import contour

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt import StateSpace

    Array = NDArray[np.float64]

# What a motion of one axis does to the other.
COUPLING = np.array([[1.0, 0.2], [0.1, 1.0]])


def two_axes() -> StateSpace:
    """Return two axes of 157 and 120 rad/s."""
    return discretize(second_order(157.0, 0.5), DT_S).append(
        discretize(second_order(120.0, 0.7), DT_S)
    )


def coupled(n_samples: int) -> dict[str, float]:
    """Return the median seconds of an update of two coupled axes."""
    model = COUPLING * two_axes()
    weights = np.tile(np.eye(2), (n_samples, 1, 1))
    return against(NormOptimalIlc(model, n_samples, r=R), model, weights)


def along_a_circle(n_samples: int) -> dict[str, float]:
    """Return the median seconds of an update with contour weights along a circle."""
    angle = np.linspace(0.0, 2.0 * np.pi, n_samples)
    circle = 0.05 * np.column_stack([np.cos(angle), np.sin(angle)])
    weights = contour(circle, q=0.1, contour=1.0)
    law = NormOptimalIlc(two_axes(), n_samples, q=weights, r=R)
    return against(law, two_axes(), weights)


def against(law: NormOptimalIlc, model: StateSpace, weights: Array) -> dict[str, float]:
    """Return the median seconds of an update, and those of SuperLU with its factor kept."""
    n_samples, p, _ = weights.shape
    n, m = model.n_states, model.n_inputs
    eye = sparse.identity(n_samples, format="csc")
    shift = sparse.eye(n_samples, k=-1, format="csc")
    dynamics = sparse.kron(eye, sparse.identity(n)) - sparse.kron(shift, model.a)
    equality = sparse.hstack([dynamics, -sparse.kron(eye, model.b)], format="csc")
    # The error of sample k + 1 belongs to v[k]; the last input affects no sample of the run.
    ahead = np.concatenate([weights[1:], np.zeros((1, p, p))])
    weigh = sparse.block_diag(ahead, format="csr")
    output = sparse.kron(eye, model.c, format="csr")
    change = R * sparse.identity(n_samples * m)
    hessian = 2.0 * sparse.block_diag([output.T @ weigh @ output, change], format="csc")
    n_rows = equality.shape[0]
    empty = sparse.csc_matrix((n_rows, n_rows))
    lu = splu(sparse.bmat([[hessian, equality.T], [equality, empty]], format="csc"))

    error = np.sin(0.01 * np.arange(n_samples)[:, None] + np.arange(p))
    zero = np.zeros((n_samples, m))

    def superlu() -> Array:
        paired = np.append(error[1:], np.zeros((1, p)), axis=0).ravel()
        gradient = -2.0 * (output.T @ (weigh @ paired))
        right = np.concatenate([-gradient, np.zeros(n_samples * m + n_rows)])
        return lu.solve(right)[n_samples * n : -n_rows].reshape(n_samples, m)

    ours = law.update(zero, error)
    gap = float(np.abs(superlu() - ours).max() / np.abs(ours).max())
    if gap > 1e-8:
        message = f"SuperLU differs by {gap:.1e} at N = {n_samples}"
        raise AssertionError(message)
    return {
        "ilc-rt": median_s(lambda: law.update(zero, error)),
        "SuperLU on the KKT system, kept (SciPy)": median_s(superlu),
    }
