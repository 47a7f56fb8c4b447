"""Progress of a long computation with the time left, on standard error; nothing for a short one.

Imported by every verb that may take longer than two seconds. In a terminal one line that is drawn
over and leaves nothing behind; into a pipe a line now and then.
"""

from __future__ import annotations

import time
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING

from rich.console import Console

from ilc_rt.closing import Closing
from ilc_rt.progress import is_live
from ilc_rt.terminal import bar, duration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

#: What is done before is not told.
TOLD_AFTER_S = 2.0
DRAWN_EVERY_S = 0.1
PRINTED_EVERY_S = 10.0
BAR = 20
START_OF_LINE = "\r\x1b[2K"


class Steps(Closing):
    """Progress of one computation.

    Parameters
    ----------
    what : str
        What is counted, in the plural.
    console : rich.console.Console or None
        Where it is shown; standard error if None.
    clock : callable
        Returns the time in seconds; only differences count.
    """

    def __init__(
        self,
        what: str,
        console: Console | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._what, self._clock = what, clock
        self._console = console or Console(stderr=True, highlight=False, markup=False)
        self._since_s = self._clock()
        self._told_s: float | None = None
        self._is_drawn = False

    def tell(self, done: float, total: float) -> None:
        """Show how much is done, if it is time to."""
        elapsed_s = self._elapsed_s()
        if elapsed_s is None or total <= 0:
            return
        share = min(1.0, max(0.0, done / total))
        said = f"{done:.10g} of {total:.10g} {self._what}"
        if 0.0 < share < 1.0:
            said += f", {duration(elapsed_s * (1.0 - share) / share)} left"
        self._show(said, bar(share, BAR, ascii_only=self._console.options.ascii_only) + "  ")

    def tell_time(self, doing: str) -> None:
        """Show how long something takes that cannot tell how far it is, if it is time to."""
        elapsed_s = self._elapsed_s()
        if elapsed_s is not None:
            self._show(f"{doing}, {duration(elapsed_s)} so far")

    @contextmanager
    def clocked(self, doing: str) -> Iterator[None]:
        """Show how long the block takes, from a thread: the block may be a single call."""
        is_over = Event()

        def watch() -> None:
            while not is_over.wait(DRAWN_EVERY_S):
                self.tell_time(doing)

        watcher = Thread(target=watch, name="steps", daemon=True)
        watcher.start()
        try:
            yield
        finally:
            is_over.set()
            watcher.join()
            self.close()

    def begin(self) -> None:
        """Count again, from now on."""
        self.close()
        self._since_s, self._told_s = self._clock(), None

    def close(self) -> None:
        """Leave an empty line to what is printed next."""
        if self._is_drawn:
            self._write(START_OF_LINE)
            self._is_drawn = False

    def _elapsed_s(self) -> float | None:
        """Return the time since the beginning if something is to be told now, else None."""
        now_s = self._clock()
        pause_s = DRAWN_EVERY_S if is_live(self._console) else PRINTED_EVERY_S
        is_early = self._told_s is not None and now_s - self._told_s < pause_s
        if now_s - self._since_s < TOLD_AFTER_S or is_early:
            return None
        self._told_s = now_s
        return now_s - self._since_s

    def _show(self, said: str, before: str = "") -> None:
        """Show a line, in a terminal after something that is drawn."""
        if is_live(self._console):
            self._write(START_OF_LINE + f"{before}{said}"[: self._console.width - 1])
            self._is_drawn = True
        else:
            self._console.print(f"  {said}", soft_wrap=True)

    def _write(self, text: str) -> None:
        self._console.file.write(text)
        self._console.file.flush()
