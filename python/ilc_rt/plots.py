"""The pictures of a campaign, each a matplotlib figure.

Every figure is drawn without a display, in colours that colour-blind people
can tell apart (Okabe and Ito), at a width that a phone can show.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from ilc_rt.deviation import magnification, path_deviation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ilc_rt.events import Histogram
    from ilc_rt.record import IterationRecord
    from ilc_rt.result import CampaignResult

    Array = NDArray[np.float64]

FIRST = "#D55E00"
LAST = "#0072B2"
CONTOUR = "#009E73"
PATH = "#DADDE2"
INK = "#30343B"
WIDTH_IN = 5.6
FIRST_BIN_RATIO = 1.5

STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#9AA0A8",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 10,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "figure.constrained_layout.use": True,
    "figure.dpi": 150,
    "font.family": "sans-serif",
    "font.size": 10,
    "grid.color": "#E6E8EB",
    "grid.linewidth": 0.8,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.6,
    "path.simplify_threshold": 0.4,
    "svg.fonttype": "none",
    "text.color": INK,
    "xtick.color": "#5A6068",
    "xtick.labelsize": 9,
    "ytick.color": "#5A6068",
    "ytick.labelsize": 9,
}


def convergence(result: CampaignResult) -> Figure:
    """Draw the errors against the number of the run, on a log scale.

    Parameters
    ----------
    result : CampaignResult
        At least one run.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.5))
        axes = figure.subplots()
        index = [record.index for record in result.records]
        curves = [
            ("tracking, max", LAST, "o", "-", "tracking_inf_m"),
            ("tracking, RMS", LAST, "o", ":", "tracking_rms_m"),
            ("contour, max", CONTOUR, "s", "-", "contour_inf_m"),
            ("contour, RMS", CONTOUR, "s", ":", "contour_rms_m"),
        ]
        for label, colour, marker, line, name in curves:
            values = [getattr(record, name) for record in result.records]
            if any(value is None for value in values):
                continue
            in_um = np.maximum(np.asarray(values, dtype=np.float64) * 1e6, 1e-6)
            filled = colour if line == "-" else "white"
            axes.plot(
                index, in_um, line, color=colour, marker=marker, markersize=4.5,
                markerfacecolor=filled, label=label,
            )  # fmt: skip
        back = [record.index for record in result.records if record.rolled_back]
        for number in back:
            axes.axvline(number, color=FIRST, linewidth=1, linestyle="--")
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(FuncFormatter(_minor_label))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        axes.set_xlabel("run (0 is without learning)")
        axes.set_ylabel("error in µm")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=4,
                      columnspacing=1.2)  # fmt: skip
        return figure


def contour(result: CampaignResult) -> Figure | None:
    """Draw the path with its deviations magnified; None for a single axis.

    The upper picture shows first and last run at the same magnification, the
    lower one the last run at its own. Only the first two axes are drawn.
    """
    if result.n_axes < 2 or not result.records:
        return None
    first, last = result.records[0], result.records[-1]
    with mpl.rc_context(STYLE):
        reference = first.reference_m
        extent_m = float(np.ptp(reference[:, :2], axis=0).max())
        if extent_m <= 0.0:
            return None
        aspect = float(np.ptp(reference[:, 1]) / extent_m)
        panels = [[first, last], [last]] if first is not last else [[first]]
        height = 0.6 + max(1.6, (WIDTH_IN - 0.8) * 1.15 * min(aspect, 1.0)) + 0.3
        figure = Figure(figsize=(WIDTH_IN, height * len(panels)))
        grid = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axes, records in zip(grid, panels, strict=True):
            _contour_panel(axes, records, first, result.axis_names, extent_m)
        figure.align_ylabels()
        return figure


def learned_input(result: CampaignResult) -> Figure | None:
    """Draw the learned input of each axis, first and last; None if there is none."""
    learned = [record for record in result.records if np.any(record.input)]
    if not learned:
        return None
    first, last = learned[0], learned[-1]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.1 + 1.6 * result.n_axes))
        grid = figure.subplots(result.n_axes, 1, sharex=True, squeeze=False)[:, 0]
        time_s = np.arange(len(last.input)) * result.cycle_s
        for number, axes in enumerate(grid):
            if first is not last:
                axes.plot(time_s, first.input[:, number] * 1e3, color=FIRST, linewidth=1.2,
                          label=f"run {first.index}")  # fmt: skip
            axes.plot(time_s, last.input[:, number] * 1e3, color=LAST, linewidth=1.2,
                      label=f"run {last.index}")  # fmt: skip
            axes.set_title(result.axis_names[number])
            axes.set_ylabel(f"input in m{result.input_unit(number)}")
        grid[-1].set_xlabel("time in s")
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        figure.align_ylabels()
        return figure


