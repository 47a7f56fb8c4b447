"""Identification: excite an axis, see how it answers, and fit a model to it.

`swept_sine` and `multisine` make the whole experiment, on a cell's real loop
or on any function from input to output; the other names are its steps.
"""

from __future__ import annotations

import json
import tempfile
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from ilc_rt._native import (
    Cell,
    FrequencyResponse,
    RationalFit,
    SecondOrderFit,
    VelocityLoopFit,
    excitation,
    fit_rational,
    fit_second_order,
    fit_velocity_loop,
    frequency_response,
    uncertainty,
)
from ilc_rt.campaign import Campaign, Drives, load_cell
from ilc_rt.errors import EXIT_BAD_INPUT, BadInputError, CampaignError
from ilc_rt.experiment import Experiment
from ilc_rt.identification import Identification, beyond_cell
from ilc_rt.trials import believed_axes

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ilc_rt.events import Event

    Array = NDArray[np.float64]
    System = str | Path | Cell | Callable[[Array], Array]
    Observer = Callable[[Event], None]

FROM_HZ = 1.0
TO_HZ = 50.0
DURATION_S = 8.0
PERIODS = 5
BAND_SHARES = (1.5, 1.0, 0.75, 0.5)
"""Upper ends of the bands that are tried, relative to the natural frequency that the cell names."""
GOOD_RESIDUAL = 0.12
"""What a model may leave over before a narrower band is tried."""
DELAY_MAX = 20
"""Most cycles of delay that a cell description takes."""
WORTH_A_CYCLE = 1.05
"""Residual relative to the best at which fewer cycles of delay are as good: the data hardly tell a
cycle of delay from a lower natural frequency, and the plainer model learns as well."""
STILL = 1e-6
"""Share of the input below which an output is none."""


def swept_sine(
    system: System,
    *,
    spacing: Literal["logarithmic", "linear"] = "logarithmic",
    **options: Any,  # noqa: ANN401 (those of `multisine`)
) -> Identification:
    """Identify an axis with a sine of rising frequency.

    Parameters
    ----------
    system : path, Cell or callable
        A cell, whose axis is excited by the real controller, or a function
        from input to output, both of shape (n_samples,).
    spacing : {"logarithmic", "linear"}
        Whether low frequencies get more time, or all the same.
    **options
        Everything that `multisine` takes.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError, CampaignError
        As `multisine`.

    References
    ----------
    [pintelon2012], section 5.2.

    Examples
    --------
    >>> from ilc_rt import discretize, second_order
    >>> axis = discretize(second_order(75.0, 0.5), 0.002)
    >>> found = swept_sine(axis.simulate, dt_s=0.002, amplitude=1e-3)
    >>> round(found.model.damping, 3)
    0.5
    """
    waveforms = {"logarithmic": "sweep", "linear": "linear-sweep"}
    if spacing not in waveforms:
        message = f"spacing = {spacing!r}: allowed 'logarithmic' or 'linear'"
        raise ValueError(message)
    return _identify(system, waveforms[spacing], **options)


