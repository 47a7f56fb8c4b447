"""Buttons and guards of a machine whose drives and controller are processes of their own."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from processes_fixture import PATIENT, Bench, program

from ilc_rt.events import FaultEvent, InputsEvent, InputState, parse_event

if TYPE_CHECKING:
    from collections.abc import Iterator

FEEDER = Path(__file__).resolve().parents[2] / "examples" / "08_inputs.toml"


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


@pytest.fixture
def feeder(bench: Bench) -> Path:
    """Return the feeder, which tolerates a busy machine."""
    path = bench.folder / "feeder.toml"
    text = FEEDER.read_text().replace("[safety]\n", f"{PATIENT.lstrip()}", 1)
    path.write_text(text)
    return path


def press(bench: Bench, cell: Path, name: str, state: str) -> None:
    """Switch an input of the simulated drives."""
    subprocess.run(
        [program("ilc-sim"), "input", cell, name, state, "--bus", bench.bus],
        check=True, capture_output=True, text=True, timeout=60,
    )  # fmt: skip


def status(bench: Bench, cell: Path) -> dict[str, bool | None]:
    """Return the named inputs as `ilc-rt status` tells them."""
    done = subprocess.run(
        [program("ilc-rt"), "status", cell, "--bus", bench.bus, "--json", "-"],
        check=True, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    named = json.loads(done.stdout)["axes"][0]["named_inputs"]
    return {one["name"]: one["on"] for one in named}


@pytest.mark.parametrize("pace", [(), ("--lockstep",)], ids=["clock", "lockstep"])
def test_each_run_starts_at_a_press_and_an_open_door_ends_it(
    bench: Bench, feeder: Path, pace: tuple[str, ...]
) -> None:
    bench.drives(feeder, *pace)
    assert status(bench, feeder) == {"door": True, "go": False, "halt": False, "far end": False}
    controller = bench.controller(feeder, *pace, "--simulated-drives", "--start", "input", runs=5)
    for run in range(2):
        controller.event(event="state", state="waiting", iteration=run)
        press(bench, feeder, "go", "on")
        controller.event(event="state", state="running", iteration=run)
        press(bench, feeder, "go", "off")
    controller.event(event="state", state="waiting", iteration=2)
    press(bench, feeder, "door", "off")
    assert controller.end() == 3
    assert "guard door (bit 16 of 0x60FD of axis x, node 1) is open" in controller.errors[-1]
    assert [kept[1] for kept in bench.kept()] == [0, 1]
    events = [parse_event(line) for line in controller.said]
    fault = next(event for event in events if isinstance(event, FaultEvent))
    assert (fault.kind, fault.input, fault.axis, fault.code) == ("guard_open", "door", "x", 16)
    told = [event for event in events if isinstance(event, InputsEvent)]
    assert told[0].inputs[0] == InputState("door", "guard", on=True)
    assert told[-1].inputs[0] == InputState("door", "guard", on=False)
    # While it is open, nothing starts; afterwards a person starts again.
    again = bench.controller(feeder, *pace, "--simulated-drives", runs=1)
    assert again.end() == 2
    assert "close it, then start again; nothing has moved" in again.errors[-1]
    press(bench, feeder, "door", "on")
    last = bench.controller(feeder, *pace, "--simulated-drives", runs=1)
    assert last.end() == 0, last.errors


def test_the_stop_button_is_the_regular_end(bench: Bench, feeder: Path) -> None:
    bench.drives(feeder)
    controller = bench.start(
        "ilc-rt", "run", feeder, "--bus", bench.bus, "--library", bench.library, "--events",
        "--no-telemetry", "--simulated-drives", "--forever",
    )  # fmt: skip
    controller.event(event="iteration", index=1)
    press(bench, feeder, "halt", "on")
    assert controller.end() == 0, controller.errors
    end = controller.events[-1]
    assert (end["event"], end["status"]) == ("end", "interrupted")
    assert end["reason"].startswith("stopped by the button halt")


def test_a_real_drive_is_not_written_to_by_others(bench: Bench, feeder: Path) -> None:
    """Without --simulated-drives, a write to a drive is that of another master."""
    bench.drives(feeder)
    controller = bench.controller(feeder, "--start", "input", runs=1)
    controller.event(event="state", state="waiting")
    press(bench, feeder, "go", "on")
    assert controller.end() == 3
    assert "another master is on the bus" in controller.errors[-1]


def test_an_input_that_the_cell_does_not_have_is_named(bench: Bench, feeder: Path) -> None:
    done = subprocess.run(
        [program("ilc-sim"), "input", feeder, "window", "on", "--bus", bench.bus],
        check=False, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode != 0
    assert "input window: the cell has door, go, halt, far end" in done.stderr
