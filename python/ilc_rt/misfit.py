"""Values of events that no controller sends; imported by `monitor`.

Any program on the network can publish under the keys of a cell. What passes here can be squared,
counted and drawn.
"""

from __future__ import annotations

import functools
import math
import types
import typing
from dataclasses import fields, is_dataclass
from typing import TypeGuard

from ilc_rt.events import StartEvent

#: Largest number of any kind: its square is finite, and an integer is exact as a float.
INTEGER_MAX = 2**53
NUMBER_MAX = 1e15
AXES_MAX = 64
#: Servo cycles of a batch.
CYCLES_MAX = 10_000
#: Length of the name of a unit, as ``rad/s``.
UNIT_MAX = 16
CYCLE_MIN_S, CYCLE_MAX_S = 1e-6, 1.0


def misfit(event: object) -> str | None:
    """Return what a typed event has that no controller sends; None if there is nothing.

    Examples
    --------
    >>> from ilc_rt.events import StateEvent
    >>> misfit(StateEvent("running", 2**60)), misfit(StateEvent("running", 3))
    ('iteration = 1152921504606846976 is not of its type or range', None)
    """
    kind: type = type(event)
    hints = _hints(kind)
    for field in fields(event):  # type: ignore[arg-type]
        value = getattr(event, field.name)
        if is_dataclass(value):
            inner = misfit(value)
            if inner is not None:
                return f"{field.name}: {inner}"
        elif not _fits(value, hints[field.name]):
            return f"{field.name} = {_shown(value)} is not of its type or range"
    return _misfit_of_start(event) if isinstance(event, StartEvent) else None


@functools.cache
def _hints(kind: type) -> dict[str, object]:
    return typing.get_type_hints(kind)


def _misfit_of_start(start: StartEvent) -> str | None:
    if not CYCLE_MIN_S <= start.cycle_s <= CYCLE_MAX_S:
        return f"cycle_s = {start.cycle_s:g}: {CYCLE_MIN_S:g} to {CYCLE_MAX_S:g} s"
    if start.n_samples < 1:
        return f"n_samples = {start.n_samples}: 1 or more"
    if not 0 < len(start.axis_names) <= AXES_MAX:
        return f"{len(start.axis_names)} axes: 1 to {AXES_MAX}"
    units = start.input_units
    if units and len(units) != len(start.axis_names):
        return f"{len(units)} input_units of {len(start.axis_names)} axes"
    wrong = next((unit for unit in units if not 0 < len(unit) <= UNIT_MAX), None)
    return None if wrong is None else f"input_units: {_shown(wrong)!r}: 1 to {UNIT_MAX} letters"


def _fits(value: object, hint: object) -> bool:
    """Return whether a value has the annotated type; numbers must be finite, and not huge."""
    origin = typing.get_origin(hint)
    if origin in {typing.Union, types.UnionType}:
        return any(_fits(value, one) for one in typing.get_args(hint))
    if origin is tuple:
        kinds = typing.get_args(hint)
        if not isinstance(value, tuple):
            return False
        if len(kinds) == 2 and kinds[1] is Ellipsis:
            return all(_fits(item, kinds[0]) for item in value)
        return len(value) == len(kinds) and all(map(_fits, value, kinds))
    if hint in {int, float}:
        if isinstance(value, bool):
            return False
        if isinstance(value, int):
            return abs(value) <= INTEGER_MAX
        return hint is float and isinstance(value, float) and is_number(value)
    if not (isinstance(hint, type) and isinstance(value, hint)):
        return False
    return not is_dataclass(value) or misfit(value) is None


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a value is a finite number that can be squared.

    Examples
    --------
    >>> is_number(-2.5), is_number(True), is_number(10**400), is_number(float("nan"))
    (True, False, False, False)
    """
    return (
        isinstance(value, (int, float))
        and not isinstance(value, bool)
        and -NUMBER_MAX <= value <= NUMBER_MAX
    )


def _shown(value: object) -> str:
    if isinstance(value, int) and abs(value) > 10**30:
        return f"{math.copysign(1, value):g}e{math.floor(math.log10(abs(value)))}"
    return str(value)[:80]
