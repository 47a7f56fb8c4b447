"""Plots of chapter 7, drawn from the figures of section `delta`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.paper import Figures, Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw_bode(figures: Figures, figure: Figure) -> None:
    bode = figures["delta"]["identification"]["bode"]
    gain, phase = figure.subplots(2, 1, sharex=True)
    frequency = bode["frequency_hz"]
    gain.loglog(frequency, bode["measured_gain"], "o", markersize=3, label="swept sine")
    gain.loglog(frequency, bode["fitted_gain"], label="second-order model")
    gain.set_ylabel("gain in rad/(N m)")
    gain.legend()
    phase.semilogx(frequency, bode["measured_phase_deg"], "o", markersize=3)
    phase.semilogx(frequency, bode["fitted_phase_deg"])
    phase.set_ylabel("phase in degrees")
    phase.set_xlabel("frequency in Hz")
    for axes in (gain, phase):
        axes.grid(visible=True, alpha=0.3)


def _draw_steps(figures: Figures, figure: Figure) -> None:
    axes = figure.subplots()
    for name, each in figures["delta"]["geometries"].items():
        steps = each["finite_difference"]
        axes.loglog(steps["step_rad"], steps["relative_error"], "o-", label=name)
    axes.set_xlabel("step of the finite difference in rad")
    axes.set_ylabel("error relative to the analytic Jacobian")
    axes.grid(visible=True, alpha=0.3)
    axes.legend()


def _draw_references(figures: Figures, figure: Figure) -> None:
    for column, (name, shapes) in enumerate(figures["delta"]["references"].items()):
        axes = figure.add_subplot(1, 2, column + 1, projection="3d")
        for label, points in (
            ("wanted, by inverse kinematics", shapes["wanted_m"]),
            ("through the Jacobian (8.2)", shapes["printed"]["tool_m"]),
        ):
            x, y, z = 1e3 * np.asarray(points).T
            axes.plot(x, y, z, label=label, linewidth=1.0)
        axes.set_title(name)
        axes.set_xlabel("x in mm")
        axes.set_ylabel("y in mm")
        axes.set_zlabel("z in mm")
        axes.legend(fontsize="small", loc="upper left")


PICTURES = [
    Picture("delta_identification", "A leg's response and its model (figure 7.5).", _draw_bode),
    Picture(
        "delta_jacobian",
        "Finite differences of appendix F beside the analytic Jacobian.",
        _draw_steps,
    ),
    Picture(
        "delta_references",
        "Raster and spiral, wanted and through a constant Jacobian (figures 8.4, 8.7).",
        _draw_references,
    ),
]
