"""Figures with their units, as people read them.

The terminal and the pages import it; figures in files stay in SI units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ilc_papers.paper import Claim

_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_PREFIXED_UNITS = {"m", "s", "m/s", "N", "V", "rad"}


def pair(ours: float | None, printed: float | None, unit: str) -> tuple[str, str]:
    """Return our figure and the printed one, in one unit that suits them both.

    None shows as a dash.

    Examples
    --------
    >>> pair(8.1234e-5, 8.9e-5, "m")
    ('81.23 µm', '89 µm')
    >>> pair(0.856, None, "")
    ('0.856', '-')
    """
    known = [abs(value) for value in (printed, ours) if value]
    scale, prefix = 1.0, ""
    if unit in _PREFIXED_UNITS and known:
        scale, prefix = next(
            ((s, p) for s, p in _PREFIXES if known[0] >= s), _PREFIXES[-1]
        )  # fmt: skip
    name = f" {prefix}{unit}" if unit else ""
    return _text(ours, scale, name), _text(printed, scale, name)


def _text(value: float | None, scale: float, name: str) -> str:
    return "-" if value is None else f"{value / scale:.4g}{name}"


def verdict(holds: bool | None) -> str:  # noqa: FBT001
    """Return whether a statement holds, in a word.

    Examples
    --------
    >>> verdict(True), verdict(None)
    ('yes', '')
    """
    return {True: "yes", False: "no", None: ""}[holds]


def ratio(claim: Claim) -> str:
    """Return our figure over the printed one; nothing where one of them is missing."""
    return "" if claim.ratio is None else f"{claim.ratio:.2f}"
