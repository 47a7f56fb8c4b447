"""Fig. 7, 8 and 10 to 13: repeating disturbance, velocity feed-forward, and saturation.

Only the paper's package imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.axes import errors_over_runs
from ilc_papers.filter_ilc.bench import (
    DT_S,
    GAIN,
    REDUCED_RUNS,
    RUNS,
    Bench,
    Course,
    Motion,
    motion,
)
from ilc_papers.filter_ilc.convergence import LEADS, ORDER
from ilc_papers.filter_ilc.filters import HIGH_HZ, low_pass
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import ErrorFeedforwardIlc, signal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The disturbance at the plant's input, 1.25 s into the run; its size is not printed.
DISTURBANCE, DISTURBANCE_S = 2e-4, 1.25
#: It starts when learning has settled.
DISTURBANCE_RUN = 15
PRINTED_RUNS = 39
#: The drive's limit, relative to the demand of the motion.
LIMIT_SHARE = 1.2
#: Enough runs for the growth to reach it.
_SATURATION_RUNS = 100


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return RMS and largest error of each run in the three cases.

    Returns
    -------
    dict
        `disturbance`, `feedforward`, and `saturation` with the largest learned signal of each
        run, bounded and not.
    """
    moves = motion()
    tell("repetitive disturbance")
    found: Figures = {"disturbance": _disturbed(moves)}
    tell("velocity feed-forward")
    found["feedforward"] = _fed_forward(moves, REDUCED_RUNS if reduced else RUNS)
    tell("saturation")
    found["saturation"] = _saturated(moves, 75 if reduced else _SATURATION_RUNS)
    return found


def _disturbed(moves: Motion) -> Figures:
    begins = round(DISTURBANCE_S / DT_S)
    step = np.where(np.arange(moves.n_samples) >= begins, DISTURBANCE, 0.0)

    def learn(law: ErrorFeedforwardIlc) -> Course:
        runs = DISTURBANCE_RUN + PRINTED_RUNS + 1
        return Bench(moves).learn(law, runs, lambda run: step if run >= DISTURBANCE_RUN else 0.0)

    # A step holds more than 10 Hz passes; with the longer lead 50 Hz is possible.
    wide = signal.butterworth(ORDER, HIGH_HZ, DT_S)
    course = learn(ErrorFeedforwardIlc(GAIN, wide, LEADS[1]))
    shown = slice(begins - 250, begins + 500)
    after = course.errors_m[DISTURBANCE_RUN:]
    return course.figures() | {
        "first_run": DISTURBANCE_RUN,
        "low_pass": learn(ErrorFeedforwardIlc(GAIN, low_pass())).figures(),
        "around": {
            "time_s": (np.arange(moves.n_samples) * DT_S)[shown].round(6).tolist(),
            **{f"run_{run}_m": after[run][shown].round(10).tolist() for run in (0, 2, 5, 39)},
        },
    }


def _fed_forward(moves: Motion, runs: int) -> Figures:
    """Return errors with the velocity fed forward through the plant's own gain."""
    # Of G (1 - z^-1) / T at z = 1: speed for each unit of the controller's output.
    speed_gain = float((0.00475 * 2.0) / (1.0 - 0.85) / DT_S)
    fed = moves.velocity_m_s / speed_gain
    course = Bench(moves).learn(ErrorFeedforwardIlc(GAIN, low_pass()), runs, lambda _: fed)
    without = Bench(moves).run(np.zeros(moves.n_samples))
    return course.figures() | {
        "without_rmse_m": float(np.sqrt(np.mean(without**2))),
        "without_max_m": float(abs(without).max()),
    }


def _saturated(moves: Motion, runs: int) -> Figures:
    """Return the demand of learning without a filter on the drive, with and without saturation."""
    needed = float(abs(Bench(moves).learn(ErrorFeedforwardIlc(GAIN), 12).inputs[-1]).max())
    limit = LIMIT_SHARE * needed
    free = Bench(moves).learn(ErrorFeedforwardIlc(GAIN), runs)
    guard = ErrorFeedforwardIlc(GAIN, input_max=limit)
    limited: list[int] = []
    guarded = Bench(moves).learn(guard, runs, observe=lambda _: limited.append(guard.n_limited))
    return {
        "limit": limit,
        "unguarded_input_max": [float(abs(w).max()) for w in free.inputs],
        "input_max": [float(abs(w).max()) for w in guarded.inputs],
        "limited_samples": limited,
        **guarded.figures(),
    }


