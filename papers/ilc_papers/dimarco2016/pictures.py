"""Plots of chapter 4: errors over the runs, signals of some runs, relevance of all.

Made from the figures of `learning`; read by the package's `__init__` only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.dimarco2016.learning import LABELS, TITLES
from ilc_papers.paper import Figures, Picture

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure


def draw_rms(figures: Figures, figure: Figure, name: str) -> None:
    """Draw the RMS error of every run of seed 0, and of the last runs of every seed."""
    found = figures[name]
    over_runs, over_seeds = figure.subplots(1, 2, width_ratios=[3, 1], sharey=True)
    for law, label in LABELS.items():
        over_runs.semilogy(found["rms_seed0"][law], linewidth=0.8, label=label)
    over_runs.set(xlabel="run", ylabel="RMS error (in)", title=f"{TITLES[name]}, one sequence")
    figure.legend(*over_runs.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    over_seeds.boxplot([found["last100_rms"][law] for law in LABELS], whis=(0.0, 100.0))
    over_seeds.set_xticks(range(1, len(LABELS) + 1), LABELS.values(), rotation=60, ha="right")
    over_seeds.set_title(f"last {found['n_last']}, all", fontsize="small")


def draw_signals(figures: Figures, figure: Figure, name: str) -> None:
    """Draw errors and ILC signals of some runs of DPW-ILC."""
    found = figures[name]["signals_seed0"]
    figure.set_size_inches(figure.get_figwidth(), 4.6)
    tracking, errors, inputs = figure.subplots(3, 1, sharex=True)
    reference = np.array(found["reference"])
    tracking.plot(found["t_s"], reference, color="0.7", label="reference")
    for run, error, signal in zip(found["run"], found["error"], found["input"], strict=True):
        label = f"run {run}"
        if run in (0, found["run"][-1]):
            tracking.plot(found["t_s"], reference - error, linewidth=0.8, label=label)
        errors.plot(found["t_s"], error, linewidth=0.8, label=label)
        inputs.plot(found["t_s"], signal, linewidth=0.8, label=label)
    tracking.set(ylabel="position (in)", title=f"{TITLES[name]}, DPW-ILC")
    errors.set(ylabel="error (in)")
    inputs.set(ylabel="ILC signal (in)", xlabel="time (s)")
    tracking.legend(fontsize="x-small", loc="upper right")
    figure.legend(*errors.get_legend_handles_labels(), loc="outside lower center", ncols=5)


def draw_relevance(figures: Figures, figure: Figure, name: str) -> None:
    """Draw the share of every run in the last one, and over the distance in temperature."""
    found = figures[name]
    share = np.array(found["final_relevance"]["share"])
    kelvin = np.array(found["temperature_seed0_k"])
    over_runs, over_kelvin = figure.subplots(1, 2, sharey=True)
    over_runs.vlines(np.arange(len(share)), 0.0, share, linewidth=0.8)
    over_runs.set(xlabel="run", ylabel="share in the last run", title=TITLES[name])
    over_kelvin.plot(np.abs(kelvin[:-1] - kelvin[-1]), share, ".", markersize=3)
    over_kelvin.set(xlabel="distance in temperature (K)")


def _of(
    name: str, draw: Callable[[Figures, Figure, str], None]
) -> Callable[[Figures, Figure], None]:
    return lambda figures, figure: draw(figures, figure, name)


_CITED = {"motor": ("4.6", "4.2 to 4.4", "4.5"), "expansion": ("4.9", "4.7", "4.8")}

PICTURES = tuple(
    picture
    for name, (rms, signals, relevance) in _CITED.items()
    for picture in (
        Picture(
            f"{name}-rms",
            f"RMS error over the runs, {TITLES[name]}: PD-ILC stays where DPW-ILC goes on "
            f"improving (as Fig. {rms})",
            _of(name, draw_rms),
        ),
        Picture(
            f"{name}-signals",
            f"Tracking, error and ILC signal of some runs, {TITLES[name]} (as Fig. {signals})",
            _of(name, draw_signals),
        ),
        Picture(
            f"{name}-relevance",
            f"Relevance of all past runs to the last, {TITLES[name]}: a few with nearly its "
            f"temperature and a small error hold most of it (as Fig. {relevance})",
            _of(name, draw_relevance),
        ),
    )
)
