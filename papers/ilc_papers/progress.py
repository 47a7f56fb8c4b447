"""Display of the current computation.

On a terminal a line for each paper with its time, otherwise a line for each step. Only the
command imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import Console
    from rich.progress import TaskID
    from typing_extensions import Self


class ReproductionView:
    """Lines that show the step being computed; plain ones if not a terminal."""

    def __init__(self, console: Console) -> None:
        self._console = console
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop drawing, and leave no line behind."""
        if self._console.is_terminal:
            self._bar.stop()

    def tell(self, name: str, what: str | None) -> None:
        """Show the part of a paper that is being computed; None when it is done."""
        text = "done" if what is None else what
        if not self._console.is_terminal:
            self._console.print(f"{name}: {text}", soft_wrap=True)
            return
        if name not in self._tasks:
            self._tasks[name] = self._bar.add_task(text, name=name, total=None)
        self._bar.update(self._tasks[name], description=text)
        if what is None:
            self._bar.stop_task(self._tasks[name])
