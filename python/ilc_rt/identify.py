"""Identification: excite an axis, measure its response, and fit a model to it.

`swept_sine` and `multisine` run a whole experiment, on a cell's real loop or on any function from
input to output; the other names are its steps.
"""

from __future__ import annotations

import tempfile
from contextlib import ExitStack, closing
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ilc_rt._native import (
    Cell,
    ModelError,
    evaluate_experiment,
    identify_axis,
    single_experiment,
)
from ilc_rt.campaign import Campaign, Drives, load_cell
from ilc_rt.errors import BadInputError
from ilc_rt.experiment import Experiment
from ilc_rt.fits import (
    RationalFit,
    SecondOrderFit,
    VelocityLoopFit,
    fit_rational,
    fit_second_order,
    fit_velocity_loop,
)
from ilc_rt.identification import Identification
from ilc_rt.options import arguments, options
from ilc_rt.response import FrequencyResponse, excitation, frequency_response, uncertainty

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ilc_rt.events import Event

    Array = NDArray[np.float64]
    System = str | Path | Cell | Callable[[Array], Array]
    Observer = Callable[[Event], None]

PERIODS = int(options("identify")["periods"].default or 0)


def swept_sine(
    system: System,
    *,
    spacing: Literal["logarithmic", "linear"] = "logarithmic",
    **options: Any,  # noqa: ANN401 (those of `multisine`)
) -> Identification:
    """Identify an axis with a swept sine (chirp).

    Parameters
    ----------
    system : path, Cell or callable
        A cell, whose axis is excited by the real controller, or a function
        from input to output, both of shape (n_samples,).
    spacing : {"logarithmic", "linear"}
        Logarithmic (more time for low frequencies) or linear sweep.
    **options
        All parameters of `multisine`.

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
    return identify(system, waveform=waveforms[spacing], **options)


def multisine(
    system: System,
    *,
    axis: str | None = None,
    amplitude: float | None = None,
    from_hz: float | None = None,
    to_hz: float | None = None,
    period_s: float | None = None,
    periods: int = PERIODS,
    dt_s: float | None = None,
    at_m: float | None = None,
    measure: Literal["encoder", "tcp"] | None = None,
    bus: str | None = None,
    lockstep: bool | None = None,
    drives: Drives = "auto",
    library: str | Path | None = None,
    require_rt: bool = False,
    reset_faults: bool = False,
    home: bool = False,
    record: str | Path | None = None,
    telemetry: bool = True,
    observe: Observer | None = None,
    tell: Callable[[str], None] | None = None,
    duration_s: None = None,
) -> Identification:
    """Identify an axis with all harmonics of a period at once (multisine).

    Parameters
    ----------
    system : path, Cell or callable
        A cell, whose axis is excited by the real controller while the others
        hold still, or a function from input to output, both of shape
        (n_samples,).
    axis : str or None
        Name of the cell's axis; optional if it has only one.
    amplitude : float or None
        Peak of the input in its unit: m, m/s, N, rad, rad/s or N m; half of the largest possible
        one if None, 90 % of a torque. Required for a function.
    from_hz, to_hz : float or None
        Band in Hz. Without `to_hz` a cell's axis is excited up to 1.5 times the natural frequency
        in its description; if friction or a flexible mode spoils the fit, again in narrower bands,
        which permit a larger amplitude. A function is excited from 1 to 50 Hz.
    period_s : float or None
        Length of a period in seconds; its inverse is the resolution in Hz. None for 8 s, or more if
        the natural frequency is low.
    periods : int
        Evaluated periods; their scatter is the noise.
    dt_s : float or None
        Sample time in seconds, for a function; a cell has its own.
    at_m : float or None
        Position that the axis is excited around; the program's start if None.
    measure, bus, lockstep, drives, require_rt, reset_faults, home, record, telemetry
        As for `Campaign`; a second experiment has a file of its own, NAME-2.mcap.
    library : path or None
        Library that the experiment is stored in; None for no library.
    observe : callable or None
        Called with every event of the controller.
    tell : callable or None
        Called with a sentence on every band tried.
    duration_s : None
        Former name of `period_s`; refused.

    Raises
    ------
    CampaignError
        If the experiment is beyond a limit of the axis (before anything moves), or the controller
        stopped.
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
    return identify(
        system, waveform="multisine", axis=axis, amplitude=amplitude, from_hz=from_hz, to_hz=to_hz,
        period_s=period_s, periods=periods, dt_s=dt_s, at_m=at_m, measure=measure, bus=bus,
        lockstep=lockstep, drives=drives, library=library, require_rt=require_rt,
        reset_faults=reset_faults, home=home, record=record, telemetry=telemetry, observe=observe,
        tell=tell, duration_s=duration_s,
    )  # fmt: skip