def multisine(
    system: System,
    *,
    axis: str | None = None,
    amplitude: float | None = None,
    from_hz: float | None = None,
    to_hz: float | None = None,
    duration_s: float | None = None,
    periods: int = PERIODS,
    dt_s: float | None = None,
    at_m: float | None = None,
    measure: Literal["encoder", "tcp"] | None = None,
    bus: str | None = None,
    lockstep: bool | None = None,
    drives: Drives = "auto",
    library: str | Path | None = None,
    observe: Observer | None = None,
    tell: Callable[[str], None] | None = None,
) -> Identification:
    """Identify an axis with all harmonics of a period at once.

    Parameters
    ----------
    system : path, Cell or callable
        A cell, whose axis is excited by the real controller while the others
        hold still, or a function from input to output, both of shape
        (n_samples,).
    axis : str or None
        Name of the cell's axis; may be left out if it has one only.
    amplitude : float or None
        Peak of the input in m (csp) or m/s (csv); half of what the limits of
        the axis allow if None. Must be given for a function.
    from_hz, to_hz : float or None
        Band in Hz. Without `to_hz` a cell's axis is excited up to 1.5 times the
        natural frequency in its description; where friction or a mode spoil the
        fit, again in narrower bands, which leave room for a larger amplitude.
        A function is excited from 1 to 50 Hz.
    duration_s : float or None
        Length of a period in seconds; its inverse is the resolution in Hz. None
        for 8 s, or more where the natural frequency is low.
    periods : int
        Periods that are evaluated; what differs between them is noise.
    dt_s : float or None
        Sample time in seconds, for a function; a cell has its own.
    at_m : float or None
        Where the axis is excited; at the program's start if None.
    measure : {"encoder", "tcp"} or None
        Which measurement to look at, in place of the cell's.
    bus, lockstep, drives
        As for `Campaign`.
    library : path or None
        Where the experiment is kept; nowhere if None.
    observe : callable or None
        Is given every event of the controller.
    tell : callable or None
        Is given a sentence on every band that was tried.

    Returns
    -------
    Identification

    Raises
    ------
    CampaignError
        If the experiment is beyond a limit of the axis (before anything
        moves), or the controller stopped.
    ValueError
        If a value is out of range, or the response cannot be fitted.

    References
    ----------
    [schroeder1970]; [pintelon2012], section 5.2.

    Examples
    --------
    >>> from ilc_rt import discretize, second_order
    >>> axis = discretize(second_order(75.0, 0.5), 0.002)
    >>> found = multisine(axis.simulate, dt_s=0.002, amplitude=1e-3)
    >>> round(found.model.natural_frequency_hz * 2 * np.pi, 3)
    75.0
    """
    return _identify(
        system, "multisine", axis=axis, amplitude=amplitude, from_hz=from_hz, to_hz=to_hz,
        duration_s=duration_s, periods=periods, dt_s=dt_s, at_m=at_m, measure=measure, bus=bus,
        lockstep=lockstep, drives=drives, library=library, observe=observe, tell=tell,
    )  # fmt: skip


def _identify(
    system: System,
    waveform: str,
    *,
    axis: str | None = None,
    amplitude: float | None = None,
    from_hz: float | None = None,
    to_hz: float | None = None,
    duration_s: float | None = None,
    periods: int = PERIODS,
    dt_s: float | None = None,
    tell: Callable[[str], None] | None = None,
    **options: Any,  # noqa: ANN401 (those of `_excite_axis`)
) -> Identification:
    if periods < 2:
        message = f"periods = {periods}: at least 2, as one shows no noise"
        raise ValueError(message)

    def experiment(low_hz: float, high_hz: float, length_s: float) -> Experiment:
        return Experiment(
            axis or "", waveform, float(low_hz if from_hz is None else from_hz),
            float(high_hz if to_hz is None else to_hz),
            float(length_s if duration_s is None else duration_s), int(periods),
            None if amplitude is None else float(amplitude),
        )  # fmt: skip

    if callable(system):
        given = [name for name, value in options.items() if value not in {None, "auto"}]
        if axis is not None or given:
            message = f"{', '.join([*given, *(['axis'] if axis else [])])}: for a cell only"
            raise ValueError(message)
        if dt_s is None or amplitude is None:
            message = "dt_s and amplitude are needed for a function"
            raise ValueError(message)
        return _excite_function(system, experiment(FROM_HZ, TO_HZ, DURATION_S), float(dt_s))
    if dt_s is not None:
        message = f"dt_s = {dt_s}: a cell has a servo cycle of its own"
        raise ValueError(message)
    cell = system if isinstance(system, Cell) else load_cell(system)
    if to_hz is not None:
        return _excite_axis(cell, experiment(FROM_HZ, to_hz, DURATION_S), **options)
    return _search_band(cell, experiment, tell or (lambda _: None), options)


