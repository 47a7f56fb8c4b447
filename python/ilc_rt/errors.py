"""Errors for users: one line, and the exit code of the program."""

from __future__ import annotations

EXIT_FAILURE = 1
EXIT_BAD_INPUT = 2
EXIT_FAULT = 3
EXIT_INTERRUPTED = 130
EXIT_TERMINATED = 143


class CampaignError(RuntimeError):
    """A campaign that could not start, or that was stopped by a fault.

    Parameters
    ----------
    reason : str
        One readable line.
    exit_code : int
        2 for bad input, 3 for a controlled stop after a fault, 1 otherwise.
    drives_ended : str or None
        Reason that simulated drives ended before the controller, if they did.

    Examples
    --------
    >>> str(CampaignError("node 2 is silent", exit_code=3))
    'node 2 is silent'
    """

    def __init__(
        self, reason: str, exit_code: int = EXIT_FAILURE, *, drives_ended: str | None = None
    ) -> None:
        super().__init__(reason)
        self.reason = reason
        self.exit_code = exit_code
        self.drives_ended = drives_ended


class FaultError(CampaignError):
    """A controlled stop after a fault, in its fields.

    Parameters
    ----------
    reason : str
        One readable line.
    exit_code : int
        Exit code of the program.
    kind : str
        Cause, e.g. ``"following_error"``; `docs/events.schema.json` lists all.
    axis, node : str or None, int or None
        Axis and node, if it concerns a single one.
    input : str or None
        Name of the digital input that caused it.
    code : int or None
        Number defined by the kind, e.g. an emergency code.
    value, limit, unit : float or None, float or None, str or None
        Value found, and the limit exceeded.
    late : object or None
        The cycle that lost its deadline before the stop, an `ilc_rt.events.LateCycle`.
    cycles : object or None
        The last servo cycles before the stop, an `ilc_rt.events.LastCycles`.

    Examples
    --------
    >>> FaultError("axis x lags", kind="following_error", axis="x", value=0.02).axis
    'x'
    """

    def __init__(
        self,
        reason: str,
        exit_code: int = EXIT_FAULT,
        *,
        kind: str = "",
        axis: str | None = None,
        node: int | None = None,
        input: str | None = None,
        code: int | None = None,
        value: float | None = None,
        limit: float | None = None,
        unit: str | None = None,
        late: object = None,
        cycles: object = None,
    ) -> None:
        super().__init__(reason, exit_code)
        self.kind, self.axis, self.node, self.code = kind, axis, node, code
        self.input, self.late = input, late
        self.value, self.limit, self.unit = value, limit, unit
        self.cycles = cycles


class BadInputError(CampaignError):
    """An unusable file, option or value."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason, EXIT_BAD_INPUT)


class PlantError(ValueError):
    """An output of a plant that is NaN or infinite.

    Parameters
    ----------
    reason : str
        One readable line.
    trial, sample, channel : int
        Run, sample and output, each from 0.
    value : float or None
        The value found.
    result : object or None
        The `ilc_rt.TrialResult` of the runs before, if a simulation was made.

    Examples
    --------
    >>> PlantError("trial 3, sample 17: the plant returned nan", trial=3, sample=17).sample
    17
    """

    def __init__(
        self,
        reason: str,
        *,
        trial: int = 0,
        sample: int = 0,
        channel: int = 0,
        value: float | None = None,
        result: object = None,
    ) -> None:
        super().__init__(reason)
        self.trial, self.sample, self.channel, self.value = trial, sample, channel, value
        self.result = result


class SweepError(RuntimeError):
    """A case of a sweep that failed.

    Examples
    --------
    >>> str(SweepError("case 3 (mass_kg = 0.0): ZeroDivisionError: division by zero"))[:6]
    'case 3'
    """
