"""Fig. 2 and 3 of Haas et al.: two positioning moves, learned by CO-ILC and by PD-ILC.

The paper prints no sample time; three are shown. The paper's package imports it, and the bounded
moves take their axis and program from here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.axes import errors_over_runs
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import NormOptimalIlc, PdIlc, StateSpace, analyze, discretize, second_order, signal
from ilc_rt.trajectory import jerk_limited

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ilc_rt import Law

    Array = NDArray[np.float64]

SAMPLE_TIMES_S = {"1ms": 0.001, "2ms": 0.002, "4ms": 0.004}
RUNS = 50
RATE = 3.0
KP, KD = 1.0, 3.25
CUTOFF_HZ = 50.0
_BEFORE_S, _BETWEEN_S, _ALL_S = 0.1, 0.2, 1.7

COLOURS = {"co": "#0072B2", "pd_zero_phase": "#D55E00", "pd_causal": "#9AA0A8"}
LABELS = {"co": "CO-ILC", "pd_zero_phase": "PD-ILC, zero-phase Q", "pd_causal": "PD-ILC, causal Q"}


def axis(dt_s: float) -> StateSpace:
    """Return the closed position loop, sampled.

    ``G(s) = w0^2 / (s^2 + 2 w0 delta s + w0^2)``, w0 = 157 rad/s, delta = 0.5.

    References
    ----------
    [haas2016], Eq. (13).
    """
    return discretize(second_order(157.0, 0.5), dt_s)


def program(dt_s: float) -> Array:
    """Return the set points in m: 0 to 100 to 50 mm, shape (n_samples,).

    The speeds, 0.2 and 0.1 m/s, are the paper's; acceleration (2 m/s²), jerk (50 m/s³) and the
    rests are not printed.

    References
    ----------
    [haas2016], Fig. 2.
    """

    def move(start_m: float, end_m: float, feed_m_s: float) -> Array:
        moved = jerk_limited(
            [[start_m], [end_m]], feed_m_s=feed_m_s, dt_s=dt_s, velocity_max_m_s=0.2,
            acceleration_max_m_s2=2.0, jerk_max_m_s3=50.0,
        )  # fmt: skip
        return moved.position_m[:, 0]

    out, back = move(0.0, 0.1, 0.2), move(0.1, 0.05, 0.1)
    before, between = np.zeros(round(_BEFORE_S / dt_s)), np.full(round(_BETWEEN_S / dt_s), 0.1)
    moves = np.concatenate([before, out, between, back])
    return np.concatenate([moves, np.full(round(_ALL_S / dt_s) + 1 - len(moves), 0.05)])


def set_points(reference_m: Array) -> Array:
    """Return the command at each sample: the reference of the next one.

    Eq. (3) pairs the input of a sample with the output of the next, and eq. (1) feeds input and
    reference through the same operator.
    """
    return np.append(reference_m[1:], reference_m[-1])


def laws(dt_s: float, n_samples: int) -> dict[str, Law]:
    """Return the laws that Fig. 3 compares, and PD-ILC with a causal filter.

    References
    ----------
    [haas2016], Eq. (4) with kp = 1, kd = 3.25 and 50 Hz; Eq. (5) to (12) with d = 3.
    """
    low_pass = signal.butterworth(2, CUTOFF_HZ, dt_s)
    causal = signal.butterworth(2, CUTOFF_HZ, dt_s, causal=True)
    return {
        "co": NormOptimalIlc(axis(dt_s), n_samples, rate=RATE),
        "pd_zero_phase": PdIlc(KP, KD, low_pass),
        "pd_causal": PdIlc(KP, KD, causal),
    }


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return the error of each law in each run, and the analysis of the laws.

    Returns
    -------
    dict
        Under `positioning` for each sample time `<law>_inf_m`, 51 values, and `analysis`; under
        `program` the set points.
    """
    runs: Figures = {}
    for name, dt_s in SAMPLE_TIMES_S.items():
        tell(f"positioning at {dt_s * 1e3:g} ms")
        reference_m = program(dt_s)
        runs[name] = {
            f"{law}_inf_m": _learn(each, dt_s, reference_m)
            for law, each in laws(dt_s, len(reference_m)).items()
        }
        if not reduced:
            runs[name]["analysis"] = _analyse(dt_s, len(reference_m))
    dt_s = SAMPLE_TIMES_S["2ms"]
    reference_m = program(dt_s)
    shown = {
        "time_s": (np.arange(len(reference_m)) * dt_s).round(6).tolist()[::4],
        "reference_m": reference_m.round(9).tolist()[::4],
    }
    return {"positioning": runs, "program": shown}


