"""Section 3.4: effect of each of the three weights of norm-optimal learning on a servo axis.

The paper's package makes its section `servo` with it.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.barton2010.runs import rms, runs
from ilc_papers.barton2010.servo_noise import NOISE_STD, R_VALUES, noise_figures
from ilc_papers.barton2010.servo_pictures import PICTURES
from ilc_papers.barton2010.servo_system import CONTROLLER_GAIN, N_SAMPLES, Servo, servo
from ilc_papers.paper import Claim, Figures, Tell
from ilc_rt import NormOptimalIlc, analyze

if TYPE_CHECKING:
    from ilc_rt import Analysis

Q_VALUES = (1.0, 0.5, 0.1, 0.001)
S_VALUES = (10.0, 1.0, 0.1, 0.01, 0.001)
#: Runs after the first, of the comparisons of q and s, and of r.
ITERATIONS, ITERATIONS_R = 20, 500
#: Runs whose signals figure 3.4 shows.
SHOWN = (0, 1, 2, 5, 20)


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return RMS errors per run and factors of convergence for each weight, and the noise's share.

    `q`, `s`, `r`: `value`, `rms` (a list per value, from run 0), `monotonic_factor` (largest
    singular value of `L_u - L_e P`), `observed_factor` (largest ratio of distances from the final
    input in the runs themselves), `converged_rms`.

    References
    ----------
    Barton 2010, eq. (3.15) to (3.22), figures 3.4 to 3.8.
    """
    axis = servo(100 if reduced else N_SAMPLES)
    long = 80 if reduced else ITERATIONS_R

    @cache
    def ahead(q: float, s: float, r: float) -> Analysis:
        return analyze(
            {"q": q, "s": s, "r": r}, axis.plant, axis.n_samples,
            reference=axis.first_error, noise_std=NOISE_STD, n_runs=2,
        )  # fmt: skip

    figures: Figures = {}
    for name, values, n_runs in (
        ("q", Q_VALUES, ITERATIONS), ("s", S_VALUES, ITERATIONS), ("r", R_VALUES, long),
    ):  # fmt: skip
        tell(f"servo: weight {name}")
        sweep: Figures = {"value": list(values), "rms": [], "monotonic_factor": [],
                          "observed_factor": [], "converged_rms": []}  # fmt: skip
        for value in values:
            weights = {"q": 1.0, "s": 1.0, "r": 1.0, name: value}
            analysis = ahead(weights["q"], weights["s"], weights["r"])
            errors, observed = _learned(axis, weights, n_runs, analysis)
            sweep["rms"].append(errors)
            sweep["observed_factor"].append(observed)
            sweep["monotonic_factor"].append(analysis.monotonic_factor)
            sweep["converged_rms"].append(analysis.converged_error_rms)
        figures[name] = sweep
    tell("servo: noise")
    figures["noise"] = noise_figures(axis, [ahead(1.0, 1.0, r) for r in R_VALUES], reduced)
    figures["signals"] = _signals(axis)
    return figures


def _learned(
    axis: Servo, weights: dict[str, float], n_runs: int, analysis: Analysis
) -> tuple[list[float], float]:
    """Return the RMS error of each run, and the largest factor by which the input came nearer."""
    law = NormOptimalIlc(axis.plant, axis.n_samples, **weights)
    history = list(runs(law, axis.plant.simulate, axis.first_error, n_runs))
    final = np.ravel(np.asarray(analysis.converged_input, dtype=np.float64))
    distances = np.array([np.linalg.norm(final - u) for u, _ in history])
    # Below that, rounding alone decides.
    enough = distances[:-1] > 1e-9 * distances[0]
    observed = float((distances[1:][enough] / distances[:-1][enough]).max())
    return [rms(e) for _, e in history], observed


