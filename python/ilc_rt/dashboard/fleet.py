"""All cells that are watched, fed by one thread and read by the pages."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from ilc_rt.dashboard.model import CellModel

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ilc_rt.monitor import Message

CELLS_MAX = 200


class Fleet:
    """All cells that are watched; hold `lock` while reading.

    Parameters
    ----------
    names : iterable of str
        Names of the cells; none for every cell that is heard.
    """

    def __init__(self, names: Iterable[str] = ()) -> None:
        self.lock = threading.Lock()
        self.wanted = tuple(names)
        self.cells: dict[str, CellModel] = {name: CellModel(name) for name in self.wanted}
        #: Messages that the feed has dropped, as they came too fast.
        self.lost = 0

    def apply(self, message: Message, now_s: float, clock_s: float) -> None:
        """Follow a message of any cell."""
        with self.lock:
            cell = self.cells.get(message.cell)
            if cell is None:
                if self.wanted or len(self.cells) >= CELLS_MAX:
                    return
                cell = self.cells[message.cell] = CellModel(message.cell)
            cell.apply(message, now_s, clock_s)
