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


class BadInputError(CampaignError):
    """A file, an option or a value that cannot be used."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason, EXIT_BAD_INPUT)
