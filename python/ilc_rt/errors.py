"""Errors that a person can act on: one line, and what the program exits with."""

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
        One line for people.
    exit_code : int
        2 for bad input, 3 for a controlled stop after a fault, 1 otherwise.

    Examples
    --------
    >>> str(CampaignError("node 2 is silent", exit_code=3))
    'node 2 is silent'
    """

    def __init__(self, reason: str, exit_code: int = EXIT_FAILURE) -> None:
        super().__init__(reason)
        self.reason = reason
        self.exit_code = exit_code


class FaultError(CampaignError):
    """A controlled stop after a fault, in its fields.

    Parameters
    ----------
    reason : str
        One line for people.
    exit_code : int
        What the program exits with.
    kind : str
        Cause, as ``"following_error"``; `docs/events.schema.json` lists all.
    axis, node : str or None, int or None
        Where, if it is one axis or node.
    code : int or None
        Number that the kind says, as an emergency code.
    value, limit, unit : float or None, float or None, str or None
        What was found, and the limit that it exceeds.
    cycles : object or None
        The last servo cycles before the stop, a `ilc_rt.events.LastCycles`.

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
        code: int | None = None,
        value: float | None = None,
        limit: float | None = None,
        unit: str | None = None,
        cycles: object = None,
    ) -> None:
        super().__init__(reason, exit_code)
        self.kind, self.axis, self.node, self.code = kind, axis, node, code
        self.value, self.limit, self.unit = value, limit, unit
        self.cycles = cycles


class BadInputError(CampaignError):
    """A file, an option or a value that cannot be used."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason, EXIT_BAD_INPUT)