def identify(
    system: System,
    *,
    waveform: str = "multisine",
    axis: str | None = None,
    amplitude: float | None = None,
    from_hz: float | None = None,
    to_hz: float | None = None,
    period_s: float | None = None,
    periods: int = PERIODS,
    dt_s: float | None = None,
    at_m: float | None = None,
    library: str | Path | None = None,
    observe: Observer | None = None,
    tell: Callable[[str], None] | None = None,
    duration_s: float | None = None,
    **session: Any,  # noqa: ANN401 (those of `Campaign`)
) -> Identification:
    """Identify an axis with a waveform given by name.

    Parameters
    ----------
    system : path, Cell or callable
        As for `multisine`, like all arguments not listed here.
    waveform : {"sweep", "linear-sweep", "multisine"}
        Waveform of the excitation.
    **session
        Keywords of `Campaign`.

    Raises
    ------
    ValueError, CampaignError
        As `multisine`.
    """
    if duration_s is not None:
        message = f"duration_s = {duration_s}: the length of a period is now period_s"
        raise ValueError(message)
    asked = {
        "axis": axis, "waveform": waveform, "amplitude": amplitude, "from_hz": from_hz,
        "to_hz": to_hz, "period_s": period_s, "periods": periods, "at_m": at_m,
    }  # fmt: skip
    words = arguments("identify", asked)
    if callable(system):
        session |= {"axis": axis, "at_m": at_m, "library": library, "observe": observe}
        unset = (None, "auto", True, False)
        given = [name for name, value in session.items() if not any(value is one for one in unset)]
        if given:
            message = f"{', '.join(given)}: for a cell only"
            raise ValueError(message)
        if dt_s is None or amplitude is None:
            message = "dt_s and amplitude are needed for a function"
            raise ValueError(message)
        return _excite_function(system, Experiment(**single_experiment(words)), float(dt_s))
    if dt_s is not None:
        message = f"dt_s = {dt_s}: a cell has a servo cycle of its own"
        raise ValueError(message)
    cell = system if isinstance(system, Cell) else load_cell(system)
    with ExitStack() as stack:
        if library is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="ilc-identify-"))
            library = Path(folder) / "experiment.db"
        campaign = Campaign(cell, library=library, **session)
        recording, numbers = campaign.record, count(1)

        def excite(figures: dict[str, Any]) -> tuple[Array, Array]:
            campaign.experiment = Experiment(**figures)
            campaign.record = _numbered(recording, next(numbers))
            with closing(campaign.events(1)) as events:
                for event in events:
                    if observe is not None:
                        observe(event)
            if not campaign.result.records:
                message = "the experiment was stopped before it was over"
                raise BadInputError(message)
            record = campaign.result.records[-1]
            return record.input.ravel(), record.error_m.ravel()

        try:
            found = identify_axis(cell, words, excite, tell or (lambda _: None))
        except ModelError:
            raise
        except ValueError as error:
            raise BadInputError(str(error)) from error
    experiment = Experiment(**found.pop("experiment"))
    index = list(cell.axis_names).index(experiment.axis)
    return Identification(
        **_with_models(found),
        dt_s=cell.cycle_s,
        experiment=experiment,
        interface=cell.interfaces[index],
        input_unit=campaign.result.input_unit(index),
    )


def _with_models(found: dict[str, Any]) -> dict[str, Any]:
    """Return the result of an identification, with its response and models as objects."""
    described = found["described"]
    form = VelocityLoopFit if "bandwidth_hz" in described else SecondOrderFit
    return {
        **found,
        "measured": FrequencyResponse(**found["measured"]),
        "model": SecondOrderFit(**found["model"]),
        "described": form(**described),
    }


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
    used = slice(first, first + period * experiment.periods)
    band = {"from_hz": experiment.from_hz, "to_hz": experiment.to_hz}
    signals = {"u": values[used], "y": y[used], "period_samples": period, "dt_s": dt_s}
    found = evaluate_experiment(signals | band)
    return Identification(**_with_models(found), dt_s=dt_s, experiment=experiment)


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
    "identify",
    "multisine",
    "swept_sine",
    "uncertainty",
]


def _numbered(path: str | Path | None, number: int) -> str | Path | None:
    """Return the file of the experiment of a number; a folder names its files itself."""
    if path is None or number == 1 or Path(path).is_dir() or str(path).endswith("/"):
        return path
    path = Path(path)
    return path.with_name(f"{path.stem}-{number}{path.suffix}")
