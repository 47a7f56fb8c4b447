"""Plots of section 3.4, drawn from the figures of section `servo`; that section imports it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_papers.paper import Figures, Picture
from ilc_rt.pictures.themes import WIDTH_IN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _draw_sweep(figures: Figures, figure: Figure, name: str) -> None:
    sweep = figures["servo"][name]
    axes = figure.subplots()
    for value, errors, factor in zip(
        sweep["value"], sweep["rms"], sweep["monotonic_factor"], strict=True
    ):
        label = f"{name} = {value:g}, factor {max(factor, 0.0):.2f}"
        axes.semilogy(range(len(errors)), errors, label=label)
    if name == "r":
        _from_the_first_run_on(axes, len(sweep["rms"][0]))
    else:
        axes.set_xlabel("run (0 is without learning)")
    axes.set_ylabel("RMS error")
    axes.legend()


def _from_the_first_run_on(axes: Axes, n_runs: int) -> None:
    """Show hundreds of runs on a log scale, which has no run 0."""
    axes.set_xscale("log")
    axes.set_xlim(1, n_runs - 1)
    axes.set_xlabel("run")


def _draw_q(figures: Figures, figure: Figure) -> None:
    _draw_sweep(figures, figure, "q")


def _draw_s(figures: Figures, figure: Figure) -> None:
    _draw_sweep(figures, figure, "s")


def _draw_r(figures: Figures, figure: Figure) -> None:
    _draw_sweep(figures, figure, "r")


def _draw_noise(figures: Figures, figure: Figure) -> None:
    noise = figures["servo"]["noise"]
    axes = figure.subplots()
    for value, errors, limit in zip(
        noise["value"], noise["runs_rms"], noise["expected_rms"], strict=True
    ):
        (line,) = axes.plot(
            range(len(errors)), errors, linewidth=0.8, alpha=0.5, label=f"r = {value:g}"
        )
        axes.axhline(limit, color=line.get_color(), linestyle="--", zorder=5)
    axes.axhline(noise["noise_std"], color="#5A6068", linestyle=":", label="noise alone")
    _from_the_first_run_on(axes, len(noise["runs_rms"][0]))
    axes.set_ylabel("RMS error")
    axes.set_ylim(0.95 * noise["noise_std"], 1.4 * max(noise["expected_rms"]))
    axes.legend()


def _draw_signals(figures: Figures, figure: Figure) -> None:
    signals = figures["servo"]["signals"]
    figure.set_size_inches(WIDTH_IN, 5.0)
    grid = figure.subplots(3, 1, sharex=True)
    for axes, (key, label) in zip(
        grid,
        (("error", "error"), ("feedback", "controller's output"), ("learned", "learned input")),
        strict=True,
    ):
        for run, values in zip(signals["run"], signals[key], strict=True):
            axes.plot(values, linewidth=1.0, label=f"run {run}")
        axes.set_ylabel(label)
    grid[-1].set_xlabel("sample")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=5)


PICTURES = [
    Picture(
        "servo_signals",
        "Learned input takes over from the controller, q = s = r = 1 (figure 3.4).",
        _draw_signals,
    ),
    Picture("servo_q", "RMS error for different weights of the error (figure 3.5).", _draw_q),
    Picture("servo_s", "RMS error for different weights of the input (figure 3.6).", _draw_s),
    Picture(
        "servo_r", "RMS error for different weights of the change of input (figure 3.7).", _draw_r
    ),
    Picture(
        "servo_noise",
        "RMS error under white noise, and what is expected of it in the end, dashed (figure 3.8).",
        _draw_noise,
    ),
]
