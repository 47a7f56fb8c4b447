"""Axes shared by the papers' figures.

The papers' packages import it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.ticker import NullFormatter

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def errors_over_runs(axes: Axes, label: str, *, runs: bool = True) -> None:
    """Make the vertical axis logarithmic with plain numbers, and name both.

    `runs` labels the horizontal axis too: on the lowest of several plots.
    """
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel(label)
    if runs:
        axes.set_xlabel("run (0 is without learning)")
