"""Formatting of numbers: three digits, a unit with a suitable prefix, a change in percent."""

from __future__ import annotations

import math
from dataclasses import dataclass

# Change beyond which a percentage is meaningless.
CHANGE_MAX_PERCENT = 1e4
# Units with a prefix; any other one is shown as it is.
BASES = ("m", "rad", "m/s", "rad/s")
PREFIXES = ((1e3, "m"), (1e6, "µ"), (1e9, "n"))
FORCES = {"N": "m", "N m": "rad"}
"""Units of a force, with those of the position that it moves."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Display unit of a quantity in metres or radians.

    Attributes
    ----------
    symbol : str
        Its symbol, ``"µm"``.
    base : str
        Its base unit, ``"m"``.
    scale : float
        Number of these per metre or radian.

    Examples
    --------
    >>> unit_for("m", 2.283e-3).text(134e-6)
    '134 µm'
    """

    symbol: str
    base: str
    scale: float

    def number(self, value: float | None) -> str:
        """Return a quantity as a number in this unit; ``-`` if it is None."""
        return "-" if value is None else digits(value * self.scale)

    def text(self, value: float | None) -> str:
        """Return a quantity with its unit; ``-`` if it is None."""
        return "-" if value is None else f"{self.number(value)} {self.symbol}"


def unit_for(base: str, size: float | None) -> Unit:
    """Return a suitable unit for a quantity of this size.

    `size` is that of the quantity, or of the first of a row of quantities; `base` is ``"m"``,
    ``"rad"``, ``"m/s"`` or ``"rad/s"``, or any other unit, which gets no prefix.

    Examples
    --------
    >>> unit_for("m", 1e-3).symbol, unit_for("rad", 0.02).symbol, unit_for("m", 4e-8).symbol
    ('µm', 'mrad', 'nm')
    """
    if base not in BASES:
        return Unit(base, base, 1.0)
    largest = abs(size) if size is not None and math.isfinite(size) else 0.0
    if largest >= 1e-2:
        scale, prefix = PREFIXES[0]
    elif 0.0 < largest < 1e-7:
        scale, prefix = PREFIXES[2]
    else:
        scale, prefix = PREFIXES[1]
    return Unit(prefix + base, base, scale)


def axis_unit(input_unit: str) -> str:
    """Return the unit of the position of an axis, m or rad, by that of its learned input.

    Examples
    --------
    >>> axis_unit("rad/s"), axis_unit("m"), axis_unit("N m")
    ('rad', 'm', 'rad')
    """
    return FORCES.get(input_unit, input_unit.removesuffix("/s"))


def digits(value: float) -> str:
    """Return a number with three significant digits, if possible without an exponent.

    Examples
    --------
    >>> digits(1234.56), digits(4.5678), digits(0.0), digits(float("nan"))
    ('1235', '4.57', '0.00', '-')
    """
    size = abs(value)
    if not math.isfinite(size):
        return "-"
    if size >= 1e9:
        return f"{value:.2e}"
    if size >= 100.0:
        return f"{value:.0f}"
    if size >= 10.0:
        return f"{value:.1f}"
    if size >= 1.0 or size < 5e-5:
        return f"{value:.2f}"
    return f"{value:.3f}" if size >= 0.1 else f"{value:.4f}"


def percent(before: float | None, after: float | None) -> float | None:
    """Return a change in percent; None if a percentage is meaningless.

    Examples
    --------
    >>> percent(200.0, 50.0), percent(0.0, 1.0), percent(1e-20, 1.0)
    (-75.0, None, None)
    """
    if before is None or after is None or not before > 0.0:
        return None
    change = (after / before - 1.0) * 100.0
    return change if abs(change) <= CHANGE_MAX_PERCENT else None


def signed(before: float | None, after: float | None) -> str:
    """Return a signed relative change; an empty text if it is undefined.

    Examples
    --------
    >>> signed(200.0, 50.0), signed(1.0, 3.0), signed(0.0, 3.0)
    ('-75.0 %', '+200.0 %', '')
    """
    change = percent(before, after)
    if change is None:
        return ""
    text = f"{change:+.1f} %"
    return "0.0 %" if text[1:] == "0.0 %" else text


def in_words(before: float | None, after: float | None) -> str:
    """Return a relative change in words; an empty text if it is undefined.

    Examples
    --------
    >>> in_words(200.0, 50.0), in_words(1.0, 3.0)
    ('75.0 % less', '200.0 % more')
    """
    change = percent(before, after)
    if change is None:
        return ""
    return f"{abs(change):.1f} % {'more' if change > 0.0 else 'less'}"
