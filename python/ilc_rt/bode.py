"""Bode plot of an identified axis: measurement, model, coherence, uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from ilc_rt.plots import CONTOUR, FIRST, LAST, STYLE, WIDTH_IN

if TYPE_CHECKING:
    from numpy.typing import NDArray


def bode(
    frequency_hz: NDArray[np.float64],
    response: NDArray[np.complex128],
    coherence: NDArray[np.float64],
    model: NDArray[np.complex128],
    bound: NDArray[np.float64],
    title: str = "",
) -> Figure:
    """Draw magnitude, phase, coherence and uncertainty.

    `bound` is that of the multiplicative uncertainty.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 6.4))
        magnitude, phase, trust = figure.subplots(3, 1, sharex=True, height_ratios=(2, 2, 1.4))
        # The model's phase is drawn near the measured one: whole turns are arbitrary.
        shown_deg = np.degrees(np.unwrap(np.angle(response)))
        model_deg = np.degrees(np.unwrap(np.angle(model)))
        model_deg += 360.0 * np.round(np.median(shown_deg - model_deg) / 360.0)
        dots = {"color": FIRST, "linestyle": "none", "marker": ".", "markersize": 3.5}
        line = {"color": LAST}
        magnitude.plot(frequency_hz, _decibels(response), label="measured", **dots)
        magnitude.plot(frequency_hz, _decibels(model), label="model", **line)
        phase.plot(frequency_hz, shown_deg, **dots)
        phase.plot(frequency_hz, model_deg, **line)
        trust.plot(frequency_hz, coherence, color=CONTOUR, label="coherence")
        trust.plot(frequency_hz, bound, color=LAST, linestyle=":", label="uncertainty")
        magnitude.set_title(title)
        magnitude.set_ylabel("magnitude in dB")
        phase.set_ylabel("phase in degrees")
        trust.set_xlabel("frequency in Hz")
        trust.set_ylim(0.0, max(1.05, min(2.0, 1.05 * float(np.max(bound)))))
        trust.set_xscale("log")
        trust.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        trust.xaxis.set_minor_formatter(NullFormatter())
        magnitude.legend(loc="lower left")
        trust.legend(loc="center left")
        figure.align_ylabels()
        return figure


def _decibels(response: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the magnitude in dB; NaN, which is not drawn, for 0."""
    size = np.abs(response)
    found = 20.0 * np.log10(np.where(size > 0.0, size, 1.0))
    return np.where(size > 0.0, found, np.nan)
