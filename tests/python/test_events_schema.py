"""The classes of the events against the schema that the controller derives."""

from __future__ import annotations

import json
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import pytest

from ilc_rt.events import _CLASSES

SCHEMA = json.loads(
    Path(__file__).parents[2].joinpath("docs/events.schema.json").read_text(encoding="utf-8")
)
EVENTS: dict[str, dict[str, Any]] = {
    event["properties"]["event"]["const"]: event for event in SCHEMA["oneOf"]
}


def test_every_event_of_the_controller_has_a_class() -> None:
    """None is missing, and none is left over."""
    assert set(_CLASSES) == set(EVENTS)


@pytest.mark.parametrize("name", sorted(EVENTS))
def test_a_class_has_the_fields_of_its_event(name: str) -> None:
    """By name; what the class needs the controller always sends."""
    described = {field.name: field for field in fields(_CLASSES[name])}
    assert set(described) == set(EVENTS[name]["properties"]) - {"event"}
    needed = {name for name, field in described.items() if field.default is MISSING}
    optional = set(EVENTS[name]["properties"]) - set(EVENTS[name]["required"])
    assert not needed & optional
