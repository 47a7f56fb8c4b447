"""Port numbers that one test has for itself, among the parallel processes of a test run.

Any test that opens a bus or an endpoint may import it.
"""

from __future__ import annotations

import random
import socket

#: Below the ephemeral ports, which the system assigns by itself (from 32,768 on Linux).
PORTS = range(10_240, 32_768)
GROUP = "239.74.163.2"

_draw = random.SystemRandom()
#: Reservations, kept until the process ends.
_held: list[socket.socket] = []


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """Return a free port that no other call returns while this process lives.

    The number is reserved by a socket of the other kind (TCP for a UDP port), which therefore
    hinders no program that is to open it.
    """
    other = socket.SOCK_STREAM if kind == socket.SOCK_DGRAM else socket.SOCK_DGRAM
    while True:
        port = _draw.choice(PORTS)
        reservation = socket.socket(type=other)
        try:
            reservation.bind(("127.0.0.1", port))
            with socket.socket(type=kind) as probe:
                probe.bind(("", port))
        except OSError:
            reservation.close()
            continue
        _held.append(reservation)
        return port


def free_bus() -> str:
    """Return the address of a UDP bus that no other test is on."""
    return f"udp:{GROUP}:{free_port()}"
