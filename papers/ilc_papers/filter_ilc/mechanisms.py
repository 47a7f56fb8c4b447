"""Fig. 19, 29 to 34: stopping in time, learning from the mean of several runs, and repeatability.

Only the paper's package imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.axes import errors_over_runs
from ilc_papers.filter_ilc.bench import GAIN, NOISE_M, REDUCED_RUNS, RUNS, Bench, motion
from ilc_papers.filter_ilc.filters import falls, low_pass
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import ErrorFeedforwardIlc, Gate, Ladder, repeatability

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ilc_papers.filter_ilc.bench import Motion

    Array = NDArray[np.float64]

TOLERANCE_M = 1.5e-6
GROWTH = 1.2
#: Disturbance at the plant's input long after learning has stopped, and its first run.
_STEP, _STEP_RUN = 2e-5, 25
_STEP_SAMPLE = 625
REPEATS = 4
REPEATS_COMPARED = (1, 4, 16)
_UPDATES = 3
_CHECK_RUNS = 10


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return the results of gate, ladder and repeatability check on the motion.

    Returns
    -------
    dict
        `gate`: RMS and largest error of each run with a tolerance, and inside it `rollback`,
        stopped before the error diverges, and `resume`, learning again when the machine changes;
        `ladder`, with the noise that is learned against the number of repeats; `repeatability`.
    """
    runs = REDUCED_RUNS if reduced else RUNS
    moves = motion()
    tell("gate")
    free = ErrorFeedforwardIlc(GAIN)
    gate = _gated(moves, runs, Gate(free, tolerance=TOLERANCE_M))
    gate["tolerance_m"] = TOLERANCE_M
    gate["rollback"] = _gated(moves, runs, Gate(free, growth=GROWTH))
    smooth = ErrorFeedforwardIlc(GAIN, low_pass())
    gate["resume"] = _gated(moves, runs, Gate(smooth, tolerance=TOLERANCE_M), _step_appears(moves))
    gate["resume"]["step_run"] = _STEP_RUN
    tell("ladder")
    return {"gate": gate, "ladder": _ladder(moves, runs, tell), "repeatability": _check(moves)}


def _gated(
    moves: Motion, runs: int, gate: Gate, added: Callable[[int], Array | float] = lambda _: 0.0
) -> Figures:
    states: list[str] = []
    course = Bench(moves).learn(gate, runs, added, lambda _: states.append(gate.state))
    return course.figures() | {"states": states}


def _step_appears(moves: Motion) -> Callable[[int], Array | float]:
    step = np.where(np.arange(moves.n_samples) >= _STEP_SAMPLE, _STEP, 0.0)
    return lambda run: step if run >= _STEP_RUN else 0.0


def _ladder(moves: Motion, runs: int, tell: Tell) -> Figures:
    gains: list[float] = []
    law = Ladder(ErrorFeedforwardIlc(GAIN), REPEATS)
    course = Bench(moves).learn(law, runs, observe=lambda _: gains.append(law.gain))
    figures: Figures = course.figures()
    figures |= {"repeats": REPEATS, "gain": gains, "noise_rms_m": law.noise_rms}
    learned = []
    for repeats in REPEATS_COMPARED:
        tell(f"ladder, {repeats} repeats")
        learned.append(_learned_noise(moves, repeats))
    figures["learned_noise"] = {"repeats": list(REPEATS_COMPARED), "noise_rms": learned}
    return figures


def _learned_noise(moves: Motion, repeats: int) -> float:
    """Return the share of noise in the learned signal after a few updates.

    The same runs without noise are subtracted, so that only noise remains.
    """

    def learn(noise_m: float) -> Array:
        # An increase of 1: the gain must not depend on the noise here.
        law = Ladder(ErrorFeedforwardIlc(GAIN, low_pass()), repeats, increase=1.0)
        return Bench(moves, noise_m=noise_m).learn(law, repeats * _UPDATES + 1).inputs[-1]

    return float(np.std(learn(NOISE_M) - learn(0.0)))


def _check(moves: Motion) -> Figures:
    """Return the repeatability of the error without learning, over ten runs."""
    bench = Bench(moves)
    errors = np.array([bench.run(np.zeros(moves.n_samples)) for _ in range(_CHECK_RUNS)])
    found = repeatability(errors)
    return {
        "runs": _CHECK_RUNS,
        "mean_rms_m": found.mean_rms,
        "spread_rms_m": found.spread_rms,
        "ratio": found.ratio,
        "learnable": found.learnable,
        "least_rms_m": found.least_rms,
        "largest_rms_m": found.largest_rms,
    }


