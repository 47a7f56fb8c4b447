"""The kinds of bus, as the native module describes them."""

from __future__ import annotations

from dataclasses import dataclass

from ilc_rt._native import transports
from ilc_rt.errors import BadInputError


@dataclass(frozen=True, slots=True)
class Transport:
    """One kind of bus.

    Attributes
    ----------
    name, syntax, example : str
        Name in front of the colon of an address; its syntax; one that is allowed.
    summary : str
        What carries the frames.
    has_bits : bool
        Whether it is a real bus, whose load counts.
    in_process : bool
        Whether the simulated drives run inside this process, in lock-step.
    """

    name: str
    syntax: str
    example: str
    summary: str
    has_bits: bool
    in_process: bool


TRANSPORTS = {kind["name"]: Transport(**kind) for kind in transports()}
SYNTAXES = ", ".join(kind.syntax for kind in TRANSPORTS.values())


def transport_of(bus: str) -> Transport:
    """Return the kind of bus that an address names.

    Raises
    ------
    BadInputError
        If there is no such kind.

    Examples
    --------
    >>> transport_of("udp:239.74.163.2").name
    'udp'
    """
    name, colon, _ = bus.partition(":")
    if not colon or name not in TRANSPORTS:
        message = f"bus = {bus}: allowed {SYNTAXES}"
        raise BadInputError(message)
    return TRANSPORTS[name]
