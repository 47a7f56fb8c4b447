"""A CiA 402 drive that shares no line with this project: python-canopen's ``LocalNode``.

SDO server, PDO packing, NMT and object dictionary are python-canopen's; the state machine and an
axis that is at its target one SYNC later are written here from the profile.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import canopen

if TYPE_CHECKING:
    from pathlib import Path

SYNC_ID = 0x80
#: State: bits of the statusword, remote and voltage included.
DISABLED, READY, ON, ENABLED, QUICK_STOP = 0x0250, 0x0231, 0x0233, 0x1237, 0x0217


class LocalDrive:
    """A drive on a network of its own.

    Attributes
    ----------
    targets : list of int
        The targets that it has taken over since it was enabled.
    places : list of int
        Its position at each SYNC.
    nmt : list of int
        The NMT commands that it has received.
    """

    def __init__(self, network: canopen.Network, eds: Path, number: int, start_counts: int) -> None:
        self.targets: list[int] = []
        self.places: list[int] = []
        self.nmt: list[int] = []
        self._network = network
        self._state = DISABLED
        self._position = start_counts
        self._velocity = 0
        self._is_operational = False
        self.node = canopen.LocalNode(number, str(eds))
        self.node.add_read_callback(self._read)
        self.node.add_write_callback(self._write)
        network.add_node(self.node)
        network.subscribe(0, self._on_nmt)
        network.subscribe(SYNC_ID, self._on_sync)

    @property
    def is_enabled(self) -> bool:
        """True if it has power."""
        return self._state == ENABLED

    def _number(self, index: int, sub: int = 0) -> int:
        entry = self.node.object_dictionary[index]
        variable = entry if isinstance(entry, canopen.objectdictionary.ODVariable) else entry[sub]
        return int(variable.decode_raw(self.node.get_data(index, sub)))

    def _read(self, index: int, **_: object) -> int | None:
        live = {
            0x6041: self._state,
            0x6061: self._mode(),
            0x6064: self._position,
            0x606C: self._velocity,
            0x6077: 0,
            0x60F4: 0,
        }
        return live.get(index)

    def _mode(self) -> int:
        data = self.node.data_store.get(0x6060, {}).get(0, b"\0")
        return int.from_bytes(data, "little", signed=True)

    def _write(self, index: int, data: bytes, **_: object) -> None:
        if index == 0x6040:
            self._command(int.from_bytes(data, "little"))

    def _command(self, word: int) -> None:
        state = self._state
        if not word & 0x02:
            state = DISABLED
        elif not word & 0x04:
            state = {READY: DISABLED, ON: DISABLED, ENABLED: QUICK_STOP}.get(state, state)
        elif not word & 0x01:
            state = READY if state in (DISABLED, ON, ENABLED) else state
        elif not word & 0x08:
            state = ON if state in (READY, ENABLED) else state
        else:
            state = ENABLED if state in (READY, ON, QUICK_STOP) else state
        self._state = state

    def _on_nmt(self, _: int, data: bytearray, __: float) -> None:
        command, number = data[0], data[1]
        if number not in (0, self.node.id):
            return
        self.nmt.append(command)
        self._is_operational = command == 1
        if command == 1:
            self.node.rpdo.read()
            self.node.tpdo.read()
        if command in (0x81, 0x82):
            # A reset of communication leaves the axis where it is, without power.
            self._state = DISABLED
            self.node.data_store.clear()
            self._network.send_message(0x700 + self.node.id, b"\0")
            self.node.nmt._state = 0x7F

    def _on_sync(self, *_: object) -> None:
        if not self._is_operational:
            return
        before = self._position
        if self._state == ENABLED and self.targets:
            self._position = self.targets[-1]
        self._velocity = self._position - before
        self.places.append(self._position)
        for pdo in self.node.rpdo.values():
            if pdo.enabled and pdo.is_received:
                pdo.is_received = False
                for variable in pdo:
                    self.node.set_data(variable.index, variable.subindex, variable.data)
        if self._state == ENABLED:
            self.targets.append(self._number(0x607A))
        else:
            self.targets.clear()
        for pdo in self.node.tpdo.values():
            if pdo.enabled and pdo.trans_type == 1:
                for variable in pdo:
                    variable.raw = self._number(variable.index, variable.subindex)
                pdo.transmit()