def _search_band(
    cell: Cell,
    experiment: Callable[[float, float, float], Experiment],
    tell: Callable[[str], None],
    options: dict[str, Any],
) -> Identification:
    """Excite an axis in narrower bands until a model fits, and in a wider one if it may."""
    name = _axis_name(cell, experiment(FROM_HZ, TO_HZ, DURATION_S).axis)
    believed = believed_axes(cell)[0][list(cell.axis_names).index(name)]
    expected_hz, highest_hz = believed.natural_frequency_hz, 0.4 / cell.cycle_s
    # The lowest frequency of the band needs five cycles in a period.
    length_s = max(DURATION_S, 25.0 / expected_hz)
    low_hz = max(min(FROM_HZ, 0.1 * expected_hz), 5.0 / length_s)
    found: list[Identification] = []
    refused: CampaignError | None = None
    spoilt_hz = highest_hz

    def excite(high_hz: float) -> Identification:
        result = _excite_axis(cell, experiment(low_hz, high_hz, length_s), **options)
        found.append(result)
        left = f"the model leaves {100.0 * result.described.residual_rms:.0f} %"
        why = left if result.doubt is None else result.doubt.split(":")[0]
        tell(
            f"{result.experiment.from_hz:.3g} to {high_hz:.3g} Hz, amplitude "
            f"{result.experiment.amplitude:.3g}: {why}"
        )
        return result

    for share in BAND_SHARES:
        high_hz = min(share * expected_hz, highest_hz)
        if high_hz < 2.0 * low_hz:
            break
        try:
            result = excite(high_hz)
        except CampaignError as error:
            # An amplitude that was asked for may fit into a narrower band only.
            if error.exit_code != EXIT_BAD_INPUT or found:
                raise
            refused = error
            continue
        if result.doubt is None and result.described.residual_rms <= GOOD_RESIDUAL:
            break
        spoilt_hz = high_hz
    if not found:
        if refused is not None:
            raise refused
        return excite(min(2.5 * low_hz, highest_hz))
    best = _best(found)
    fit = best.described
    own_hz = fit.natural_frequency_hz if isinstance(fit, SecondOrderFit) else 0.0
    wider_hz = min(1.5 * own_hz, highest_hz)
    if best.doubt is None and best.experiment.to_hz < own_hz and wider_hz < 0.99 * spoilt_hz:
        excite(wider_hz)
        if found[-1].doubt is None and found[-1].described.residual_rms <= GOOD_RESIDUAL:
            return found[-1]
    return best


def _best(found: list[Identification]) -> Identification:
    """Return the one that nothing speaks against and that leaves least; else the last."""
    good = [each for each in found if each.doubt is None]
    return min(good, key=lambda each: each.described.residual_rms) if good else found[-1]


def _axis_name(cell: Cell, asked: str) -> str:
    name = asked or (cell.axis_names[0] if cell.n_axes == 1 else "")
    if name not in cell.axis_names:
        message = f"axis = {name or None}: {cell.path} has {', '.join(cell.axis_names)}"
        raise BadInputError(message)
    return name


def _excite_function(
    function: Callable[[Array], Array], experiment: Experiment, dt_s: float
) -> Identification:
    assert experiment.amplitude is not None
    values, first, period = excitation(
        experiment.waveform, experiment.amplitude, experiment.from_hz, experiment.to_hz,
        experiment.period_s, experiment.periods, dt_s,
    )  # fmt: skip
    y = np.asarray(function(values), dtype=np.float64)
    if y.shape != values.shape:
        message = f"the function returned shape {y.shape}; {values.shape}, as its input, is needed"
        raise ValueError(message)
    return _evaluate(values, y, first, period, dt_s, experiment)


