"""Display of the current computation.

On a terminal a line for each paper with its time, otherwise a line for each step; both with the
time left where the number of steps is known. Only the command imports it.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from ilc_rt.closing import Closing
from ilc_rt.terminal import duration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rich.console import Console
    from rich.progress import TaskID
    from typing_extensions import Self


class ReproductionView(Closing):
    """Lines that show the step being computed; plain ones if not a terminal.

    Parameters
    ----------
    console : rich.console.Console
        Where they are shown.
    parts : mapping of str to int
        Number of steps of each paper; 0 if it is not known.
    clock : callable
        Returns the time in seconds; only differences count.
    """

    def __init__(
        self,
        console: Console,
        parts: Mapping[str, int] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._console, self._parts, self._clock = console, parts or {}, clock
        #: Number of steps that were begun, and the time of the first, by paper.
        self._begun: dict[str, tuple[int, float]] = {}
        self._bar = Progress(
            SpinnerColumn(),
            TextColumn("{task.fields[name]}"),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
            console=console,
            transient=True,
        )
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Self:
        """Start drawing."""
        if self._console.is_terminal:
            self._bar.start()
        return self

    def close(self) -> None:
        """Stop drawing, and leave no line behind."""
        if self._console.is_terminal:
            self._bar.stop()

    def tell(self, name: str, what: str | None) -> None:
        """Show the part of a paper that is being computed; None when it is done."""
        text = "done" if what is None else f"{what}{self._left(name)}"
        if not self._console.is_terminal:
            self._console.print(f"{name}: {text}", soft_wrap=True)
            return
        if name not in self._tasks:
            self._tasks[name] = self._bar.add_task(text, name=name, total=None)
        self._bar.update(self._tasks[name], description=text)
        if what is None:
            self._bar.stop_task(self._tasks[name])

    def _left(self, name: str) -> str:
        """Return the number of a step that begins, and the time left at the speed so far."""
        now_s = self._clock()
        count, since_s = self._begun.get(name, (0, now_s))
        self._begun[name] = count + 1, since_s
        total = self._parts.get(name, 0)
        if count >= total:
            return ""
        left = ""
        if count:
            left = f", about {duration((now_s - since_s) * (total - count) / count)} left"
        return f" ({count + 1} of {total}{left})"
