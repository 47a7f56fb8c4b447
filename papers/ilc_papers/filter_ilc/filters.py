"""Fig. 14, 18, 25 to 27, 40 to 42: learning without filter, with one, and with a switched one.

Only the paper's package imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.axes import errors_over_runs
from ilc_papers.filter_ilc.bench import DT_S, GAIN, REDUCED_RUNS, RUNS, Bench, motion
from ilc_papers.filter_ilc.convergence import LEADS, ORDER
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import ErrorFeedforwardIlc, signal

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ilc_papers.filter_ilc.bench import Motion

LOW_HZ, HIGH_HZ = 10.0, 50.0
#: Instantaneous frequency above which the filter opens; averaged over the window.
THRESHOLD_HZ, WINDOW_S = 0.5, 0.5
#: Allowed rise of the RMS error over its minimum so far, for the noise of one run.
NOISE_SHARE = 1.05


def low_pass() -> signal.ButterworthFilter:
    """Return the paper's off-line filter: fourth order, 10 Hz, zero-phase."""
    return signal.butterworth(ORDER, LOW_HZ, DT_S)


def switched(moves: Motion) -> signal.SwitchedFilter:
    """Return the filter that opens to 50 Hz where the motion is fast.

    References
    ----------
    [filter-ilc], Eq. (12), Fig. 26 and 27.
    """
    return signal.SwitchedFilter.from_signal(
        moves.velocity_m_s, DT_S, LOW_HZ, HIGH_HZ, THRESHOLD_HZ, order=ORDER, window_s=WINDOW_S
    )


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return RMS and largest error of each run, without filter and with either filter.

    Returns
    -------
    dict
        `unfiltered` and `zero_phase` with the paper's lead; `switched` with a lead of five
        samples, which 50 Hz needs, and inside it the same filter with the paper's lead and the
        10 Hz filter with that of five.
    """
    runs = REDUCED_RUNS if reduced else RUNS
    moves = motion()
    opening = switched(moves)
    fast = _fast(opening, moves.n_samples)
    laws = {
        "unfiltered": ErrorFeedforwardIlc(GAIN, lead_samples=LEADS[0]),
        "zero_phase": ErrorFeedforwardIlc(GAIN, low_pass(), LEADS[0]),
        "switched": ErrorFeedforwardIlc(GAIN, opening, LEADS[1]),
        "switched_lead_1": ErrorFeedforwardIlc(GAIN, opening, LEADS[0]),
        "zero_phase_lead_5": ErrorFeedforwardIlc(GAIN, low_pass(), LEADS[1]),
    }
    found: Figures = {}
    for name, law in laws.items():
        tell(f"learning, {name.replace('_', ' ')}")
        course = Bench(moves).learn(law, runs)
        found[name] = course.figures()
        left_m = course.repeatable_m()
        found[name]["fast_rmse_m"] = _rms(left_m[fast])
        found[name]["slow_rmse_m"] = _rms(left_m[~fast])
        found[name]["fast_max_m"] = float(abs(left_m[fast]).max())
    found["switched"]["segments"] = {
        "starts": opening.starts,
        "cutoffs_hz": opening.cutoffs_hz,
    }
    found["switched"]["lead_1"] = found.pop("switched_lead_1")
    found["switched"]["low_pass"] = found.pop("zero_phase_lead_5")
    shown = slice(None, None, 8)
    found["motion"] = {
        "time_s": (np.arange(moves.n_samples) * DT_S)[shown].round(6).tolist(),
        "position_m": moves.position_m[shown].round(9).tolist(),
        "velocity_m_s": moves.velocity_m_s[shown].round(9).tolist(),
    }
    return found


def _fast(opening: signal.SwitchedFilter, n_samples: int) -> NDArray[np.bool_]:
    """Return the samples at which the filter is open."""
    fast = np.zeros(n_samples, dtype=np.bool_)
    ends = [*opening.starts[1:], n_samples]
    for cutoff_hz, start, end in zip(opening.cutoffs_hz, opening.starts, ends, strict=True):
        fast[start:end] = cutoff_hz == HIGH_HZ
    return fast


def _rms(x: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(x**2)))


def falls(rmse_m: list[float]) -> bool:
    """Return True if an error falls from run to run, within the noise of one run."""
    least = np.minimum.accumulate(rmse_m)
    return bool((np.array(rmse_m[1:]) <= NOISE_SHARE * least[:-1]).all())


def claims(figures: Figures) -> list[Claim]:
    """Set the statements of sections 4 to 6 beside the results."""
    free, smooth, wide = (figures[name] for name in ("unfiltered", "zero_phase", "switched"))
    rise = int(np.argmin(free["rmse_m"])) + 1
    return [
        Claim("largest error without learning", smooth["max_m"][0], 60e-6, "m", "section 5"),
        Claim("largest error after 8 runs, 10 Hz", smooth["max_m"][8], 10e-6, "m", "Fig. 25"),
        Claim("without filter the RMS error falls, then rises", free["rmse_m"][-1], None, "m",
              "Fig. 14", holds=rise < len(free["rmse_m"]) and not falls(free["rmse_m"]),
              remark="It does so without noise too: whatever repeats above the critical frequency "
              "grows. The figure is that of the last run."),
        Claim("run from which it rises", float(rise), 22.0, "", "Fig. 14"),
        Claim("with 10 Hz it falls from run to run", smooth["rmse_m"][-1], None, "m", "Fig. 18",
              holds=falls(smooth["rmse_m"]),
              remark="Up to the noise of a single run, 5 % at the end."),
        Claim("switched 10/50/10 Hz falls from run to run", wide["rmse_m"][-1], None, "m",
              "Fig. 42", holds=falls(wide["rmse_m"]),
              remark="With a lead of five samples; with one, 50 Hz is above what can be learned."),
        Claim("switched 10/50/10 Hz with a lead of one sample", wide["lead_1"]["rmse_m"][-1], None,
              "m", "Fig. 42", holds=falls(wide["lead_1"]["rmse_m"]),
              remark="The fast stretches diverge, as the analysis says before the first run."),
        Claim("error in the fast stretches, switched over 10 Hz",
              wide["fast_rmse_m"] / wide["low_pass"]["fast_rmse_m"], None, "", "Fig. 27",
              holds=wide["fast_rmse_m"] < wide["low_pass"]["fast_rmse_m"],
              remark="Of the mean of the last ten runs, both with a lead of five samples."),
    ]  # fmt: skip


def _draw_errors(figures: Figures, figure: Figure) -> None:
    figure.set_size_inches(5.6, 4.2)
    axes = figure.subplots()
    wide = figures["switched"]
    cases = [
        (figures["unfiltered"], "#D55E00", "-", "no filter"),
        (figures["zero_phase"], "#0072B2", "-", "10 Hz zero-phase"),
        (wide["lead_1"], "#009E73", ":", "10/50/10 Hz, lead 1"),
        (wide, "#009E73", "-", "10/50/10 Hz, lead 5"),
    ]
    for case, colour, line, label in cases:
        axes.plot(np.array(case["rmse_m"]) * 1e6, line, color=colour, label=label)
    errors_over_runs(axes, "RMS error in µm")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)


def _draw_motion(figures: Figures, figure: Figure) -> None:
    figure.set_size_inches(5.6, 4.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    shown = figures["motion"]
    upper.plot(shown["time_s"], np.array(shown["position_m"]) * 1e3, color="#0072B2")
    upper.set_ylabel("position in mm")
    lower.plot(shown["time_s"], np.array(shown["velocity_m_s"]) * 1e3, color="#0072B2")
    lower.set_ylabel("velocity in mm/s")
    lower.set_xlabel("time in s; shaded: 50 Hz")
    segments = figures["switched"]["segments"]
    starts = [start * DT_S for start in segments["starts"]]
    ends = [*starts[1:], shown["time_s"][-1]]
    for cutoff_hz, start_s, end_s in zip(segments["cutoffs_hz"], starts, ends, strict=True):
        if cutoff_hz == HIGH_HZ:
            for axes in (upper, lower):
                axes.axvspan(start_s, end_s, color="#009E73", alpha=0.15, linewidth=0.0)


PICTURES = [
    Picture("filters", "RMS error against the run: without filter it falls and then rises, with "
            "10 Hz it stays down (Fig. 14, 18, 42).", _draw_errors),
    Picture("motion", "The X axis of the butterfly contour, and where the switched filter opens "
            "(Fig. 5, 6, 23, 26).", _draw_motion),
]  # fmt: skip