def _signals(axis: Servo) -> Figures:
    """Return the signals of figure 3.4, q = s = r = 1: error, feedback, learned input."""
    law = NormOptimalIlc(axis.plant, axis.n_samples, q=1.0, s=1.0, r=1.0)
    history = list(runs(law, axis.plant.simulate, axis.first_error, SHOWN[-1]))
    return {
        "run": list(SHOWN),
        "reference": axis.reference.tolist(),
        "error": [np.round(history[j][1], 8).tolist() for j in SHOWN],
        "feedback": [np.round(CONTROLLER_GAIN * history[j][1], 8).tolist() for j in SHOWN],
        "learned": [np.round(history[j][0], 8).tolist() for j in SHOWN],
    }


def claims(figures: Figures) -> list[Claim]:
    """Compare the statements of sections 3.3 and 3.4 with the results."""
    q, s, r, noise = (figures[name] for name in ("q", "s", "r", "noise"))
    factors = [*q["monotonic_factor"], *s["monotonic_factor"], *r["monotonic_factor"]]
    observed = [*q["observed_factor"], *s["observed_factor"], *r["observed_factor"]]
    spread = max(r["converged_rms"]) / min(r["converged_rms"]) - 1.0
    expected = noise["expected_rms"]
    deviation = max(
        abs(drawn / found - 1.0)
        for drawn, found in zip(noise["monte_carlo_rms"], expected, strict=True)
    )
    overstated = noise["equation_3_24_rms"][0] / expected[0]
    return [
        Claim(
            "converged error at q = 0.001 over that at q = 1",
            q["converged_rms"][-1] / q["converged_rms"][0], source="figure 3.5",
            holds=_rises(q["converged_rms"]),
            remark="the smaller q, the larger the converged error; the values themselves can "
            "only be read off a graph",
        ),
        Claim(
            "converged error at s = 0.001 over that at s = 10",
            s["converged_rms"][-1] / s["converged_rms"][0], source="figure 3.6",
            holds=_rises(s["converged_rms"][::-1]),
            remark="a smaller s leaves a smaller error",
        ),
        Claim(
            "largest monotonic factor of all weights", max(factors), source="eq. (3.19)",
            holds=max(factors) < 1.0, remark="every run brings the input nearer to its end",
        ),
        Claim(
            "observed factor never above the monotonic factor, worst excess",
            max(o - f for o, f in zip(observed, factors, strict=True)), source="eq. (3.19)",
            holds=all(o <= f + 1e-6 for o, f in zip(observed, factors, strict=True)),
        ),
        Claim(
            "r = 0 converges in one run: monotonic factor", r["monotonic_factor"][0], 0.0,
            source="section 3.3.1", holds=r["monotonic_factor"][0] < 1e-9,
            remark="deadbeat; the input is then the final one at once",
        ),
        Claim(
            "monotonic factor at r = 100", r["monotonic_factor"][-1], source="figure 3.7",
            holds=_rises(r["monotonic_factor"]),
            remark="the text says that the convergence rate increases with r: it is the factor "
            "that does; convergence becomes slower, as the figure shows",
        ),
        Claim(
            "spread of the converged error over r, without noise", spread, 0.0,
            source="eq. (3.22)", holds=spread < 1e-6, remark="r has no share in the final error",
        ),
        Claim(
            "expected error under noise at r = 100 over that at r = 0", expected[-1] / expected[0],
            source="figure 3.8", holds=_rises(expected[::-1]),
            remark="a larger r passes on less of the noise of earlier runs",
        ),
        Claim(
            "expected error under noise, drawn runs against the covariance", deviation,
            source="eq. (3.23)", holds=deviation < 0.03, remark="largest relative deviation",
        ),
        Claim(
            "error under noise by (3.24) over the expected one, r = 0", overstated,
            source="eq. (3.24)", holds=False,
            remark="(3.24) is exact only if the disturbance changes its sign from run to run, "
            "d_{j+1} = -d_j: there it agrees to "
            f"{max(noise['alternating_difference']):.0e}; under white noise the covariance decides",
        ),
    ]  # fmt: skip


def _rises(values: list[float]) -> bool:
    return all(after > before for before, after in pairwise(values))


__all__ = ["PICTURES", "claims", "compute"]
