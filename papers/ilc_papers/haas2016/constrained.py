"""Future work of Haas et al.: constraints on the set points, while learning.

Each bound is tried inactive, where the results must equal those without it, and active. Only the
paper's package imports it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_papers.axes import errors_over_runs
from ilc_papers.haas2016.positioning import RATE, SAMPLE_TIMES_S, axis, program, set_points
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import ConstrainedIlc, NormOptimalIlc

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ilc_rt import Law

    Array = NDArray[np.float64]

DT_S = SAMPLE_TIMES_S["2ms"]
RUNS = 12
#: Relative excess over a bound that `ConstrainedIlc` permits.
SLACK = 1e-9
#: Allowed difference between interior point and sweep, relative to the first error.
SAME = 1e-6
#: A bound counts as reached where less than this part of its span is left.
_TOUCH = 1e-6


@dataclass(frozen=True)
class _Bound:
    option: str
    unit: str
    #: Bounds that become active: a part of the unconstrained input, or the limits of the program.
    share: float | None = None
    least: float | None = None
    largest: float | None = None


BOUNDS = {
    "input": _Bound("input_max", "m", share=0.6),
    "change": _Bound("change_max", "m", share=0.6),
    "step": _Bound("step_max", "m", share=0.6),
    "position": _Bound("position_bounds", "m", least=0.0, largest=0.1),
    "velocity": _Bound("velocity_bounds", "m/s", least=-0.1, largest=0.2),
    "acceleration": _Bound("acceleration_bounds", "m/s²", least=-2.0, largest=2.0),
    "output": _Bound("output_bounds", "m", least=0.0, largest=0.0999),
}


@dataclass
class _Course:
    """The runs of one campaign: errors, and the range of each bounded signal."""

    error_inf_m: list[float]
    least: dict[str, float]
    largest: dict[str, float]
    solved: bool
    last: dict[str, Array]


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return, for each bound, the result of learning with it active and inactive.

    Returns
    -------
    dict
        Under `constrained`: `free` without bounds; for each bound and for `all` of them together
        `active` and `inactive`: the bound, the range of the runs, `violation` (largest excess), and
        `co_inf_m` for each run.
    """
    runs = 6 if reduced else RUNS
    tell("positioning within bounds: none")
    free = _learn({}, runs)
    active = {name: _limits(name, free) for name in BOUNDS}
    wide = {name: _wide(name, free) for name in BOUNDS}
    figures: Figures = {"free": {"co_inf_m": free.error_inf_m}}
    for name, bound in BOUNDS.items():
        tell(f"positioning within bounds: {name}")
        figures[name] = {"unit": bound.unit}
        for which, limits in (("active", active), ("inactive", wide)):
            course = _learn({name: limits[name]}, runs)
            figures[name][which] = _held(name, limits[name], course) | _told(course, free)
    tell("positioning within bounds: all of them")
    figures["all"] = {}
    for which, limits in (("active", active), ("inactive", wide)):
        course = _learn(limits, runs)
        held = {name: _held(name, limits[name], course) for name in BOUNDS}
        figures["all"][which] = {"bounds": held} | _told(course, free)
    time_s = (np.arange(len(free.last["step"])) * DT_S).round(6).tolist()
    limited = _learn({"step": active["step"]}, runs)
    shown = {"time_s": time_s, "limit_m": active["step"][1]}
    for name, course in (("free", free), ("bounded", limited)):
        shown[f"{name}_step_m"] = course.last["step"].round(12).tolist()
        shown[f"{name}_error_m"] = course.last["error"].round(12).tolist()
    return {"constrained": figures, "step_limit": shown}


def _wide(name: str, free: _Course) -> tuple[float, float]:
    """Return a bound that stays inactive in learning without it."""
    span = free.largest[name] - free.least[name]
    return free.least[name] - 0.5 * span, free.largest[name] + 0.5 * span


def _limits(name: str, free: _Course) -> tuple[float, float]:
    """Return an active bound of a quantity."""
    bound = BOUNDS[name]
    if bound.least is not None and bound.largest is not None:
        return bound.least, bound.largest
    assert bound.share is not None
    return bound.share * free.least[name], bound.share * free.largest[name]


def _learn(limits: dict[str, tuple[float, float]], runs: int) -> _Course:
    """Learn the positioning moves within bounds, and measure the bounded quantities."""
    reference_m, model = program(DT_S), axis(DT_S)
    out = set_points(reference_m)
    bounds: dict[str, Any] = {BOUNDS[name].option: limit for name, limit in limits.items()}
    law: Law
    if bounds:
        law = ConstrainedIlc(model, len(out), rate=RATE, reference=out,
                             output_reference=reference_m, **bounds)  # fmt: skip
    else:
        law = NormOptimalIlc(model, len(out), rate=RATE)
    u = before = np.zeros_like(reference_m)
    course = _Course([], {}, {}, solved=True, last={})
    for run in range(runs + 1):
        output = model.simulate(out + u)
        e = reference_m - output
        course.error_inf_m.append(float(abs(e).max()))
        if run > 0:  # what learning asked for; the first run is without it
            course.last = _signals(u, before, out, output) | {"error": e}
            for name in BOUNDS:
                now = course.last[name]
                course.least[name] = min(course.least.get(name, np.inf), float(now.min()))
                course.largest[name] = max(course.largest.get(name, -np.inf), float(now.max()))
        if run < runs:
            before, u = u, law.update(u, e)
            course.solved &= getattr(law, "status", "solved") == "solved"
    return course


