"""Addresses that a server listens on; imported by the dashboard, the bridges and their verbs."""

from __future__ import annotations

import contextlib
import ipaddress


def is_local(host: str) -> bool:
    """Return whether only this computer reaches a server at this address.

    Examples
    --------
    >>> is_local("127.0.0.1"), is_local("localhost"), is_local("0.0.0.0")
    (True, True, False)
    """
    if host == "localhost":
        return True
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return False


def reached(host: str, port: int) -> str:
    """Return where this computer reaches a server that listens at this address.

    Examples
    --------
    >>> reached("192.168.1.5", 80), reached("0.0.0.0", 80), reached("::", 80)
    ('192.168.1.5:80', '127.0.0.1:80', '[::1]:80')
    """
    with contextlib.suppress(ValueError):
        address = ipaddress.ip_address(host)
        if address.is_unspecified:
            host = "127.0.0.1" if address.version == 4 else "::1"
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def unusable(host: str, port: int, reason: object) -> str:
    """Return in words that a server cannot listen at this address.

    Examples
    --------
    >>> unusable("127.0.0.1", 80, "Permission denied")
    '--host 127.0.0.1 --port 80: Permission denied; an own address and a free port are needed'
    """
    return f"--host {host} --port {port}: {reason}; an own address and a free port are needed"