def _learn(law: Law, dt_s: float, reference_m: Array) -> list[float]:
    """Return the infinity norm of the error of each run, run 0 being without learning."""
    model, out = axis(dt_s), set_points(reference_m)
    u, errors = np.zeros_like(reference_m), []
    for _ in range(RUNS + 1):
        e = reference_m - model.simulate(out + u)
        errors.append(float(abs(e).max()))
        u = law.update(u, e)
    return errors


def _analyse(dt_s: float, n_samples: int) -> Figures:
    found = {}
    for name, law in laws(dt_s, n_samples).items():
        told = analyze(law, axis(dt_s), n_samples)
        found[name] = {
            "converges": told.converges,
            "spectral_radius": told.spectral_radius,
            "transient_growth": told.transient_growth,
            "contraction_max": float(told.contraction.max()),
            "critical_frequency_hz": told.critical_frequency_hz,
        }
    return found


def claims(figures: Figures) -> list[Claim]:
    """Set the statements of section 3.1 beside the results."""
    runs = figures["positioning"]
    co = {name: np.array(run["co_inf_m"]) for name, run in runs.items()}
    pd = {name: np.array(run["pd_zero_phase_inf_m"]) for name, run in runs.items()}
    causal = {name: np.array(run["pd_causal_inf_m"]) for name, run in runs.items()}
    at = co["2ms"], pd["2ms"]
    below = all((co[name][1:] < np.minimum(pd[name], causal[name])[1:]).all() for name in runs)
    stalls = causal["2ms"].argmin() < RUNS // 2 and causal["2ms"][-1] > 1.5 * causal["2ms"].min()
    return [
        Claim("both laws reduce the error, 2 ms", None, source="section 3.1",
              holds=bool(max(at[0][-1], at[1][-1]) < 0.01 * at[0][0])),
        Claim("CO-ILC reduces it more than PD-ILC, in every run, at 1, 2 and 4 ms", None,
              source="Fig. 3", holds=bool(below)),
        Claim("CO-ILC falls in every run, at 1, 2 and 4 ms", None, source="Fig. 3",
              holds=all(bool((np.diff(each) < 0.0).all()) for each in co.values())),
        Claim("error without learning, 2 ms", float(at[0][0]), None, "m", "Fig. 3"),
        Claim("CO-ILC after 50 runs, 2 ms", float(at[0][-1]), None, "m", "Fig. 3"),
        Claim("PD-ILC after 50 runs, 2 ms", float(at[1][-1]), None, "m", "Fig. 3"),
        Claim("PD-ILC is stable, 2 ms", float(at[1][-1] / at[1].min()), None, "", "section 3.1",
              holds=bool(at[1][-1] < 2.0 * at[1].min()),
              remark="The figure is the last error over the smallest. The paper tuned kd to be "
              "stable but prints no sample time; kd = 3.25 is at the limit near 2 ms."),
        Claim("PD-ILC is stable, 4 ms", float(pd["4ms"][-1] / pd["4ms"].min()), None, "",
              "section 3.1", holds=bool(pd["4ms"][-1] < 2.0 * pd["4ms"].min()),
              remark="It diverges: the derivative is taken over a longer sample, so that kd = 3.25 "
              "is too much. The paper's sample time must have been shorter."),
        Claim("a causal Q stalls and then grows, 2 ms", float(causal["2ms"].min()), None, "m",
              "section 1", holds=bool(stalls),
              remark="The figure is the smallest error. The paper says Butterworth, not whether "
              "it was applied without lag."),
    ]  # fmt: skip


def _draw_program(figures: Figures, figure: Figure) -> None:
    shown = figures["program"]
    axes = figure.subplots()
    axes.plot(shown["time_s"], np.array(shown["reference_m"]) * 1e3)
    axes.set_xlabel("time in s")
    axes.set_ylabel("set point in mm")


def _draw_errors(figures: Figures, figure: Figure) -> None:
    figure.set_size_inches(5.6, 6.4)
    grid = figure.subplots(len(SAMPLE_TIMES_S), 1, sharex=True)
    for axes, (name, dt_s) in zip(grid, SAMPLE_TIMES_S.items(), strict=True):
        for law, colour in COLOURS.items():
            error_um = np.array(figures["positioning"][name][f"{law}_inf_m"]) * 1e6
            axes.plot(error_um, color=colour, label=LABELS[law])
        axes.set_title(f"{dt_s * 1e3:g} ms")
        errors_over_runs(axes, "max error in µm", runs=axes is grid[-1])
        axes.set_ylim(0.05, 5e3)
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)


PICTURES = [
    Picture("errors", "Largest tracking error of the positioning moves against the run, at three "
            "sample times (Fig. 3).", _draw_errors),
    Picture("program", "The two positioning moves (Fig. 2).", _draw_program),
]  # fmt: skip
