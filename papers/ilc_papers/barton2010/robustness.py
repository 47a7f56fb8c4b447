"""Sections 3.3.2 and 3.3.4: lemmas 1 and 2 on the servo axis, and the tuning guidelines.

The paper's package makes its section `robustness` with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.barton2010.servo_noise import NOISE_STD
from ilc_papers.barton2010.servo_system import Servo, servo
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import NormOptimalIlc, analyze, tune

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Samples of a run; the lemmas are about matrices of this size.
N_SAMPLES = 120
#: Uncertainty W of all frequencies alike in the lemmas: the axis may be off by 90 %.
UNCERTAINTY = 0.9
S_VALUES = (0.01, 0.1, 1.0, 10.0)
R_VALUES = (0.0, 0.1, 1.0, 10.0)
#: Uncertainty for the guidelines, from standstill to the Nyquist frequency.
SHAPED = np.linspace(0.0, 2.0, 33)


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return worst factors of a run under uncertainty, a counterexample to lemma 2, and a tuning.

    References
    ----------
    Barton 2010, eq. (3.20), lemmas 1 and 2, section 3.3.4.
    """
    axis = servo(60 if reduced else N_SAMPLES)
    lifted = axis.plant.lifted(axis.n_samples)
    values, vectors = np.linalg.eigh(lifted.T @ lifted)
    tell("robustness: lemmas 1 and 2")
    figures: Figures = {
        "uncertainty": UNCERTAINTY,
        "s": list(S_VALUES),
        "r": list(R_VALUES),
        "worst_factor": [[_worst_factor(values, s, r)[0] for r in R_VALUES] for s in S_VALUES],
        "bound": [[_bound(axis, s, r) for r in R_VALUES] for s in S_VALUES],
        "counterexample": _counterexample(axis, values, vectors, s=0.1, r=1.0),
    }
    tell("robustness: guidelines")
    return {**figures, "guidelines": _guidelines(axis)}


def _bound(axis: Servo, s: float, r: float) -> float | None:
    """Return the bound guaranteed by `analyze`: `|T| + w |L_e P|`."""
    weights = {"q": 1.0, "s": s, "r": r}
    found = analyze(weights, axis.plant, axis.n_samples, uncertainty=UNCERTAINTY)
    return found.robust_lifted


def _worst_factor(values: Array, s: float, r: float) -> tuple[float, Array]:
    """Return the largest norm (3.20) over all plants within the uncertainty, and where it is.

    `max_Delta |A - B Delta| = max_z |A z| + |B z|` over unit vectors z. Here A and B are functions
    of `H = P'P` with eigenvalues a and b, for which `a (s + r) / r + b / w = 1`: of all z the one
    that is made of the two outermost eigenvectors of H is the worst.

    The place is given by the parts of z along the two eigenvectors; `values` rise.
    """
    ends = values[[0, -1]] + s + r
    change, error = r / ends, UNCERTAINTY * values[[0, -1]] / ends
    share = np.linspace(0.0, 1.0, 10_001)[:, np.newaxis]
    squares = np.hstack([share, 1.0 - share])
    norm = np.sqrt(squares @ change**2) + np.sqrt(squares @ error**2)
    best = int(norm.argmax())
    return float(norm[best]), np.sqrt(squares[best])


def _counterexample(axis: Servo, values: Array, vectors: Array, s: float, r: float) -> Figures:
    """Return a plant within the uncertainty at which lemma 2 fails, tried with the law itself.

    `T = (H + S + R)^-1 (R - H W Delta)` with `Delta = y x'`. The law then meets `P (I + W Delta)`
    from an input that this plant makes larger.
    """
    change, error = r / (values + s + r), UNCERTAINTY * values / (values + s + r)
    z = np.zeros(len(values))
    z[[0, -1]] = _worst_factor(values, s, r)[1]
    x, y = _unit(vectors @ (change * z)), -_unit(vectors @ (error * z))
    delta = np.outer(y, x)
    true = axis.plant.lifted(axis.n_samples) @ (np.eye(len(x)) + UNCERTAINTY * delta)
    map_of_input = (vectors * change) @ vectors.T - (vectors * error) @ vectors.T @ delta
    # The norm |v|^2 = v' (I + r (H + S)^-1) v, in which every such T contracts.
    root = (vectors * np.sqrt(1.0 + r / (values + s))) @ vectors.T
    law = NormOptimalIlc(axis.plant, axis.n_samples, q=1.0, s=s, r=r)
    u, norms = x, [1.0]
    for _ in range(200):
        u = law.update(u, -true @ u)
        norms.append(float(np.linalg.norm(u)))
    return {
        "s": s,
        "r": r,
        "lemma_1_norm": float(np.max(UNCERTAINTY * values / (values + s))),
        "norm": float(np.linalg.norm(map_of_input, 2)),
        "spectral_radius": float(np.abs(np.linalg.eigvals(map_of_input)).max()),
        "weighted_norm": float(np.linalg.norm(root @ map_of_input @ np.linalg.inv(root), 2)),
        "input_norm": norms,
    }


