"""Plots of chapter 8, drawn from the figures of section `mechanisms`."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_papers.paper import Figures, Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = {
    "individual": "trajectory objective",
    "formation": "formation objective",
    "combined": "trajectory + formation",
}


def _normalised(axes: Axes, cases: dict[str, Any], title: str, signal: Any) -> None:  # noqa: ANN401
    """Draw the errors of each case over those of its first run, as the thesis does."""
    for case, name in _NAMES.items():
        errors = np.asarray(signal(cases[case]))
        axes.semilogy(errors / errors[0], "o-", markersize=3, label=name)
    axes.set_title(title)
    axes.grid(visible=True, alpha=0.3)


def _draw_errors(which: str, figures: Figures, figure: Figure) -> None:
    cases = figures["mechanisms"][which]
    panels = figure.subplots(2, 2, sharex=True).ravel()
    for axes, (title, signal) in zip(
        panels,
        (
            ("agent 1, x", lambda found: found["agents"][0]["x_rms_m"]),
            ("agent 1, y", lambda found: found["agents"][0]["y_rms_m"]),
            ("formation error d3", lambda found: found["formation_each_rms_m"]["d3"]),
            ("formation error h3", lambda found: found["formation_each_rms_m"]["h3"]),
        ),
        strict=True,
    ):
        _normalised(axes, cases, title, signal)
    for axes in (panels[0], panels[2]):
        axes.set_ylabel("RMS over first")
    for axes in panels[2:]:
        axes.set_xlabel("iteration")
    panels[0].legend(fontsize="small")


def _draw_agents(figures: Figures, figure: Figure) -> None:
    for axes, path in zip(figure.subplots(1, 2), ("raster", "spiral"), strict=True):
        found = figures["mechanisms"][path]["individual"]["agents"]
        for number, agent in enumerate(found, start=1):
            axes.semilogy(
                1e3 * np.asarray(agent["y_rms_m"]), "o-", markersize=3, label=f"system {number}"
            )
        axes.set_title(path)
        axes.set_xlabel("iteration")
        axes.set_ylabel("RMS y error in mm")
        axes.grid(visible=True, alpha=0.3)
        axes.legend()


def _draw_unfiltered(figures: Figures, figure: Figure) -> None:
    found = figures["mechanisms"]
    for axes, path in zip(figure.subplots(1, 2), ("raster", "spiral"), strict=True):
        for colour, case in (("C0", "individual"), ("C1", "formation")):
            for cases, style, name in (
                (found[path], "o-", "with the filter"),
                (found["unfiltered"][path], "s--", "without"),
            ):
                axes.semilogy(
                    1e6 * np.asarray(cases[case]["formation_rms_m"]), style, color=colour,
                    markersize=3, label=f"{_NAMES[case]}, {name}",
                )  # fmt: skip
        axes.set_title(path)
        axes.set_xlabel("iteration")
        axes.set_ylabel("RMS formation error in µm")
        axes.grid(visible=True, alpha=0.3)
    figure.axes[0].legend(fontsize="small")


def _draw_paths(which: str, figures: Figures, figure: Figure) -> None:
    cases = figures["mechanisms"][which]
    for axes, case in zip(figure.subplots(1, 2), ("individual", "formation"), strict=True):
        found = cases[case]
        agent = found["agents"][0]
        for points, style, label in (
            (found["wanted_m"], "k:", "reference"),
            (agent["first_m"], "C1-", "first run"),
            (agent["last_m"], "C0-", "last run"),
        ):
            x, y, _ = 1e3 * np.asarray(points).T
            axes.plot(x, y, style, linewidth=1.0, label=label)
        axes.set_title(f"agent 1, {_NAMES[case]}")
        axes.set_xlabel("x in mm")
        axes.set_ylabel("y in mm")
        axes.set_aspect("equal")
    figure.axes[0].legend(fontsize="small")


PICTURES = [
    Picture(
        "mechanisms_raster",
        "Raster: tracking and formation errors (figures 8.9, 8.10).",
        partial(_draw_errors, "raster"),
    ),
    Picture(
        "mechanisms_spiral",
        "Spiral: tracking and formation errors (figures 8.15, 8.16).",
        partial(_draw_errors, "spiral"),
    ),
    Picture(
        "mechanisms_agents",
        "The three systems under the trajectory objective (figures 8.11, 8.17).",
        _draw_agents,
    ),
    Picture(
        "mechanisms_unfiltered",
        "Formation errors with and without the Gaussian filter of section 8.3.1.",
        _draw_unfiltered,
    ),
    Picture(
        "mechanisms_raster_paths",
        "Raster of agent 1 under two objectives (figure 8.12).",
        partial(_draw_paths, "raster"),
    ),
    Picture(
        "mechanisms_spiral_paths",
        "Spiral of agent 1 under two objectives (figure 8.18).",
        partial(_draw_paths, "spiral"),
    ),
    Picture(
        "mechanisms_disturbed",
        "Agent 1 disturbed: tracking and formation errors (figures 8.22, 8.23).",
        partial(_draw_errors, "disturbed"),
    ),
    Picture(
        "mechanisms_disturbed_paths",
        "Agent 1 disturbed: its spiral under two objectives (figure 8.24).",
        partial(_draw_paths, "disturbed"),
    ),
]
