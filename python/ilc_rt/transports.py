"""The kinds of bus, as described by the native module."""

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
        Name before the colon of an address; its syntax; an example.
    summary : str
        Carrier of the frames.
    has_bits : bool
        True for a real bus, whose load is reported.
    in_process : bool
        True if the simulated drives run inside this process, in lock-step.
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