def _signals(u: Array, before: Array, out: Array, output: Array) -> dict[str, Array]:
    """Return what each bound is about, from signals alone."""
    commanded = out + u
    velocity = np.diff(commanded, prepend=out[0]) / DT_S
    return {
        "input": u,
        "change": u - before,
        "step": np.diff(u, prepend=0.0),
        "position": commanded,
        "velocity": velocity,
        "acceleration": np.diff(velocity, prepend=0.0) / DT_S,
        "output": output,
    }


def _held(name: str, limits: tuple[float, float], course: _Course) -> Figures:
    """Return a bound, the range of the runs, and their largest excess over the bound."""
    least, largest = limits
    over = max(least - course.least[name], course.largest[name] - largest)
    return {
        "least": least,
        "largest": largest,
        "reached_least": course.least[name],
        "reached_largest": course.largest[name],
        "bound_reached": over > -_TOUCH * (largest - least),
        "violation": max(over, 0.0),
        "violation_share": max(over, 0.0) / max(abs(least), abs(largest)),
    }


def _told(course: _Course, free: _Course) -> Figures:
    away = np.abs(np.subtract(course.error_inf_m, free.error_inf_m)).max()
    return {
        "solved": course.solved,
        "co_inf_m": course.error_inf_m,
        "differs_from_free_m": float(away),
    }


def claims(figures: Figures) -> list[Claim]:
    """State for each bound if it is held, and its cost."""
    told = figures["constrained"]
    names = [*BOUNDS, "all"]
    cases = [told[name][which] for name in names for which in ("active", "inactive")]
    each = [held for case in cases for held in case.get("bounds", {"": case}).values()]
    worst = max(held["violation_share"] for held in each)
    away = max(told[name]["inactive"]["differs_from_free_m"] for name in names)
    start = told["free"]["co_inf_m"][0]
    held = [
        Claim("bounds on set points, inputs and outputs are held", worst, None, "", "section 4",
              holds=worst <= SLACK and all(case["solved"] for case in cases),
              remark="Future work in the paper. The figure is the largest excess of any run as a "
              "part of the bound, measured on the signals."),
        Claim("a bound that is not reached changes nothing", away, None, "m", "section 4",
              holds=away < SAME * start),
        Claim("error without bounds", told["free"]["co_inf_m"][-1], None, "m", "section 4"),
    ]  # fmt: skip
    costs = [
        Claim(f"error with a bound on {'all of them' if name == 'all' else name}",
              told[name]["active"]["co_inf_m"][-1], None, "m", "section 4")
        for name in names
    ]  # fmt: skip
    return held + costs


def _draw_errors(figures: Figures, figure: Figure) -> None:
    told = figures["constrained"]
    figure.set_size_inches(5.6, 4.2)
    axes = figure.subplots()
    axes.plot(np.array(told["free"]["co_inf_m"]) * 1e6, color="black", label="no bound")
    marks = "osv^D<>*"
    for mark, name in zip(marks, [*BOUNDS, "all"], strict=True):
        axes.plot(np.array(told[name]["active"]["co_inf_m"]) * 1e6, marker=mark, markersize=4,
                      linewidth=1.0, label=name)  # fmt: skip
    errors_over_runs(axes, "max error in µm")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=5)


def _draw_step(figures: Figures, figure: Figure) -> None:
    shown = figures["step_limit"]
    figure.set_size_inches(5.6, 4.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for name, colour, label in (("free", "#9AA0A8", "no bound"), ("bounded", "#0072B2", "bounded")):
        upper.plot(shown["time_s"], np.array(shown[f"{name}_step_m"]) * 1e6, color=colour,
                   label=label)  # fmt: skip
        lower.plot(shown["time_s"], np.array(shown[f"{name}_error_m"]) * 1e6, color=colour)
    upper.axhline(shown["limit_m"] * 1e6, color="#D55E00", linestyle="--", linewidth=1.0)
    upper.set_ylabel("input, step in µm")
    lower.set_ylabel("error in µm")
    lower.set_xlabel("time in s")
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=2)


PICTURES = [
    Picture("bounds", "Largest error against the run with each bound where it matters; the "
            "constraints that the paper leaves to future work.", _draw_errors),
    Picture("step", "The learned input's change from sample to sample in the last run, free and "
            "bounded (dashed), and what the bound costs.", _draw_step),
]  # fmt: skip
