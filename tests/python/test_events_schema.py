"""The classes of the events against the schema that the controller derives."""

from __future__ import annotations

import json
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import pytest

from ilc_rt.events import _CLASSES
from ilc_rt.events import SCHEMA as SCHEMA_VERSION

GOLDEN = Path(__file__).parents[1] / "golden"
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


def signature(described: dict[str, Any]) -> dict[str, Any]:
    """Return the types of fields, without their descriptions and limits of numbers."""
    return {
        name: {
            key: value for key, value in one.items() if key in {"type", "items", "anyOf", "$ref"}
        }
        for name, one in described.get("properties", {}).items()
    }


def test_within_a_version_fields_are_only_added() -> None:
    """`tests/golden/events-1.json` holds the fields that version 1 began with."""
    assert SCHEMA_VERSION == 1, "a new version has a file of its own"
    golden = json.loads((GOLDEN / "events-1.json").read_text(encoding="utf-8"))
    now = {name: signature(event) for name, event in EVENTS.items()}
    for name, fields_then in golden.items():
        kept = {field: now[name].get(field) for field in fields_then}
        assert kept == fields_then, name