def tracking(result: CampaignResult) -> Figure | None:
    """Draw the tracking error over time: first against last run, then last alone."""
    if not result.records:
        return None
    first, last = result.records[0], result.records[-1]
    with mpl.rc_context(STYLE):
        panels = 2 if first is not last else 1
        figure = Figure(figsize=(WIDTH_IN, 0.8 + 1.45 * result.n_axes * panels))
        grid = figure.subplots(result.n_axes * panels, 1, sharex=True, squeeze=False)[:, 0]
        time_s = np.arange(len(last.error_m)) * result.cycle_s
        for number in range(result.n_axes):
            name = result.axis_names[number]
            upper = grid[number * panels]
            upper.plot(time_s, first.error_m[:, number] * 1e6, color=FIRST, linewidth=1.2,
                       label=f"run {first.index}")  # fmt: skip
            upper.set_title(name)
            upper.set_ylabel(f"error in µ{result.axis_unit(number)}")
            if panels == 2:
                upper.plot(time_s, last.error_m[:, number] * 1e6, color=LAST, linewidth=1.2,
                           label=f"run {last.index}")  # fmt: skip
                lower = grid[number * panels + 1]
                lower.plot(time_s, last.error_m[:, number] * 1e6, color=LAST, linewidth=1.0)
                lower.set_title(f"{name}, run {last.index} on a scale of its own")
                lower.set_ylabel(f"error in µ{result.axis_unit(number)}")
        grid[-1].set_xlabel("time in s")
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        figure.align_ylabels()
        return figure


def latency(result: CampaignResult) -> Figure | None:
    """Draw how late the loop woke and how long it computed; None in lock-step."""
    if result.latency is None:
        return None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        upper, lower = figure.subplots(2, 1)
        _histogram_panel(upper, result.latency.wake_late_us, LAST, "late wake-up")
        _histogram_panel(lower, result.latency.execution_us, CONTOUR, "computation in a cycle")
        lower.set_xlabel("time in µs")
        return figure


def _contour_panel(
    axes: Axes,
    records: list[IterationRecord],
    widest: IterationRecord,
    names: tuple[str, ...],
    extent_m: float,
) -> None:
    deviations = {record.id: path_deviation(record.reference_m, record.tool_or_encoder_m)
                  for record in {r.id: r for r in (*records, widest)}.values()}  # fmt: skip
    scale_by = widest if widest in records else records[0]
    largest_m = float(np.linalg.norm(deviations[scale_by.id], axis=1).max())
    factor = magnification(largest_m, extent_m)
    reference = records[0].reference_m
    axes.plot(*(reference[:, :2].T * 1e3), color=PATH, linewidth=5.0, label="programmed",
              solid_capstyle="round")  # fmt: skip
    for record in records:
        colour = FIRST if record is widest else LAST
        shown = record.reference_m + factor * deviations[record.id]
        axes.plot(*(shown[:, :2].T * 1e3), color=colour, linewidth=1.3,
                  label=f"run {record.index}")  # fmt: skip
    axes.set_aspect("equal")
    round_m = _round_down(largest_m)
    axes.set_title(
        f"deviation shown {factor:,} times: {round_m * 1e6:g} µm as {round_m * factor * 1e3:.2g} mm"
    )
    axes.set_xlabel(f"{names[0]} in mm")
    axes.set_ylabel(f"{names[1]} in mm")
    axes.legend(loc="center")


def _round_down(value: float) -> float:
    """Return the next of 1, 2, 5, 10 ... that is not above."""
    if value <= 0.0:
        return 0.0
    decade = 10.0 ** float(np.floor(np.log10(value)))
    return float(max(s * decade for s in (1.0, 2.0, 5.0) if s * decade <= value * 1.0001))


def _histogram_panel(axes: Axes, histogram: Histogram, colour: str, title: str) -> None:
    """Draw the bins as they are counted: each begins where the one before ends."""
    seen = [number for number, (_, count) in enumerate(histogram.bins) if count > 0]
    if seen:
        uppers = np.array([upper for upper, _ in histogram.bins], dtype=np.float64)
        counts = np.array([count for _, count in histogram.bins], dtype=np.float64)
        lowers = np.r_[uppers[0] / FIRST_BIN_RATIO, uppers[:-1]]
        shown = slice(seen[0], seen[-1] + 1)
        axes.bar(lowers[shown], counts[shown], (uppers - lowers)[shown], align="edge",
                 color=colour, edgecolor="white", linewidth=0.5)  # fmt: skip
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.6)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    quantiles = (histogram.p50, histogram.p99, histogram.p999, histogram.max)
    for value in quantiles:
        axes.axvline(value, color=INK, linewidth=0.9, linestyle=(0, (3, 2)))
    half, p99, p999, longest = (f"{v:.3g}" if v < 1000 else f"{v:.0f}" for v in quantiles)
    axes.set_title(
        f"{title}: half within {half} µs, 99 % {p99}, 99.9 % {p999}, all {longest}", fontsize=9
    )
    axes.set_ylabel("cycles")


def _minor_label(value: float, _position: int | None) -> str:
    exponent = np.floor(np.log10(value))
    return f"{value:g}" if round(value / 10.0**exponent) in {2, 5} else ""