def claims(figures: Figures) -> list[Claim]:
    """Set the statements of sections 3 and 4 beside the results."""
    disturbed, fed, saturated = (
        figures[name] for name in ("disturbance", "feedforward", "saturation")
    )
    after, largest = (disturbed[name][DISTURBANCE_RUN:] for name in ("rmse_m", "max_m"))
    return [
        Claim("RMS error 39 runs after the disturbance came", after[PRINTED_RUNS], 10e-6, "m",
              "Fig. 11", holds=after[PRINTED_RUNS] < 10e-6,
              remark="The size of the disturbance is not printed; here it moves the axis by "
              "0.1 mm."),
        Claim("largest error 39 runs after the disturbance came", largest[PRINTED_RUNS], 5e-6, "m",
              "Fig. 13", holds=largest[PRINTED_RUNS] < 5e-6,
              remark="With 50 Hz and a lead of five samples; 10 Hz and one leave "
              f"{disturbed['low_pass']['max_m'][-1] * 1e6:.0f} µm, as a step holds more than "
              "10 Hz."),
        Claim("the disturbance is learned away", after[PRINTED_RUNS] / after[0], None, "",
              "Fig. 11 to 13", holds=after[PRINTED_RUNS] < 0.1 * after[0],
              remark="The figure is the RMS error over that of its first run."),
        Claim("largest error without feed-forward", fed["without_max_m"], 60e-6, "m", "Fig. 7"),
        Claim("largest error with velocity feed-forward", fed["max_m"][0], 18e-6, "m", "Fig. 8",
              holds=fed["max_m"][0] < 0.5 * fed["without_max_m"],
              remark="Here the feed-forward is exact; what is left is the acceleration's."),
        Claim("learning improves on feed-forward", fed["rmse_m"][-1] / fed["rmse_m"][0], None, "",
              "section 3", holds=fed["rmse_m"][-1] < fed["rmse_m"][0]),
        Claim("without filter the learned signal grows over the drive's limit",
              saturated["unguarded_input_max"][-1] / saturated["limit"], None, "", "section 4",
              holds=saturated["unguarded_input_max"][-1] > saturated["limit"]),
        Claim("the guard holds the limit", max(saturated["input_max"]) / saturated["limit"], None,
              "", "section 4", holds=max(saturated["input_max"]) <= saturated["limit"],
              remark="Learning goes on within it; the paper's drive raised an alarm."),
    ]  # fmt: skip


def _draw_disturbance(figures: Figures, figure: Figure) -> None:
    figure.set_size_inches(5.6, 5.0)
    upper, lower = figure.subplots(2, 1)
    disturbed = figures["disturbance"]
    upper.plot(np.array(disturbed["max_m"]) * 1e6, color="#0072B2", label="50 Hz, lead 5")
    smooth_um = np.array(disturbed["low_pass"]["max_m"]) * 1e6
    upper.plot(smooth_um, color="#9AA0A8", label="10 Hz, lead 1")
    upper.legend()
    upper.axvline(disturbed["first_run"], color="#9AA0A8", linestyle="--", linewidth=1.0)
    errors_over_runs(upper, "max error in µm")
    around = disturbed["around"]
    for run, colour in ((0, "#D55E00"), (2, "#CC79A7"), (5, "#009E73"), (39, "#0072B2")):
        lower.plot(around["time_s"], np.array(around[f"run_{run}_m"]) * 1e6, color=colour,
                   linewidth=1.2, label=f"{run} runs after it came")  # fmt: skip
    lower.set_xlabel("time in s")
    lower.set_ylabel("error in µm")
    lower.set_ylim(bottom=-190.0)
    lower.legend(loc="lower right", ncols=2)


def _draw_saturation(figures: Figures, figure: Figure) -> None:
    axes = figure.subplots()
    saturated = figures["saturation"]
    limit = saturated["limit"]
    axes.plot(np.array(saturated["unguarded_input_max"]) / limit, color="#D55E00", label="no guard")
    axes.plot(np.array(saturated["input_max"]) / limit, color="#0072B2", label="guard")
    axes.set_xlabel("run (0 is without learning)")
    axes.set_ylabel("largest learned signal over the limit")
    axes.legend()


PICTURES = [
    Picture("disturbance", "A repetitive disturbance that comes when learning has settled "
            "(dashed), and the error around it (Fig. 11 to 13).", _draw_disturbance),
    Picture("saturation", "What learning without a filter asks of the drive.", _draw_saturation),
]  # fmt: skip
