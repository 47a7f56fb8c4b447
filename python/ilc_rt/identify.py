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
from typing import TYPE_CHECKING, Any, Literal

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
from ilc_rt.errors import BadInputError
from ilc_rt.experiment import Experiment
from ilc_rt.identification import Identification

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
    from_hz: float = FROM_HZ,
    to_hz: float = TO_HZ,
    duration_s: float = DURATION_S,
    periods: int = PERIODS,
    dt_s: float | None = None,
    at_m: float | None = None,
    measure: Literal["encoder", "tcp"] | None = None,
    bus: str | None = None,
    lockstep: bool | None = None,
    drives: Drives = "auto",
    library: str | Path | None = None,
    observe: Observer | None = None,
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
    from_hz, to_hz : float
        Band in Hz.
    duration_s : float
        Length of a period in seconds; its inverse is the resolution in Hz.
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
        lockstep=lockstep, drives=drives, library=library, observe=observe,
    )  # fmt: skip


def _identify(
    system: System,
    waveform: str,
    *,
    axis: str | None = None,
    amplitude: float | None = None,
    from_hz: float = FROM_HZ,
    to_hz: float = TO_HZ,
    duration_s: float = DURATION_S,
    periods: int = PERIODS,
    dt_s: float | None = None,
    **options: Any,  # noqa: ANN401 (those of `_excite_axis`)
) -> Identification:
    if periods < 2:
        message = f"periods = {periods}: at least 2, as one shows no noise"
        raise ValueError(message)
    experiment = Experiment(
        axis or "", waveform, float(from_hz), float(to_hz), float(duration_s), int(periods),
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
        return _excite_function(system, experiment, float(dt_s))
    if dt_s is not None:
        message = f"dt_s = {dt_s}: a cell has a servo cycle of its own"
        raise ValueError(message)
    cell = system if isinstance(system, Cell) else load_cell(system)
    return _excite_axis(cell, experiment, **options)


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
    name = experiment.axis or (cell.axis_names[0] if cell.n_axes == 1 else "")
    if name not in cell.axis_names:
        message = f"axis = {name or None}: {cell.path} has {', '.join(cell.axis_names)}"
        raise BadInputError(message)
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
    measured = whole.band(experiment.from_hz, experiment.to_hz)
    f, h = measured.frequency_hz, measured.response
    trust: dict[str, Any] = {"coherence": measured.coherence, "n_averages": measured.n_averages}
    model = fit_second_order(f, h, dt_s=dt_s, **trust)
    described: SecondOrderFit | VelocityLoopFit
    if position_gain_per_s is None:
        gain = None if interface is None else 1.0
        whole_s = model.delay_samples * dt_s
        described = fit_second_order(f, h, dt_s=dt_s, gain=gain, delay_s=whole_s, **trust)
    else:
        free = fit_velocity_loop(f, h, position_gain_per_s, dt_s, **trust)
        whole_s = free.delay_samples * dt_s
        described = fit_velocity_loop(f, h, position_gain_per_s, dt_s, delay_s=whole_s, **trust)
    bound = uncertainty(measured, described.response(measured.frequency_hz))
    return Identification(
        measured, model, described, bound, u, y, period, dt_s, experiment, interface
    )


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
