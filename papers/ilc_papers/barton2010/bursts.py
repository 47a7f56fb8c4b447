"""Section 5.6: a time-varying weight R where bursts of noise disturb part of the run.

The paper's package makes its section `bursts` with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.barton2010.positioning import DT_S, stage
from ilc_papers.barton2010.raster import raster_m
from ilc_papers.barton2010.runs import rms
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import NormOptimalIlc, weights

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Samples of a run and weight of the input, section 5.6.3.
N_SAMPLES = 1200
S = 0.5
BANDWIDTH_HZ = 15.0
#: Low and high weight of the change of input; the print shows them only in graphs.
LOW, HIGH = 2e-2, 20.0
#: Four bursts, first sample and one past the last, and their standard deviation; chosen.
BURSTS = ((180, 240), (420, 480), (680, 740), (920, 980))
NOISE_STD_M = 5e-6
#: Runs, and the last ones, whose errors count as converged.
ITERATIONS, CONVERGED = 60, 30
WIDTH_M, PITCH_M = 0.0088, 0.004


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return RMS errors per run with low, high and time-varying weight of the change of input.

    `contour_rms_m` has the noise of the run itself. `past_noise_m`: RMS over the converged runs
    of what earlier noise does to the error, by way of the learned input. `settled_at`: first run
    whose linearised contour error, without noise, is within 10 % of the last one's.

    References
    ----------
    Barton 2010, eq. (3.23), (5.4), figures 5.15 to 5.17.
    """
    tell("bursts: time-varying R")
    iterations, converged = (24, 12) if reduced else (ITERATIONS, CONVERGED)
    table = stage(raster_m(WIDTH_M, PITCH_M, N_SAMPLES))
    gate = np.zeros((N_SAMPLES, 1))
    parts = [(0, LOW)]
    for begin, end in BURSTS:
        gate[begin:end] = NOISE_STD_M
        parts += [(begin, HIGH), (end, LOW)]
    noise = gate * np.random.default_rng(5).normal(size=(iterations + 1, N_SAMPLES, 2))
    sigma = weights.schedule(parts, N_SAMPLES, BANDWIDTH_HZ, DT_S)
    figures: Figures = {
        "low": LOW,
        "high": HIGH,
        "noise_std_m": NOISE_STD_M,
        "bursts": [list(burst) for burst in BURSTS],
        "sigma": np.round(sigma, 6).tolist(),
    }
    for name, r in (("low_r", LOW), ("high_r", HIGH), ("time_varying", sigma)):
        law = NormOptimalIlc.contour(table.plant, table.reference_m, q=0.0, contour=1.0, s=S, r=r)
        figures[name], errors_m = table.learn(law, iterations, disturbance=noise.__getitem__)
        quiet, _ = table.learn(law, iterations)
        figures[name]["undisturbed_rms_m"] = quiet["linearised_rms_m"]
        figures[name]["settled_at"] = _settled_at(quiet["linearised_rms_m"])
        last = np.array([
            table.linearised_m(error_m + drawn)
            for error_m, drawn in zip(errors_m[-converged:], noise[-converged:], strict=True)
        ])  # fmt: skip
        figures[name]["past_noise_m"] = rms(last - last.mean(axis=0))
        converged_m = figures[name]["linearised_rms_m"][-converged:]
        figures[name]["converged_rms_m"] = float(np.mean(converged_m))
        figures[name]["spread_of_rms_m"] = float(np.std(converged_m))
    figures["feedback"], _ = table.learn(None, iterations, disturbance=noise.__getitem__)
    # Of the two constant weights, the one that learns as fast as the varying one.
    figures["time_invariant"] = figures["low_r"]
    return figures


def _settled_at(errors: list[float]) -> int:
    return next(run for run, error in enumerate(errors) if error <= 1.1 * errors[-1])


def claims(figures: Figures) -> list[Claim]:
    """Compare section 5.6 with the print."""
    low, high, varying = (figures[name] for name in ("low_r", "high_r", "time_varying"))
    return [
        Claim(
            "earlier noise in the error, time-varying over low r",
            varying["past_noise_m"] / low["past_noise_m"], source="figure 5.17",
            holds=varying["past_noise_m"] < low["past_noise_m"],
            remark="weights and bursts are printed in graphs alone; chosen here: r = "
            f"{figures['low']:g} and {figures['high']:g}, four bursts of "
            f"{1e6 * figures['noise_std_m']:g} µm",
        ),
        Claim(
            "converged RMS contour error, time-varying over low r",
            varying["converged_rms_m"] / low["converged_rms_m"], source="figure 5.17",
            holds=varying["converged_rms_m"] < low["converged_rms_m"],
            remark="most of it is the noise of the run itself, which no weight changes",
        ),
        Claim(
            "spread of the RMS error from run to run, time-varying over low r",
            varying["spread_of_rms_m"] / low["spread_of_rms_m"], source="figure 5.17",
            remark="the variance that the figure prints; that of the run's own noise hides the "
            "difference, and other draws of it give 0.8 to 1.1",
        ),
        Claim(
            "runs until settled, time-varying over high r",
            varying["settled_at"] / high["settled_at"], source="figure 5.17",
            holds=varying["settled_at"] < high["settled_at"],
            remark=f"{varying['settled_at']} runs against {high['settled_at']}, and "
            f"{low['settled_at']} with low r",
        ),
        Claim(
            "earlier noise in the error, time-varying over high r",
            varying["past_noise_m"] / high["past_noise_m"], source="figure 5.17",
            remark="high r keeps out the most, and learns the slowest",
        ),
    ]  # fmt: skip


def _draw(figures: Figures, figure: Figure) -> None:
    section = figures["bursts"]
    left, right = figure.subplots(1, 2)
    for name, style in (("low_r", ":"), ("high_r", "--"), ("time_varying", "-")):
        each = section[name]
        (line,) = left.semilogy(
            1e6 * np.array(each["linearised_rms_m"]), style, label=name.replace("_", " ")
        )
        left.semilogy(
            1e6 * np.array(each["undisturbed_rms_m"]), style, color=line.get_color(), linewidth=0.8
        )
    left.set_xlabel("run")
    left.set_ylabel("RMS contour error in µm, thin: without noise")
    left.legend()
    time_s = DT_S * np.arange(len(section["sigma"]))
    right.plot(time_s, section["sigma"], label="weight r")
    for begin, end in section["bursts"]:
        right.axvspan(DT_S * begin, DT_S * end, color="#DADDE2")
    right.set_xlabel("time in s")
    right.set_ylabel("weight of the change of input")


PICTURES = [
    Picture(
        "bursts",
        "Errors under four bursts of noise, and the weight; bursts shaded (figures 5.16, 5.17).",
        _draw,
    )
]
