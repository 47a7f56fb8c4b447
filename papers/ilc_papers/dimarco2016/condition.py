"""Condition 3.4 on the gains of PD-ILC, compared with the lifted norm, and the range between them.

Read by the package's `__init__` only.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.dimarco2016.campaign import GAIN, core
from ilc_papers.dimarco2016.machine import closed_loop, motor
from ilc_papers.dimarco2016.reference import appendix_a
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import PdIlc, analyze

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

#: Runs at constant temperature; without a Q-filter the errors then grow without limit.
N_RUNS, REDUCED_RUNS = 150, 40
REDUCED_SAMPLES = 400

#: Samples for which the norm with the Q filter's ends is computed densely.
DENSE_SAMPLES = 640


def constant(law: PdIlc, reference: NDArray[np.float64], n_runs: int) -> list[float]:
    """Return the RMS errors of runs of the motor that all have the same temperature."""
    loop, u, rms = closed_loop(1.0), np.zeros_like(reference), list[float]()
    for _ in range(n_runs):
        error = reference - loop.simulate(reference + u)
        rms.append(float(np.sqrt(np.mean(error**2))))
        u = law.update(u, error)
    return rms


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return the printed condition, the lifted norms, and errors at constant temperature."""
    tell("condition 3.4 and the lifted norm")
    reference = appendix_a().position_m[:, 0]
    n_samples = REDUCED_SAMPLES if reduced else len(reference)
    n_runs = REDUCED_RUNS if reduced else N_RUNS
    loop, bare = closed_loop(1.0), PdIlc(GAIN, GAIN)
    without = analyze(bare, loop, n_samples)
    smoothed = analyze(core(), loop, min(n_samples, DENSE_SAMPLES))
    found = {
        "p1_motor": float(motor(1.0).markov(2)[1, 0, 0]),
        "p1_loop": float(loop.markov(2)[1, 0, 0]),
        "condition_3_4": without.pd_factor,
        "n_samples": n_samples,
        "lifted_norm": without.monotonic_factor,
        "spectral_contraction": float(without.contraction.max()),
        "grows_from_hz": without.critical_frequency_hz,
        "frequency_hz": without.frequency_hz.tolist(),
        "contraction": without.contraction.tolist(),
        "n_samples_with_q": smoothed.n_samples,
        "lifted_norm_with_q": smoothed.monotonic_factor,
        "frequency_with_q_hz": smoothed.frequency_hz.tolist(),
        "contraction_with_q": smoothed.contraction.tolist(),
        "rms_with_q": constant(core(), reference, n_runs),
        "rms_without_q": constant(bare, reference, n_runs),
    }
    return {"condition": found}


def claims(figures: Figures) -> list[Claim]:
    """Return the statements of section 3.2 on the gains, and those of the lifted norm."""
    found = figures["condition"]
    p1, norm, smoothed = found["p1_motor"], found["lifted_norm"], found["lifted_norm_with_q"]
    kept, lost = found["rms_with_q"], found["rms_without_q"]
    growing = f"from {found['grows_from_hz']:.1f} Hz on every run makes the error larger"
    return [
        Claim(
            "first Markov parameter of the motor",
            p1,
            1.6e-3,
            source="section 4.2.1.1",
            holds=abs(p1 - 1.6e-3) < 0.05e-3,
            remark="the plant's; the ILC signal enters the closed loop, whose first is "
            f"{found['p1_loop']:.3f}",
        ),
        Claim(
            "|1 - (kp + kd) p1| of the closed loop",
            found["condition_3_4"],
            source="Eq. 3.4",
            holds=found["condition_3_4"] < 1.0,
            remark="the condition for monotone convergence, as printed, is met",
        ),
        Claim(
            "lifted norm of PD-ILC without a Q filter",
            norm,
            source="section 3.2",
            holds=norm < 1.0,
            remark="condition 3.4 is not sufficient for monotone convergence: below 1 is needed; "
            + growing,
        ),
        Claim(
            "RMS error without a Q filter, last run over the least",
            lost[-1] / min(lost),
            source="Fig. 3.5",
            holds=lost[-1] <= min(lost),
            remark=f"it diverges over {len(lost)} runs at constant temperature",
        ),
        Claim(
            "lifted norm of PD-ILC with the Q filter",
            smoothed,
            source="section 3.2",
            remark="above 1 by what the held ends of the filter do in the last samples: away from "
            f"them a run keeps at most {max(found['contraction_with_q']):.2f} of any frequency",
        ),
        Claim(
            "RMS error with the Q filter, last run over the first",
            kept[-1] / kept[0],
            source="Fig. 3.5",
            holds=all(after <= before * (1.0 + 1e-9) for before, after in pairwise(kept)),
            remark="falls from run to run at constant temperature",
        ),
    ]


def draw(figures: Figures, figure: Figure) -> None:
    """Draw the contraction over frequency, and the errors at constant temperature."""
    found = figures["condition"]
    spectrum, runs = figure.subplots(1, 2)
    spectrum.plot(found["frequency_hz"], found["contraction"], label="without Q filter")
    spectrum.plot(found["frequency_with_q_hz"], found["contraction_with_q"], label="with Q filter")
    spectrum.axhline(1.0, color="0.7", linestyle=":")
    spectrum.set(xlabel="frequency (Hz)", ylabel="error kept from run to run")
    spectrum.legend(fontsize="small")
    runs.semilogy(found["rms_without_q"], label="without Q filter")
    runs.semilogy(found["rms_with_q"], label="with Q filter")
    runs.set(xlabel="run", ylabel="RMS error (in)", title="PD-ILC, constant temperature")
    runs.set_ylim(0.1 * min(found["rms_with_q"]), 100.0 * found["rms_with_q"][0])
    runs.legend(fontsize="small")


PICTURES = (
    Picture(
        "condition",
        "PD-ILC whose gains meet condition 3.4: without a Q filter high frequencies grow from run "
        "to run and it diverges; with one it is as in Fig. 3.5",
        draw,
    ),
)
