"""Picture of the loop's timing: late wake-ups, and the computation in a cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.ticker import FuncFormatter, NullFormatter

from ilc_rt.pictures.given import Results, axes_or_new, colours, named
from ilc_rt.pictures.themes import current, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ilc_rt.events import Histogram

__all__ = ["latency"]

FIRST_BIN_RATIO = 1.5
KINDS = {
    "wake": ("wake_late_us", "late wake-up"),
    "execution": ("execution_us", "computation in a cycle"),
}


def latency(results: Results, what: str = "wake", *, ax: Axes | None = None) -> Axes:
    """Draw how often the servo loop woke late, or computed long, in µs.

    Parameters
    ----------
    results : result, sequence or mapping of results
        Campaigns in real time. Of one, the dashed lines are 50 %, 99 %, 99.9 % and the largest.
    what : {"wake", "execution"}
        Late wake-up, or computation in a cycle.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If a campaign was in lock-step, which has no timing, or `what` is unknown.
    """
    if what not in KINDS:
        message = f"what = {what!r}: allowed {', '.join(map(repr, KINDS))}"
        raise ValueError(message)
    attribute, title = KINDS[what]
    several = named(results)
    for name, result in several:
        if result.latency is None:
            message = f"{name}: no timing; a campaign in lock-step or of a library has none"
            raise ValueError(message)
    found = [(name, getattr(result.latency, attribute)) for name, result in several]
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        for (name, histogram), colour in zip(found, colours(), strict=False):
            edges, counts = _bins(histogram)
            if counts.size == 0:
                continue
            if len(found) == 1:
                fill = current().last if what == "wake" else current().third
                axes.bar(edges[:-1], counts, np.diff(edges), align="edge", color=fill,
                         edgecolor=current().ground, linewidth=0.5)  # fmt: skip
            else:
                axes.stairs(counts, edges, color=colour, linewidth=1.6, label=name, baseline=None)
        if any(_bins(histogram)[1].size for _, histogram in found):
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_ylim(bottom=0.6)
            for one in (axes.xaxis, axes.yaxis):
                one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_title(title)
        if len(found) == 1:
            _quantiles(axes, found[0][1], title)
        else:
            axes.legend()
        axes.set_xlabel("time in µs")
        axes.set_ylabel("cycles")
    return axes


def _bins(histogram: Histogram) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return edges and counts of the bins as counted: each begins at the end of the previous."""
    seen = [number for number, (_, count) in enumerate(histogram.bins) if count > 0]
    if not seen:
        return np.zeros(0), np.zeros(0)
    uppers = np.array([upper for upper, _ in histogram.bins], dtype=np.float64)
    counts = np.array([count for _, count in histogram.bins], dtype=np.float64)
    edges = np.r_[uppers[0] / FIRST_BIN_RATIO, uppers]
    return edges[seen[0] : seen[-1] + 2], counts[seen[0] : seen[-1] + 1]


def _quantiles(axes: Axes, histogram: Histogram, title: str) -> None:
    quantiles = (histogram.p50, histogram.p99, histogram.p999, histogram.max)
    for value in quantiles:
        axes.axvline(value, color=current().ink, linewidth=0.9, linestyle=(0, (3, 2)))
    half, p99, p999, longest = (f"{v:.3g}" if v < 1000 else f"{v:.0f}" for v in quantiles)
    axes.set_title(
        f"{title}: half within {half} µs, 99 % {p99}, 99.9 % {p999}, all {longest}", fontsize=9
    )
