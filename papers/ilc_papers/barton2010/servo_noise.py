"""The servo axis under noise that differs from run to run: expected errors, and (3.24).

Only section `servo` imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.barton2010.runs import rms, runs
from ilc_rt import NormOptimalIlc

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ilc_papers.barton2010.servo_system import Servo
    from ilc_papers.paper import Figures
    from ilc_rt import Analysis

    Array = NDArray[np.float64]

#: Variance 1e-6, section 3.4.
NOISE_STD = 1e-3
#: Weights of the change of input.
R_VALUES = (0.0, 0.1, 1.0, 10.0, 100.0)


def noise_figures(axis: Servo, ahead: Sequence[Analysis], reduced: bool) -> Figures:  # noqa: FBT001
    """Return the errors caused by white noise, for each weight r at q = s = 1.

    `u[j+1] = T u[j] + L_e (e_0 - d_j)`: the input of a run knows only the noise of earlier ones,
    so its covariance solves `X = T X T' + L_e L_e' sigma^2`, and
    `E|e|^2 = |e_inf|^2 + tr(P X P') + N sigma^2`. That is `expected_rms` of `analyze`. Runs with
    drawn noise check it. `ahead` has the analysis of each weight, in the order of `R_VALUES`.

    References
    ----------
    Barton 2010, eq. (3.23), (3.24), figure 3.8.
    """
    burn_in, counted = (120, 150) if reduced else (400, 400)
    figures: Figures = {
        "value": list(R_VALUES),
        "noise_std": NOISE_STD,
        "expected_rms": [],
        "monte_carlo_rms": [],
        "monte_carlo_from_run": burn_in,
        "equation_3_24_rms": [],
        "alternating_difference": [],
        "runs_rms": [],
    }
    for number, (r, found) in enumerate(zip(R_VALUES, ahead, strict=True)):
        law = NormOptimalIlc(axis.plant, axis.n_samples, q=1.0, s=1.0, r=r)
        drawn = np.random.default_rng(number)
        noise = drawn.normal(scale=NOISE_STD, size=(burn_in + counted, axis.n_samples))
        seen = _disturbed(axis, law, noise)
        figures["expected_rms"].append(found.expected_rms_limit)
        figures["monte_carlo_rms"].append(rms(np.array(seen[burn_in:])))
        figures["runs_rms"].append([rms(e) for e in seen[:burn_in]])
        settled, fluctuation = _printed_equation(axis, r)
        mean_square = np.mean(settled**2) + NOISE_STD**2 * np.mean(np.sum(fluctuation**2, axis=1))
        figures["equation_3_24_rms"].append(float(np.sqrt(mean_square)))
        # Enough runs for the transient to fall below 1e-8.
        n_runs = 3 + int(np.log(1e-8) / np.log(max(found.spectral_radius, 1e-3)))
        figures["alternating_difference"].append(
            _alternating_difference(axis, law, settled, fluctuation, noise[0], n_runs)
        )
    return figures


def _disturbed(axis: Servo, law: NormOptimalIlc, noise: Array) -> list[Array]:
    """Return the errors of runs with a different disturbance of the output in each."""
    history = runs(law, axis.plant.simulate, axis.first_error, len(noise) - 1, lambda j: noise[j])
    return [e for _, e in history]


def _printed_equation(axis: Servo, r: float) -> tuple[Array, Array]:
    """Return the two parts of (3.24): the error without noise, and the matrix before d_j.

    The sign of d is that of (3.2), where it adds to the output and so takes from the error; the
    printed plus belongs to d taken from the output.
    """
    lifted = axis.plant.lifted(axis.n_samples)
    own = np.eye(axis.n_samples)
    hessian = lifted.T @ lifted + own
    settled = axis.first_error - lifted @ np.linalg.solve(hessian, lifted.T @ axis.first_error)
    return settled, own + lifted @ np.linalg.solve(hessian + 2.0 * r * own, lifted.T)


def _alternating_difference(
    axis: Servo, law: NormOptimalIlc, settled: Array, fluctuation: Array, noise: Array, n_runs: int
) -> float:
    """Return the deviation of (3.24) from runs whose disturbance alternates in sign."""
    last = _disturbed(axis, law, np.array([(-1.0) ** j * noise for j in range(n_runs)]))[-1]
    expected = settled - fluctuation @ ((-1.0) ** (n_runs - 1) * noise)
    return float(np.abs(last - expected).max() / np.abs(expected).max())
