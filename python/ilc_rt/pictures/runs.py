"""Pictures of runs: errors against the run, signals over time, their spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from ilc_rt.pictures.given import (
    Results,
    Runs,
    axes_or_new,
    base_unit,
    colours,
    largest,
    logarithmic,
    named,
    shown_runs,
    suitable_unit,
    values_of,
    with_unit,
)
from ilc_rt.pictures.themes import current, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["errors", "signal", "spectrum", "tracking"]


def errors(results: Results, *, ax: Axes | None = None, figure: str = "tracking_rms_m") -> Axes:
    """Draw an error of every run on a logarithmic scale.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn; the keys of a mapping are the labels, otherwise the laws.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.
    figure : str
        Figure that is drawn, of `ilc_rt.figures.Figures`, e.g. ``"contour_inf_m"``.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into; ``axes.figure.savefig`` writes the picture.

    Raises
    ------
    ValueError
        If there is no result, or none has this figure.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, pictures, simulate
    >>> slow, fast = (simulate([0.0, 1.0], PdIlc(kp=kp), np.ones(4)) for kp in (0.2, 0.8))
    >>> pictures.errors({"kp = 0.2": slow, "kp = 0.8": fast}).get_yscale()
    'log'
    """
    several = named(results)
    rows = [
        [(record.index, getattr(record, figure, None)) for record in result.records]
        for _, result in several
    ]
    known = [value for row in rows for _, value in row if value is not None]
    if not known:
        message = f"figure = {figure!r}: no run has it; e.g. 'tracking_rms_m' or 'contour_inf_m'"
        raise ValueError(message)
    unit = suitable_unit(several[0][1].axis_unit(0), known)
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        for (name, _), row, colour in zip(several, rows, colours(), strict=False):
            # An error of 0 has no place on a logarithmic scale.
            shown = [(index, value * unit.scale) for index, value in row if value]
            axes.plot(*zip(*shown, strict=True), "-o", markersize=4.5, color=colour, label=name)
        if any(value > 0 for value in known):
            logarithmic(axes)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        axes.set_xlabel("run (0 is the first)")
        axes.set_ylabel(with_unit(figure.removesuffix("_m").replace("_", " "), unit))
        axes.legend()
    return axes


def signal(
    results: Results,
    what: str = "error",
    *,
    run: Runs = -1,
    axis: int = 0,
    ax: Axes | None = None,
    legend: bool = True,
) -> Axes:
    """Draw error, input or output of runs over time.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn; the keys of a mapping are the labels, otherwise the laws.
    what : {"error", "input", "output"}
        Signal.
    run : int or sequence of int
        Number of the run, or of several; negative ones count from the last.
    axis : int
        Channel.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.
    legend : bool
        Name the lines.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If there is no such signal, run or channel.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, pictures, simulate
    >>> result = simulate([0.0, 1.0], PdIlc(kp=0.5), np.ones(4), trials=3)
    >>> [line.get_label() for line in pictures.signal(result, run=(0, -1)).lines]
    ['run 0', 'run 2']
    """
    shown = [
        (name, result, values_of(record, what, axis))
        for name, result, record in shown_runs(results, run)
    ]
    unit = suitable_unit(base_unit(shown[0][1], what, axis), [largest(part[2]) for part in shown])
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        for (name, result, values), colour in zip(shown, colours(), strict=False):
            time_s = np.arange(len(values)) * result.cycle_s
            axes.plot(time_s, values * unit.scale, color=colour, linewidth=1.2, label=name)
        axes.set_xlabel("time in s")
        axes.set_ylabel(with_unit(what, unit))
        if legend:
            axes.legend()
    return axes


def tracking(results: Results, *, axis: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the reference of an axis, with the outputs.

    Parameters
    ----------
    results : result, sequence or mapping of results
        Of one result the first and the last output are drawn, of several the last of each; the
        reference is that of the first one.
    axis : int
        Channel.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If there is no such channel or no run.
    """
    runs = shown_runs(results, (0, -1) if len(named(results)) == 1 else -1)
    outputs = [(name, result, values_of(record, "output", axis)) for name, result, record in runs]
    _, result, record = runs[0]
    reference = record.reference_m[:, axis]
    unit = suitable_unit(result.axis_unit(axis), [largest(reference)])
    alone = len(named(results)) == 1
    order = (current().first, current().last) if alone else current().series
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        axes.plot(
            np.arange(len(reference)) * result.cycle_s, reference * unit.scale,
            color=current().path, linewidth=4, label="reference",
        )  # fmt: skip
        for number, (name, one, values) in enumerate(outputs):
            time_s = np.arange(len(values)) * one.cycle_s
            axes.plot(
                time_s, values * unit.scale, color=order[number % len(order)], linewidth=1.2,
                label=name,
            )  # fmt: skip
        axes.set_xlabel("time in s")
        axes.set_ylabel(with_unit("position", unit))
        axes.legend()
    return axes


def spectrum(
    results: Results,
    what: str = "error",
    *,
    run: Runs = -1,
    axis: int = 0,
    ax: Axes | None = None,
) -> Axes:
    """Draw the amplitude spectrum of a run's error, input or output over the frequency.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn; the keys of a mapping are the labels, otherwise the laws.
    what : {"error", "input", "output"}
        Signal.
    run : int or sequence of int
        Number of the run, or of several; negative ones count from the last.
    axis : int
        Channel.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If there is no such run or channel, or the runs have fewer than 4 samples.
    """
    shown = [
        (name, result, values_of(record, what, axis))
        for name, result, record in shown_runs(results, run)
    ]
    if min(len(values) for *_, values in shown) < 4:
        message = "a spectrum needs runs of at least 4 samples"
        raise ValueError(message)
    lines = [_amplitudes(values, result.cycle_s) for _, result, values in shown]
    sizes = [largest(np.nan_to_num(amplitude)) for _, amplitude in lines]
    unit = suitable_unit(base_unit(shown[0][1], what, axis), sizes)
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        for (name, *_), (frequency_hz, amplitude), colour in zip(
            shown, lines, colours(), strict=False
        ):
            axes.plot(frequency_hz, amplitude * unit.scale, color=colour, linewidth=1.2, label=name)
        axes.set_yscale("log")
        over_frequency(axes)
        axes.set_ylabel(with_unit(f"amplitude of the {what}", unit))
        axes.legend()
    return axes


def over_frequency(axes: Axes) -> None:
    """Scale the lower axis for frequencies, with plain numbers."""
    axes.set_xscale("log")
    axes.set_xlabel("frequency in Hz")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _amplitudes(values: Array, dt_s: float) -> tuple[Array, Array]:
    window = np.hanning(len(values))
    amplitude = 2.0 * np.abs(np.fft.rfft(values * window)) / window.sum()
    frequency_hz = np.fft.rfftfreq(len(values), dt_s).astype(np.float64)
    # An amplitude of 0 has no place on a logarithmic scale.
    return frequency_hz[1:], np.where(amplitude > 0.0, amplitude, np.nan)[1:]
