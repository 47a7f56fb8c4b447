"""The start of worker processes that Ctrl-C leaves to the process that started them.

A terminal interrupts its whole group; the process that answers for all of it ends its workers.
Sweeps and the papers import it.
"""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Start processes that are deaf to Ctrl-C, and put off a Ctrl-C that comes meanwhile.

    Blocked from its birth, a worker is not interrupted while it is still importing. Interrupted
    half-way, this process would leave a worker that it does not know.
    """
    # Started with the first worker, it would lift the block.
    resource_tracker.ensure_running()
    came: list[int] = []
    is_main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    if is_main and before is not None:
        signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if is_main and before is not None:
            signal.signal(signal.SIGINT, before)
    if came:
        signal.raise_signal(signal.SIGINT)
