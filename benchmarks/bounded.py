"""One update of ILC within bounds: ours against interior-point solvers, in one process."""

from __future__ import annotations

import numpy as np
from problem import R, axis, median_s, problem
from scipy import sparse

from ilc_rt import ConstrainedIlc

# Both bounds bind along part of the run.
INPUT_MAX = 0.8
STEP_MAX = 0.02


def compare(n_samples: int) -> dict[str, float]:
    """Return the median seconds of a bounded update by each solver, to 1e-8 or better."""
    import clarabel
    import piqp

    task = problem(n_samples, dense=False)
    zero = np.zeros(n_samples)
    bounds = {"input_max": (-INPUT_MAX, INPUT_MAX), "step_max": (-STEP_MAX, STEP_MAX)}
    law = ConstrainedIlc(axis(), n_samples, r=R, **bounds)
    ours = law.update(zero, task.error)
    binding = {
        "inputs": int(np.sum(np.abs(ours) > 0.999 * INPUT_MAX)),
        "steps": int(np.sum(np.abs(np.diff(ours)) > 0.999 * STEP_MAX)),
    }
    if min(binding.values()) == 0:
        message = f"a bound that binds nowhere compares nothing: {binding}"
        raise AssertionError(message)

    def from_scratch() -> np.ndarray:
        law.reset()
        return law.update(zero, task.error)

    seconds = {"ilc-rt": median_s(from_scratch)}

    n_states = task.hessian.shape[0] - n_samples
    difference = sparse.diags([-1.0, 1.0], [0, 1], shape=(n_samples - 1, n_samples))
    steps = sparse.hstack([sparse.csc_matrix((n_samples - 1, n_states)), difference], format="csc")
    inputs = sparse.hstack(
        [sparse.csc_matrix((n_samples, n_states)), sparse.identity(n_samples)], format="csc"
    )
    n_rows = task.equality.shape[0]
    gradient = task.gradient(task.error)
    # The input starts from rest, so its first sample is a step as well.
    input_max = np.full(n_samples, INPUT_MAX)
    input_max[0] = STEP_MAX
    least = np.concatenate([np.full(n_states, -np.inf), -input_max])

    def by_piqp() -> np.ndarray:
        solver = piqp.SparseSolver()
        solver.settings.eps_abs = 1e-8
        solver.settings.eps_rel = 0.0
        solver.setup(
            task.hessian,
            gradient,
            task.equality,
            np.zeros(n_rows),
            steps,
            np.full(n_samples - 1, -STEP_MAX),
            np.full(n_samples - 1, STEP_MAX),
            least,
            -least,
        )
        solver.solve()
        return np.array(solver.result.x)[-n_samples:]

    stacked = sparse.vstack([task.equality, steps, -steps, inputs, -inputs], format="csc")
    right = np.concatenate(
        [np.zeros(n_rows), np.full(2 * (n_samples - 1), STEP_MAX), input_max, input_max]
    )
    cones = [clarabel.ZeroConeT(n_rows), clarabel.NonnegativeConeT(len(right) - n_rows)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    upper = sparse.triu(task.hessian, format="csc")

    def by_clarabel() -> np.ndarray:
        program = clarabel.DefaultSolver(upper, gradient, stacked, right, cones, settings)
        return np.array(program.solve().x)[-n_samples:]

    # If the cost hardly depends on the input, their inputs are less exact than their costs.
    for name, solve in (("PIQP", by_piqp), ("Clarabel", by_clarabel)):
        gap = float(np.abs(solve() - ours).max() / INPUT_MAX)
        if gap > 1e-3:
            message = f"{name} differs by {gap:.1e} at N = {n_samples}"
            raise AssertionError(message)
    return seconds | {"PIQP, 1e-8": median_s(by_piqp), "Clarabel, 1e-8": median_s(by_clarabel)}
