"""Pictures over frequency: Bode plot of measurements and models, contraction of a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from ilc_rt._native import StateSpace
from ilc_rt.analysis import Analysis
from ilc_rt.pictures.given import axes_or_new, colours, panels_or_new
from ilc_rt.pictures.runs import over_frequency
from ilc_rt.pictures.themes import current, style
from ilc_rt.response import FrequencyResponse
from ilc_rt.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["bode", "contraction"]

# Points of a model that is drawn without a measurement, and its range below the Nyquist frequency.
POINTS = 400
DECADES = 3.0


def bode(
    responses: Any,  # noqa: ANN401 (a response, a model or a fit, or several)
    *,
    frequency_hz: ArrayLike | None = None,
    uncertainty: tuple[ArrayLike, ArrayLike] | None = None,
    title: str = "",
    ax: Sequence[Axes] | None = None,
) -> list[Axes]:
    """Draw magnitude and phase of measurements and models, and the coherence of measurements.

    Parameters
    ----------
    responses : FrequencyResponse, StateSpace, fit, or a sequence or mapping of them
        Measurements are dots, models and fits (`ilc_rt.identify`) are lines. The keys of a mapping
        are the labels. A model has one input and one output, e.g. ``model[0, 0]``.
    frequency_hz : array_like or None
        Frequencies at which models are drawn; None for the range of the measurements.
    uncertainty : tuple of array_like or None
        Frequencies in Hz and bound of the multiplicative uncertainty, as from
        `ilc_rt.identify.uncertainty`.
    title : str
        Title.
    ax : sequence of matplotlib.axes.Axes or None
        Two axes, for magnitude and phase, and a third one if there is a measurement or an
        uncertainty; None for new ones.

    Returns
    -------
    list of matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If there is nothing to draw, a model has several channels, or `ax` another number of axes.
    TypeError
        If something has no response.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import discretize, pictures, second_order
    >>> from ilc_rt.identify import FrequencyResponse
    >>> model = discretize(second_order(94.0, 0.7), 0.002)
    >>> f = np.linspace(1.0, 50.0, 50)
    >>> measured = FrequencyResponse(f, 1.1 * model.frequency_response(2 * np.pi * f)[:, 0, 0])
    >>> [axes.get_ylabel() for axes in pictures.bode({"measured": measured, "model": model})]
    ['magnitude in dB', 'phase in degrees', 'coherence']
    """
    named = _named(responses)
    measured = [one for _, one in named if isinstance(one, FrequencyResponse)]
    grid = _grid(named, measured, frequency_hz)
    has_third = bool(measured) or uncertainty is not None
    with mpl.rc_context(style()):
        ratios = (2.0, 2.0, 1.4) if has_third else (1.0, 1.0)
        panels = panels_or_new(ax, len(ratios), 6.4 if has_third else 5.0, ratios)
        near: Complex | None = None
        order = _in_order(named)
        for (name, one), colour in zip(named, order, strict=True):
            at, response = _response(one, grid)
            phase_deg = np.degrees(np.unwrap(np.angle(response)))
            if near is None:
                near_at, near = at, phase_deg
            # Whole turns are arbitrary: a phase is drawn near the first one.
            turns = np.median(np.interp(at, near_at, near) - phase_deg) / 360.0
            phase_deg = phase_deg + 360.0 * np.round(turns)
            look: dict[str, Any] = {"color": colour, "label": name}
            if isinstance(one, FrequencyResponse):
                look |= {"linestyle": "none", "marker": ".", "markersize": 3.5}
                panels[2].plot(at, one.coherence, color=_of_coherence(colour, measured),
                               label="coherence" if len(measured) == 1
                               else f"coherence, {name}")  # fmt: skip
            panels[0].plot(at, _decibels(response), **look)
            panels[1].plot(at, phase_deg, **look)
        if has_third:
            _third(panels[2], uncertainty, coherent=bool(measured))
        panels[0].set_title(title)
        panels[0].set_ylabel("magnitude in dB")
        panels[1].set_ylabel("phase in degrees")
        for axes in panels:
            over_frequency(axes)
            if axes is not panels[-1] and ax is None:
                axes.set_xlabel("")
        panels[0].legend(loc="lower left")
        if ax is None:
            figure: Any = panels[0].figure
            figure.align_ylabels()
    return panels


def contraction(
    analyses: Analysis | Sequence[Analysis] | Mapping[str, Analysis],
    *,
    ax: Axes | None = None,
) -> Axes:
    """Draw the factor by which a run multiplies the error, over frequency.

    Below 1 the error falls at this frequency in every run; at the critical frequency, marked by a
    dashed line, a run begins to amplify it.

    Parameters
    ----------
    analyses : Analysis, sequence or mapping of them
        From `ilc_rt.analyze`; the keys of a mapping are the labels.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If there is nothing to draw, or an analysis has no frequencies, as that of a model that
        varies in time.

    Examples
    --------
    >>> from ilc_rt import PdIlc, analyze, discretize, pictures, second_order
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> axes = pictures.contraction({"P": analyze(PdIlc(kp=0.5), axis, 200)})
    >>> axes.get_ylabel()
    'factor of a run'
    """
    named = _labelled(analyses, Analysis, "analyses")
    for name, one in named:
        if one.frequency_hz.size == 0:
            message = f"{name}: the analysis has no frequencies; it needs a time-invariant model"
            raise ValueError(message)
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        axes.axhline(1.0, color=current().ink, linewidth=1.0)
        for (name, one), colour in zip(named, colours(), strict=False):
            inside = one.frequency_hz > 0.0
            critical = one.critical_frequency_hz
            text = name if critical is None else f"{name}: critical at {critical:.3g} Hz"
            axes.plot(
                one.frequency_hz[inside], one.contraction[inside], color=colour, label=text,
            )  # fmt: skip
            if critical is not None:
                axes.axvline(critical, color=colour, linewidth=1.0, linestyle=(0, (4, 3)))
        over_frequency(axes)
        axes.set_ylim(0.0, max(1.3, 1.1 * axes.get_ylim()[1]))
        axes.set_ylabel("factor of a run")
        axes.legend()
    return axes


def _labelled(given: Any, kind: type, name: str) -> list[tuple[str, Any]]:  # noqa: ANN401
    """Return one thing or several with their labels."""
    if isinstance(given, Mapping):
        found = [(label(key), one) for key, one in given.items()]
    elif isinstance(given, Sequence):
        found = [(f"{number}", one) for number, one in enumerate(given, 1)]
    else:
        found = [("law" if kind is Analysis else "", given)]
    if not found:
        message = f"{name}: at least one is needed"
        raise ValueError(message)
    for _, one in found:
        if not isinstance(one, kind):
            message = f"{name}: a {type(one).__name__}; {kind.__name__} is needed"
            raise TypeError(message)
    return found


def _named(responses: Any) -> list[tuple[str, Any]]:  # noqa: ANN401
    found = []
    for name, one in _labelled(responses, object, "responses"):
        text = name
        if not isinstance(responses, Mapping):
            text = "measured" if isinstance(one, FrequencyResponse) else "model"
            text += f" {name}" * bool(name)
        found.append((text, one if callable(getattr(one, "response", None)) else _own(one)))
    return found


def _own(one: object) -> FrequencyResponse | StateSpace:
    if isinstance(one, FrequencyResponse):
        return one
    model = StateSpace._of(one)
    if (model.n_inputs, model.n_outputs) != (1, 1):
        message = (
            f"a model has {model.n_inputs} inputs and {model.n_outputs} outputs; one of each is "
            "needed: model[output, input]"
        )
        raise ValueError(message)
    return model


def _grid(
    named: list[tuple[str, Any]], measured: list[FrequencyResponse], given: ArrayLike | None
) -> Array:
    """Return the frequencies of the models."""
    if given is not None:
        return np.asarray(given, dtype=np.float64)
    if measured:
        return np.unique(np.concatenate([one.frequency_hz for one in measured]))
    tops = []
    for _, one in named:
        dt_s = getattr(one, "dt_s", None)
        if dt_s is not None:
            tops.append(0.5 / dt_s)
        elif isinstance(one, StateSpace):
            found = one.natural_frequencies()[0]
            tops.append(10.0 * float(found.max(initial=1.0)))
    top = max(tops, default=100.0)
    return np.geomspace(top / 10.0**DECADES, top, POINTS)


def _response(one: Any, grid: Array) -> tuple[Array, Complex]:  # noqa: ANN401
    if isinstance(one, FrequencyResponse):
        return one.frequency_hz, one.response
    if isinstance(one, StateSpace):
        # Beyond its Nyquist frequency a sampled model has no response of its own.
        top = np.inf if one.dt_s is None else 0.5 / one.dt_s
        at = grid[grid <= top]
        return at, one.frequency_response(2.0 * np.pi * at)[:, 0, 0]
    return grid, np.asarray(one.response(grid), dtype=np.complex128)


def _in_order(named: list[tuple[str, Any]]) -> list[str]:
    """Return the colours: one measurement is orange, one model blue, as in all pictures."""
    kinds = [isinstance(one, FrequencyResponse) for _, one in named]
    if len(kinds) == 2 and sum(kinds) == 1:
        return [current().first if kind else current().last for kind in kinds]
    return [colour for _, colour in zip(named, colours(), strict=False)]


def _of_coherence(colour: str, measured: list[FrequencyResponse]) -> str:
    return current().third if len(measured) == 1 else colour


def _third(axes: Axes, uncertainty: tuple[ArrayLike, ArrayLike] | None, *, coherent: bool) -> None:
    top = 1.05
    if uncertainty is not None:
        at, bound = (np.asarray(part, dtype=np.float64) for part in uncertainty)
        axes.plot(at, bound, color=current().last, linestyle=":", label="uncertainty")
        top = max(top, min(2.0, 1.05 * float(np.max(bound))))
    axes.set_ylim(0.0, top)
    names = ["coherence"] * coherent + ["uncertainty"] * (uncertainty is not None)
    axes.set_ylabel(", ".join(names))
    axes.legend(loc="center left")


def _decibels(response: Complex) -> Array:
    """Return the magnitude in dB; NaN, which is not drawn, for 0."""
    size = np.abs(response)
    found = 20.0 * np.log10(np.where(size > 0.0, size, 1.0))
    return np.where(size > 0.0, found, np.nan)
