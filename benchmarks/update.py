"""One update of norm-optimal ILC: ours against common solvers, in one process."""

from __future__ import annotations

import numpy as np
from problem import R, axis, median_s, problem
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from ilc_rt import NormOptimalIlc


def compare(n_samples: int) -> dict[str, float]:
    """Return the median seconds of an update by each solver, factors kept where possible."""
    task = problem(n_samples)
    zero = np.zeros(n_samples)
    law = NormOptimalIlc(axis(), n_samples, r=R)
    ours = law.update(zero, task.error)
    seconds = {"ilc-rt": median_s(lambda: law.update(zero, task.error))}

    def check(name: str, v: np.ndarray, tolerance: float) -> None:
        gap = float(np.abs(v - ours).max() / np.abs(ours).max())
        if gap > tolerance:
            message = f"{name} differs by {gap:.1e} at N = {n_samples}"
            raise AssertionError(message)

    p = task.lifted
    factor = linalg.cho_factor(p.T @ p + R * np.eye(n_samples))

    def dense() -> np.ndarray:
        return zero + linalg.cho_solve(factor, p.T @ task.error[1:])

    check("dense", dense(), 1e-8)
    seconds["dense Cholesky, kept (SciPy)"] = median_s(dense)

    n_rows = task.equality.shape[0]
    empty = sparse.csc_matrix((n_rows, n_rows))
    kkt = sparse.bmat([[task.hessian, task.equality.T], [task.equality, empty]], format="csc")
    lu = splu(kkt)

    def superlu() -> np.ndarray:
        right = np.concatenate([-task.gradient(task.error), np.zeros(n_rows)])
        return lu.solve(right)[-n_rows - n_samples : -n_rows]

    check("SuperLU", superlu(), 1e-8)
    seconds["SuperLU on the KKT system, kept (SciPy)"] = median_s(superlu)
    seconds |= by_quadratic_programs(task, check)
    return seconds


def by_quadratic_programs(task: object, check: object) -> dict[str, float]:
    """Return the seconds of the QP solvers, to 1e-8."""
    import clarabel
    import osqp

    n_rows = task.equality.shape[0]
    zeros = np.zeros(n_rows)
    solver = osqp.OSQP()
    solver.setup(
        sparse.triu(task.hessian, format="csc"),
        task.gradient(task.error),
        task.equality,
        zeros,
        zeros,
        verbose=False,
        eps_abs=1e-8,
        eps_rel=1e-8,
        max_iter=100_000,
        polishing=False,
    )

    def by_osqp() -> np.ndarray:
        solver.warm_start(x=np.zeros(task.hessian.shape[0]), y=zeros)
        solver.update(q=task.gradient(task.error))
        return solver.solve().x[-task.n_samples :]

    check("OSQP", by_osqp(), 1e-2)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(n_rows)]
    upper = sparse.triu(task.hessian, format="csc")

    def by_clarabel() -> np.ndarray:
        gradient = task.gradient(task.error)
        program = clarabel.DefaultSolver(upper, gradient, task.equality, zeros, cones, settings)
        return np.array(program.solve().x)[-task.n_samples :]

    check("Clarabel", by_clarabel(), 1e-5)
    return {
        "OSQP, factor kept, 1e-8": median_s(by_osqp),
        "Clarabel, 1e-8": median_s(by_clarabel),
    }
