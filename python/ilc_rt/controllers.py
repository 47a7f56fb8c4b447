"""The two ways to run the controller: as a process, or inside this one.

Both give the same lines of events. A bus between processes gets a process
with a real-time thread; ``loopback:`` and laws written in Python run inside
this process.
"""

from __future__ import annotations

import contextlib
import selectors
import signal
import time
from typing import TYPE_CHECKING, Any, Protocol

from ilc_rt._native import run_events
from ilc_rt.errors import EXIT_BAD_INPUT, EXIT_FAULT, CampaignError
from ilc_rt.processes import Program, find_program

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ilc_rt._native import EventStream

STOP_DEADLINE_S = 30.0
DRIVES_DIED_DEADLINE_S = 15.0


class Controller(Protocol):
    """A controller that is about to run."""

    def lines(self) -> Iterator[str]:
        """Yield one event per line until the controller ends."""

    def interrupt(self, number: int = signal.SIGINT) -> None:
        """Request a controlled stop; `lines` continues until the axes are at rest."""

    def failure(self) -> CampaignError | None:
        """Return the reason for the controller's end; None if it finished."""

    def close(self) -> None:
        """Stop the axes if they still move, then end and reap everything."""


class ProcessController:
    """`ilc-rt run --events`, or another verb, in a process.

    Simulated drives, if given, end with the controller.
    """

    def __init__(
        self, cell_file: str, arguments: list[str], drives: Program | None, *, verb: str = "run"
    ) -> None:
        self._drives = drives
        self._stop_by: float | None = None
        try:
            controller = str(find_program("ilc-rt"))
            argv = [controller, verb, cell_file, "--events", "--with-parent", *arguments]
            self._controller = Program(argv)
        except BaseException:
            self._close_drives()
            raise

    def lines(self) -> Iterator[str]:
        """Yield one event per line until the controller ends."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._controller, selectors.EVENT_READ)
            if self._drives is not None:
                selector.register(self._drives, selectors.EVENT_READ)
            while not self._controller.at_end:
                for key, _ in selector.select(0.5):
                    program = key.fileobj
                    assert isinstance(program, Program)
                    program.receive()
                    if program.at_end:
                        selector.unregister(program)
                        # The controller detects the silence; this only bounds the wait.
                        self._must_stop_within(DRIVES_DIED_DEADLINE_S)
                while self._controller.lines:
                    yield self._controller.lines.pop(0)
                if self._stop_by is not None and time.monotonic() > self._stop_by:
                    self._controller.signal(signal.SIGKILL)
                    message = "the controller did not stop in time and was ended"
                    raise self._with_cause(CampaignError(message))

    def interrupt(self, number: int = signal.SIGINT) -> None:
        """Request a controlled stop; `lines` continues until the axes are at rest."""
        self._controller.signal(number)
        self._must_stop_within(STOP_DEADLINE_S)

    def failure(self) -> CampaignError | None:
        """Return the reason for the controller's end; None if it finished."""
        if not self._controller.at_end:
            return None
        error = self._controller.failure()
        code = self._controller.returncode
        if code in {0, 128 + signal.SIGINT, 128 + signal.SIGTERM}:
            return None
        return self._with_cause(error)

    def close(self) -> None:
        """Stop the axes if they still move, then end and reap everything."""
        try:
            if self._controller.returncode is None:
                self.interrupt()
                for _ in self.lines():
                    pass
        finally:
            self._controller.close()
            self._close_drives()

    def _must_stop_within(self, seconds: float) -> None:
        if self._stop_by is None:
            self._stop_by = time.monotonic() + seconds

    def _with_cause(self, error: CampaignError) -> CampaignError:
        """Add the death of the simulated drives, if they died."""
        if self._drives is None or self._drives.returncode is None:
            return error
        cause = self._drives.failure().reason
        message = f"{error.reason} (the simulated drives ended: {cause})"
        return CampaignError(message, error.exit_code, drives_ended=cause)

    def _close_drives(self) -> None:
        if self._drives is not None:
            self._drives.close()


class InProcessController:
    """The controller inside this process, for ``loopback:`` and Python laws.

    `options` are the arguments of ``_native.run_events``; `drives` simulated ones in a process, for
    a bus other than ``loopback:``.
    """

    def __init__(self, options: dict[str, Any], drives: Program | None = None) -> None:
        self._options = options
        self._drives = drives
        self._asked: int | None = None
        self._error: CampaignError | None = None
        self._stream: EventStream | None = None

    def lines(self) -> Iterator[str]:
        """Yield one event per line until the controller ends."""
        try:
            self._stream = run_events(**self._options)
            if self._asked is not None:
                self._stream.stop(self._asked)
            yield from self._stream
        except (ValueError, OSError) as error:
            self._error = CampaignError(str(error), EXIT_BAD_INPUT)
        raised = self._stream.raised() if self._stream is not None else None
        if raised is not None:
            # That of a law written in Python, with its traceback.
            self._error = self._error or CampaignError(str(raised), EXIT_FAULT)
            self._error.__cause__ = raised

    def interrupt(self, number: int = signal.SIGINT) -> None:
        """Request a controlled stop; `lines` continues until the axes are at rest."""
        self._asked = number
        if self._stream is not None:
            self._stream.stop(number)

    def failure(self) -> CampaignError | None:
        """Return the reason for the controller's end; None if it finished."""
        return self._error

    def close(self) -> None:
        """Stop the axes if they still move, then end and reap everything."""
        if self._stream is not None:
            self.interrupt()
            # The events end when the axes are at rest; the drives must live until then.
            with contextlib.suppress(ValueError, OSError):
                for _ in self._stream:
                    pass
        if self._drives is not None:
            self._drives.close()