def claims(figures: Figures) -> list[Claim]:
    """Set the statements on mechanisms beside the results."""
    gate, ladder, check = figures["gate"], figures["ladder"], figures["repeatability"]
    hold = gate["states"].index("holding") + 1
    held = np.array(gate["rmse_m"][hold:])
    back = gate["rollback"]
    resumed = gate["resume"]
    noise = np.array(ladder["learned_noise"]["noise_rms"])
    repeats = np.array(ladder["learned_noise"]["repeats"])
    expected = noise[0] / np.sqrt(repeats)
    return [
        Claim("stopped inside the tolerance, the error holds its level",
              float(held.max() / held.min()), None, "", "Fig. 19, section 6.3",
              holds=bool(held.max() < gate["tolerance_m"] * 1.05 and held.max() < 1.1 * held.min()),
              remark="Without filter. The figure is the largest RMS error after the stop over the "
              "smallest."),
        Claim("stopped before it diverges, the error stays near its best",
              back["rmse_m"][-1] / min(back["rmse_m"]), None, "", "section 4",
              holds=back["states"][-1] == "rolled_back"
              and back["rmse_m"][-1] < GROWTH * min(back["rmse_m"]),
              remark="Here the best input comes back by itself; in the paper an operator judges."),
        Claim("learning resumes when the machine changes, and stops again",
              resumed["rmse_m"][-1], None, "m", "Fig. 19",
              holds=resumed["states"][_STEP_RUN - 1] == "holding"
              and "learning" in resumed["states"][_STEP_RUN:]
              and resumed["states"][-1] == "holding"),
        Claim("learned noise, 16 repeats over one", float(noise[-1] / noise[0]),
              None, "", "section 6.2",
              holds=bool((abs(noise / expected - 1.0) < 0.15).all()),
              remark="A mean of n runs leaves 1/sqrt(n) of white noise: 0.25. The paper prints no "
              "figure."),
        Claim("with a ladder the error falls", ladder["rmse_m"][-1], None, "m", "Fig. 33",
              holds=falls(ladder["rmse_m"])),
        Claim("RMS error of ten runs without learning varies by",
              check["largest_rms_m"] - check["least_rms_m"], 0.3e-6, "m", "Fig. 29, 30",
              holds=check["largest_rms_m"] - check["least_rms_m"] <= 0.3e-6,
              remark="On a machine in the paper; here noise of 0.3 µm alone."),
        Claim("share of the error that repeats", check["learnable"], None, "", "section 6.1",
              holds=check["learnable"] > 0.99),
    ]  # fmt: skip


def _draw_gate(figures: Figures, figure: Figure) -> None:
    axes = figure.subplots()
    gate = figures["gate"]
    cases = [
        (figures["unfiltered"], "#9AA0A8", "no gate, no filter"),
        (gate, "#0072B2", "kept inside the tolerance"),
        (gate["rollback"], "#009E73", "back to the best"),
        (gate["resume"], "#D55E00", "10 Hz; a step appears"),
    ]
    for case, colour, label in cases:
        axes.plot(np.array(case["rmse_m"]) * 1e6, color=colour, label=label)
    axes.axhline(gate["tolerance_m"] * 1e6, color="black", linewidth=0.8, linestyle="--")
    errors_over_runs(axes, "RMS error in µm")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)


def _draw_ladder(figures: Figures, figure: Figure) -> None:
    left, right = figure.subplots(1, 2)
    left.plot(np.array(figures["ladder"]["rmse_m"]) * 1e6, color="#0072B2")
    errors_over_runs(left, "RMS error in µm")
    learned = figures["ladder"]["learned_noise"]
    repeats, noise = np.array(learned["repeats"]), np.array(learned["noise_rms"])
    right.loglog(repeats, noise / noise[0], "o", color="#0072B2", label="found")
    right.loglog(repeats, repeats**-0.5, color="#9AA0A8", label="1/√n")
    right.set_xlabel("repeats n before an update")
    right.set_ylabel("learned noise, over that of n = 1")
    right.legend()


PICTURES = [
    Picture("gate", "RMS error with the switching mechanism: kept, taken back, resumed (Fig. 19).",
            _draw_gate),
    Picture("ladder", "Four repeats before each update, and the noise that is learned (Fig. 32 to "
            "34).", _draw_ladder),
]  # fmt: skip
