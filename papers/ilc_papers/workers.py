"""Papers computed two at a time, each in its own process.

No figure depends on concurrent computations. Only the command imports it.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from ilc_papers.outcome import Outcome, compute
from ilc_papers.paper import Paper
from ilc_papers.papers import load
from ilc_rt.errors import CampaignError
from ilc_rt.workers import without_ctrl_c

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

AT_ONCE = 2
_STOP_S = 5.0

_Load = Callable[[str], Paper]


class _Worker(NamedTuple):
    name: str
    process: SpawnProcess
    messages: Connection


def compute_side_by_side(
    names: Sequence[str],
    *,
    reduced: bool,
    tell: Callable[[str, str | None], None],
    load_paper: _Load = load,
    done: dict[str, Outcome] | None = None,
) -> list[Outcome]:
    """Compute several papers, and return them in the order of their names.

    `tell` is called with the name of a paper and the part being computed, None when it is done. If
    a paper cannot be computed, the others are stopped. `done` has the finished papers by their
    names, also after Ctrl-C.
    """
    waiting, running = list(names), list[_Worker]()
    done = {} if done is None else done
    try:
        while waiting or running:
            while waiting and len(running) < AT_ONCE:
                with without_ctrl_c():
                    running.append(_start(waiting.pop(0), load_paper, reduced=reduced))
            ready = cast("list[Connection]", wait([worker.messages for worker in running]))
            for worker in [worker for worker in running if worker.messages in ready]:
                kind, content = _receive(worker)
                if kind == "tell":
                    tell(worker.name, content)
                    continue
                running.remove(worker)
                worker.process.join()
                if kind == "failed":
                    message = f"{worker.name}: {content}"
                    raise CampaignError(message)
                figures, seconds = content
                done[worker.name] = Outcome(load_paper(worker.name), figures, seconds, reduced)
                tell(worker.name, None)
    finally:
        for worker in running:
            worker.process.terminate()
        for worker in running:
            worker.process.join(_STOP_S)
            worker.process.kill()
    return [done[name] for name in names]


def _start(name: str, load_paper: _Load, *, reduced: bool) -> _Worker:
    # A new interpreter for each: a fork would copy threads in mid-operation.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(name, load_paper, reduced, theirs))
    process.start()
    theirs.close()
    return _Worker(name, process, ours)


def _receive(worker: _Worker) -> tuple[str, Any]:
    try:
        message: tuple[str, Any] = worker.messages.recv()
    except EOFError:
        worker.process.join()
        return "failed", f"its process ended with {worker.process.exitcode} and said nothing"
    return message


def _work(name: str, load_paper: _Load, reduced: bool, messages: Connection) -> None:  # noqa: FBT001
    """Compute one paper; the last message is its figures, or the error."""
    parent = multiprocessing.parent_process()

    def tell(what: str) -> None:
        if parent is not None and not parent.is_alive():
            raise SystemExit(1)
        messages.send(("tell", what))

    try:
        outcome = compute(load_paper(name), reduced=reduced, tell=tell)
    except Exception as error:
        messages.send(("failed", f"{type(error).__name__}: {error}"))
    else:
        messages.send(("done", (outcome.figures, outcome.seconds)))