def _excite_axis(
    cell: Cell,
    experiment: Experiment,
    *,
    at_m: float | None = None,
    measure: Literal["encoder", "tcp"] | None = None,
    bus: str | None = None,
    lockstep: bool | None = None,
    drives: Drives = "auto",
    library: str | Path | None = None,
    observe: Observer | None = None,
) -> Identification:
    name = _axis_name(cell, experiment.axis)
    with ExitStack() as stack:
        if library is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="ilc-identify-"))
            library = Path(folder) / "experiment.db"
        campaign = Campaign(
            cell, library=library, bus=bus, measure=measure, lockstep=lockstep, drives=drives
        )
        campaign.experiment = replace(experiment, axis=name, at_m=at_m)
        with closing(campaign.events(1)) as events:
            for event in events:
                if observe is not None:
                    observe(event)
        if not campaign.result.records:
            message = "the experiment was stopped before it was over"
            raise BadInputError(message)
        record = campaign.result.records[-1]
        done = json.loads(record.law_parameters)
        index = list(cell.axis_names).index(name)
        # The set point rests, so what the error changes by is the measurement.
        u, y = record.input[:, index], -record.error_m[:, index]
    return _evaluate(
        u, y, int(done["first_sample"]), int(done["period_samples"]), cell.cycle_s,
        replace(campaign.experiment, amplitude=float(done["amplitude"])),
        cell.interfaces[index], cell.position_gains_per_s[index],
    )  # fmt: skip


def _evaluate(
    u: Array,
    y: Array,
    first: int,
    period: int,
    dt_s: float,
    experiment: Experiment,
    interface: Literal["csp", "csv"] | None = None,
    position_gain_per_s: float | None = None,
) -> Identification:
    used = slice(first, first + period * experiment.periods)
    u, y = np.ascontiguousarray(u[used]), np.ascontiguousarray(y[used])
    whole = frequency_response(u, y, dt_s, period_samples=period)
    measured = _without_rounding(whole.band(experiment.from_hz, experiment.to_hz), u, y)
    f, h = measured.frequency_hz, measured.response
    trust: dict[str, Any] = {"coherence": measured.coherence, "n_averages": measured.n_averages}
    model = fit_second_order(f, h, dt_s=dt_s, **trust)
    described: SecondOrderFit | VelocityLoopFit
    if interface is None:
        delay_s = model.delay_samples * dt_s
        described = fit_second_order(f, h, dt_s=dt_s, delay_s=delay_s, **trust)
    elif position_gain_per_s is None:
        described = _plainest(
            [
                fit_second_order(f, h, dt_s=dt_s, gain=1.0, delay_s=n * dt_s, **trust)
                for n in range(_delays(model, dt_s))
            ]
        )
    else:
        described = _plainest(
            [
                fit_velocity_loop(f, h, position_gain_per_s, dt_s, delay_s=n * dt_s, **trust)
                for n in range(_delays(model, dt_s))
            ]
        )
    bound = uncertainty(measured, described.response(measured.frequency_hz))
    return Identification(
        measured, model, described, bound, u, y, period, dt_s, experiment, interface
    )


def _without_rounding(measured: FrequencyResponse, u: Array, y: Array) -> FrequencyResponse:
    """Return the response of an axis that rests as that of nothing, not as one of rounding."""
    if np.ptp(y) > STILL * np.ptp(u):
        return measured
    nothing = np.zeros(len(measured.frequency_hz))
    return FrequencyResponse(
        measured.frequency_hz, nothing + 0j, coherence=nothing, n_averages=measured.n_averages
    )


def _delays(model: SecondOrderFit, dt_s: float) -> int:
    """Return how many whole delays are tried, from none to two beyond the one that was found."""
    found = int(np.clip(np.ceil(model.delay_s / dt_s), 0, DELAY_MAX - 2))
    return found + 3


_Fit = TypeVar("_Fit", SecondOrderFit, VelocityLoopFit)


def _plainest(fits: list[_Fit]) -> _Fit:
    """Return the fit of least delay among those that a cell can take and that leave least."""
    possible = [fit for fit in fits if beyond_cell(fit) is None] or fits
    least = min(fit.residual_rms for fit in possible)
    near = (fit for fit in possible if fit.residual_rms <= WORTH_A_CYCLE * least)
    return next(near, possible[0])


__all__ = [
    "Experiment",
    "FrequencyResponse",
    "Identification",
    "RationalFit",
    "SecondOrderFit",
    "VelocityLoopFit",
    "excitation",
    "fit_rational",
    "fit_second_order",
    "fit_velocity_loop",
    "frequency_response",
    "multisine",
    "swept_sine",
    "uncertainty",
]