def _unit(vector: Array) -> Array:
    return vector / float(np.linalg.norm(vector))


def _guidelines(axis: Servo) -> Figures:
    """Return what guidelines s1 to s4 propose for the axis, and the outcome."""
    tuned = tune(
        axis.plant, axis.n_samples, uncertainty=SHAPED, noise_std=NOISE_STD,
        reference=axis.first_error,
    )  # fmt: skip
    return {
        "largest_uncertainty": float(SHAPED.max()),
        "q": tuned.q,
        "s": tuned.s,
        "r": tuned.r,
        "steps": [f"{step['name']}: {step['what']}: {step['why']}" for step in tuned.steps],
        "robust_factor": tuned.analysis.robust_factor,
        "monotonic_factor": tuned.analysis.monotonic_factor,
        "without_s": analyze(
            {"q": 1.0, "s": 0.0, "r": tuned.r}, axis.plant, axis.n_samples, uncertainty=SHAPED
        ).robust_factor,
    }


def claims(figures: Figures) -> list[Claim]:
    """Compare sections 3.3.2 and 3.3.4 with the print."""
    worst, guidelines, example = (
        figures["worst_factor"], figures["guidelines"], figures["counterexample"]
    )  # fmt: skip
    without_r = [row[0] for row in worst]
    with_r = [row[figures["r"].index(1.0)] for row in worst]
    return [
        Claim(
            "worst factor at r = 0 and the largest s", without_r[-1], source="lemma 1",
            holds=max(without_r) < 1.0 and without_r == sorted(without_r, reverse=True),
            remark="with r = 0 every plant within 90 % converges in every run, and faster the "
            "larger s",
        ),
        Claim(
            "r does not matter for robust convergence in the 2-norm: worst factor at r = 1",
            max(with_r), source="lemma 2", holds=max(with_r) < 1.0,
            remark="does not follow: the proof takes Z Delta, which mixes eigenvectors, for the "
            "number alpha; the input can grow from one run to the next",
        ),
        Claim(
            "lemma 2, counterexample: growth of the input in the first run",
            example["input_norm"][1], source="lemma 2", holds=example["input_norm"][1] <= 1.0,
            remark=f"though the norm of lemma 1 is {example['lemma_1_norm']:.3f} < 1; "
            f"after 200 runs {example['input_norm'][-1]:.1e} of it is left",
        ),
        Claim(
            "lemma 2 in the norm weighted by I + r (P'QP + S)^-1", example["weighted_norm"],
            source="lemma 2",
            holds=example["weighted_norm"] < 1.0 and example["spectral_radius"] < 1.0,
            remark="there it is true for every plant within the uncertainty: with v = T x and "
            "y = -Z Delta x, (I + r M^-1) v = r M^-1 x + y, and Cauchy-Schwarz does the rest",
        ),
        Claim(
            "guidelines: worst factor with the proposed weights", guidelines["robust_factor"],
            source="section 3.3.4", holds=guidelines["robust_factor"] < 1.0,
            remark=f"uncertainty from 0 to {guidelines['largest_uncertainty']:.0%} with the "
            f"frequency: s = {guidelines['s']:.3g}, r = {guidelines['r']:.3g}; the print compares "
            "the norm of S with that of P, here with that of P squared, as in the cost",
        ),
        Claim(
            "the same without s", guidelines["without_s"], source="section 3.3.4",
            holds=guidelines["without_s"] >= 1.0, remark="S is what makes it robust",
        ),
    ]  # fmt: skip


def _draw_worst(figures: Figures, figure: Figure) -> None:
    section = figures["robustness"]
    left, right = figure.subplots(1, 2)
    for s, row in zip(section["s"], section["worst_factor"], strict=True):
        left.plot(section["r"], row, "o-", markersize=3, label=f"s = {s:g}")
    left.axhline(1.0, color="#30343B", linestyle="--", linewidth=1.0)
    left.set_xscale("symlog", linthresh=0.1)
    left.set_xlim(left=0.0)
    left.set_xlabel("weight r of the change of input")
    left.set_ylabel("worst factor of a run")
    left.legend()
    norms = section["counterexample"]["input_norm"][:30]
    right.plot(range(len(norms)), norms, "o-", markersize=3)
    right.set_xlabel("run")
    right.set_ylabel("norm of the input")


PICTURES = [
    Picture(
        "robustness",
        "Left: with r > 0 a run can make the input larger, lemma 2 notwithstanding. Right: the "
        "law on such a plant.",
        _draw_worst,
    )
]
