"""Pictures of one result or several: each draws into given axes, and returns them.

A result is a `TrialResult` or a `CampaignResult`; several are a list, or a dict by their labels.
`ilc_rt.plots` draws the whole pages of a report; these are its parts for a script or a notebook.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ilc_rt.plots import CONTOUR, FIRST, INK, LAST, STYLE, WIDTH_IN
from ilc_rt.quantity import Unit, unit_for
from ilc_rt.text import label

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ilc_rt.record import IterationRecord
    from ilc_rt.result import CampaignResult

    Array = NDArray[np.float64]
    Results = CampaignResult | Sequence[CampaignResult] | Mapping[str, CampaignResult]

__all__ = ["errors", "signal", "spectrum", "tracking"]

# Okabe and Ito, for colour-blind readers.
COLOURS = (LAST, FIRST, CONTOUR, "#CC79A7", "#E69F00", "#56B4E9", INK)
SIGNALS = {"error": "error_m", "input": "input", "output": "encoder_m"}


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
    named = _named(results)
    rows = [
        [(record.index, getattr(record, figure, None)) for record in result.records]
        for _, result in named
    ]
    known = [value for row in rows for _, value in row if value is not None]
    if not known:
        message = f"figure = {figure!r}: no run has it; e.g. 'tracking_rms_m' or 'contour_inf_m'"
        raise ValueError(message)
    unit = _unit(named[0][1].axis_unit(0), known)
    with mpl.rc_context(STYLE):
        axes = _axes(ax)
        for (name, _), row, colour in zip(named, rows, _colours(), strict=False):
            # An error of 0 has no place on a logarithmic scale.
            shown = [(index, value * unit.scale) for index, value in row if value]
            axes.plot(*zip(*shown, strict=True), "-o", markersize=4.5, color=colour, label=name)
        if any(value > 0 for value in known):
            axes.set_yscale("log")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        axes.set_xlabel("run (0 is the first)")
        axes.set_ylabel(_with_unit(figure.removesuffix("_m").replace("_", " "), unit))
        axes.legend()
    return axes


def signal(
    results: Results,
    what: str = "error",
    *,
    run: int = -1,
    axis: int = 0,
    ax: Axes | None = None,
) -> Axes:
    """Draw error, input or output of one run over time.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn; the keys of a mapping are the labels, otherwise the laws.
    what : {"error", "input", "output"}
        Signal.
    run : int
        Number of the run; negative ones count from the last.
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
        If there is no such signal, run or channel.
    """
    shown = [(name, result, _signal(result, what, run, axis)) for name, result in _named(results)]
    base = shown[0][1].axis_unit(axis) if what != "input" else shown[0][1].input_unit(axis)
    unit = _unit(base, [float(np.abs(values).max(initial=0.0)) for *_, values in shown])
    with mpl.rc_context(STYLE):
        axes = _axes(ax)
        for (name, result, values), colour in zip(shown, _colours(), strict=False):
            time_s = np.arange(len(values)) * result.cycle_s
            axes.plot(time_s, values * unit.scale, color=colour, linewidth=1.2, label=name)
        axes.set_xlabel("time in s")
        axes.set_ylabel(_with_unit(what, unit))
        axes.legend()
    return axes


def tracking(result: CampaignResult, *, axis: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the reference of an axis, and its first and last output.

    Parameters
    ----------
    result : TrialResult or CampaignResult
        At least one run.
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
    outputs = [_signal(result, "output", run, axis) for run in (0, -1)]
    reference = result.records[0].reference_m[:, axis]
    unit = _unit(result.axis_unit(axis), [float(np.abs(reference).max(initial=0.0))])
    time_s = np.arange(len(reference)) * result.cycle_s
    names = (f"run {result.records[0].index}", f"run {result.records[-1].index}")
    with mpl.rc_context(STYLE):
        axes = _axes(ax)
        axes.plot(time_s, reference * unit.scale, color="#9AA0A8", linewidth=4, label="reference")
        for values, name, colour in zip(outputs, names, (FIRST, LAST), strict=True):
            axes.plot(time_s, values * unit.scale, color=colour, linewidth=1.2, label=name)
        axes.set_xlabel("time in s")
        axes.set_ylabel(_with_unit("position", unit))
        axes.legend()
    return axes


def spectrum(results: Results, *, run: int = -1, axis: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the amplitude spectrum of a run's error over the frequency.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn; the keys of a mapping are the labels, otherwise the laws.
    run : int
        Number of the run; negative ones count from the last.
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
        (name, result, _signal(result, "error", run, axis)) for name, result in _named(results)
    ]
    if min(len(values) for *_, values in shown) < 4:
        message = "a spectrum needs runs of at least 4 samples"
        raise ValueError(message)
    lines = [_amplitudes(values, result.cycle_s) for _, result, values in shown]
    unit = _unit(shown[0][1].axis_unit(axis), [float(line[1].max()) for line in lines])
    with mpl.rc_context(STYLE):
        axes = _axes(ax)
        for (name, *_), (frequency_hz, amplitude), colour in zip(
            shown, lines, _colours(), strict=False
        ):
            axes.plot(frequency_hz, amplitude * unit.scale, color=colour, linewidth=1.2, label=name)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("frequency in Hz")
        axes.set_ylabel(_with_unit("amplitude of the error", unit))
        axes.legend()
    return axes


def _amplitudes(values: Array, dt_s: float) -> tuple[Array, Array]:
    window = np.hanning(len(values))
    amplitude = 2.0 * np.abs(np.fft.rfft(values * window)) / window.sum()
    frequency_hz = np.fft.rfftfreq(len(values), dt_s).astype(np.float64)
    return frequency_hz[1:], np.maximum(amplitude[1:], 1e-300)


def _named(results: Results) -> list[tuple[str, CampaignResult]]:
    """Return results with their labels: keys of a mapping, or the names of the laws."""
    if isinstance(results, Mapping):
        named = [(label(name), result) for name, result in results.items()]
    else:
        every: list[Any] = [results] if hasattr(results, "records") else list(results)
        laws = [result.law or result.cell or "result" for result in every]
        named = [
            (label(law if laws.count(law) == 1 else f"{law} {number + 1}"), result)
            for number, (law, result) in enumerate(zip(laws, every, strict=True))
        ]
    if not named or not all(result.records for _, result in named):
        message = "results: at least one result, each with at least one run, is needed"
        raise ValueError(message)
    return named


def _signal(result: CampaignResult, what: str, run: int, axis: int) -> Array:
    if what not in SIGNALS:
        message = f"what = {what!r}: allowed {', '.join(map(repr, SIGNALS))}"
        raise ValueError(message)
    record = _record(result, run)
    values: Array = getattr(record, SIGNALS[what])
    if not 0 <= axis < values.shape[1]:
        message = f"axis = {axis}: allowed 0 to {values.shape[1] - 1}"
        raise ValueError(message)
    return values[:, axis]


def _record(result: CampaignResult, run: int) -> IterationRecord:
    if not -len(result.records) <= run < len(result.records):
        message = f"run = {run}: there are {len(result.records)} runs"
        raise ValueError(message)
    return result.records[run]


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    return Figure(figsize=(WIDTH_IN, 3.4)).subplots()


def _colours() -> Iterator[str]:
    while True:
        yield from COLOURS


def _unit(base: str, sizes: Sequence[float]) -> Unit:
    finite = [value for value in sizes if np.isfinite(value)]
    return unit_for(base, max(finite, default=0.0))


def _with_unit(what: str, unit: Unit) -> str:
    return f"{what} in {unit.symbol}" if unit.symbol else what
