"""Converts Ctrl-C and requests to end into a controlled stop of the axes.

A plain KeyboardInterrupt would unwind this process while axes move. Instead the first signal
requests a stop of the controller; its further events are still read, and the exception is raised
when the axes are at rest.
"""

from __future__ import annotations

import signal
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType, TracebackType

    from typing_extensions import Self

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_UNTOUCHED = (signal.SIG_DFL, signal.default_int_handler)


class ControlledStop:
    """Call `stop` on the first signal; raise on the second, or at the end.

    `stop` receives the number of the signal.

    Notes
    -----
    Handlers are replaced only if they are Python's own, and only in the main thread, where Python
    allows it.

    Examples
    --------
    >>> with ControlledStop(lambda number: print("stop:", number.name)) as stop:
    ...     signal.raise_signal(signal.SIGTERM)
    stop: SIGTERM
    """

    def __init__(self, stop: Callable[[signal.Signals], None]) -> None:
        self.received: signal.Signals | None = None
        self._stop = stop
        self._replaced: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        """Replace the signal handlers."""
        if threading.current_thread() is threading.main_thread():
            for number in STOP_SIGNALS:
                if signal.getsignal(number) in _UNTOUCHED:
                    self._replaced[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Restore the signal handlers."""
        for number, handler in self._replaced.items():
            signal.signal(number, handler)
        self._replaced.clear()

    def raise_received(self) -> None:
        """Raise the exception of a received signal.

        KeyboardInterrupt after SIGINT; SystemExit after SIGTERM and SIGHUP, with 128 plus the
        number.
        """
        if self.received is signal.SIGINT:
            raise KeyboardInterrupt
        if self.received is not None:
            raise SystemExit(128 + self.received)

    def _handle(self, number: int, _frame: FrameType | None) -> None:
        again = self.received is not None
        self.received = signal.Signals(number)
        if again:
            self.raise_received()
        self._stop(self.received)
