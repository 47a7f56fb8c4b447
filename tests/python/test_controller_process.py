"""The main job, as two programs on a bus: drives in one process, the controller in another."""

from __future__ import annotations

import itertools
import json
import re
import socket
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from ports_fixture import free_port
from processes_fixture import PATIENT, Bench, goodbye

from ilc_rt.events import parse_event
from ilc_rt.figures import Figures

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.xdist_group("controller")

RUNS = 4
FIGURES = {"index", *(figure.name for figure in fields(Figures))}


class Job(NamedTuple):
    """A finished campaign."""

    status: int
    events: list[dict[str, Any]]
    errors: list[str]
    figures: dict[str, Any]
    kept: list[tuple[str, int, str]]
    drives: str

    @property
    def digests(self) -> list[str]:
        """The digest of every run."""
        return [event["digest"] for event in self.events if event["event"] == "iteration"]


def carry_out(folder: Path, *, drives_bus: str | None = None, bus: str | None = None) -> Job:
    """Make four runs in lock-step."""
    with Bench(folder) as bench:
        cell = bench.cell()
        drives = bench.drives(cell, "--lockstep", bus=drives_bus)
        controller = bench.controller(
            cell, "--lockstep", "--json", "figures.json", runs=RUNS, bus=bus
        )
        status = controller.end()
        figures = json.loads((folder / "figures.json").read_text())
        return Job(
            status, controller.events, controller.errors, figures, bench.kept(), goodbye(drives)
        )


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Job:
    """Return four runs over UDP."""
    return carry_out(tmp_path_factory.mktemp("job"))


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def test_the_job_is_done_and_learned(job: Job) -> None:
    """Exit status 0, empty standard error, drives off, and the error far below the first run's."""
    assert job.status == 0
    assert job.errors == []
    assert "1 (x) switch on disabled, 2 (y) switch on disabled" in job.drives
    error_m = [figures["tracking_rms_m"] for figures in job.figures["iterations"]]
    assert error_m == sorted(error_m, reverse=True)
    assert error_m[-1] < 0.05 * error_m[0]


def test_the_figures_are_those_of_the_events_and_of_the_library(job: Job) -> None:
    """Figures, events and library agree."""
    assert set(job.figures) == {"campaign", "status", "reason", "axis_units", "iterations"}
    assert job.figures["axis_units"] == ["m", "m"]
    assert job.figures["status"] == "completed"
    told = [event for event in job.events if event["event"] == "iteration"]
    assert [event["index"] for event in told] == list(range(RUNS))
    assert all(set(figures) == FIGURES for figures in job.figures["iterations"])
    for event, figures in zip(told, job.figures["iterations"], strict=True):
        assert {name: event[name] for name in FIGURES} == figures
    campaign = job.figures["campaign"]
    assert job.kept == [(campaign, event["index"], event["digest"]) for event in told]


def test_the_events_tell_the_story_in_order(job: Job) -> None:
    """Every line is an event of the documented kind, and the states follow each other."""
    for event in job.events:
        assert parse_event(json.dumps(event)) is not None, event
    start = next(event for event in job.events if event["event"] == "start")
    assert (start["mode"], start["rt"]) == ("lockstep", None)
    assert (start["first_index"], start["iterations"], start["n_axes"]) == (0, RUNS, 2)
    assert start["axis_names"] == ["x", "y"]
    states = [
        (event["state"], event["iteration"]) for event in job.events if event["event"] == "state"
    ]
    runs = itertools.chain.from_iterable(
        [("returning", k), ("settling", k), ("running", k)] for k in range(RUNS)
    )
    back = [("returning", RUNS), ("settling", RUNS), ("stopped", RUNS)]
    assert states == [("bringing_up", 0), ("enabling", 0), *runs, *back]
    kinds = [event["event"] for event in job.events]
    assert kinds[:2] == ["state", "start"]
    assert (kinds.count("end"), kinds[-1]) == (1, "end")
    assert job.events[-1]["iterations"] == RUNS
    # Each run is reported before the next one begins.
    for k in range(RUNS - 1):
        told = job.events.index(next(e for e in job.events if e.get("index") == k))
        next_run = {"event": "state", "state": "running", "iteration": k + 1}
        assert told < job.events.index(next_run)


def test_a_second_invocation_gives_the_same_digests(job: Job, tmp_path: Path) -> None:
    """Lock-step has no wall clock: other processes, another port, same numbers."""
    assert len(job.digests) == RUNS
    assert carry_out(tmp_path).digests == job.digests


def test_zenoh_gives_the_same_digests(job: Job, tmp_path: Path) -> None:
    """The transport does not change the numbers."""
    endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    over_zenoh = carry_out(
        tmp_path,
        drives_bus=f"zenoh:test/bus?listen={endpoint}&scouting=off",
        bus=f"zenoh:test/bus?connect={endpoint}&scouting=off",
    )
    assert over_zenoh.status == 0
    assert over_zenoh.digests == job.digests


def test_another_cell_description_gives_other_digests(job: Job, tmp_path: Path) -> None:
    """Digests distinguish runs: a thousandth of the friction is enough."""
    with Bench(tmp_path) as bench:
        cell = bench.cell(("coulomb_n = 60.0", "coulomb_n = 60.06"))
        bench.drives(cell, "--lockstep")
        controller = bench.controller(cell, "--lockstep", runs=1)
        digest = controller.event(event="iteration")["digest"]
        assert controller.end() == 0
    assert digest not in job.digests


def test_a_person_gets_a_table(bench: Bench) -> None:
    """Without --events: one line per run, and the outcome."""
    cell = bench.cell(short=True)
    bench.drives(cell, "--lockstep")
    controller = bench.start(
        "ilc-rt", "run", cell, "--bus", bench.bus, "--lockstep", "--iterations", "3",
        "--library", bench.library, "--no-telemetry",
    )  # fmt: skip
    assert controller.end() == 0
    rows = [line.split() for line in controller.said]
    assert [row[0] for row in rows if row[0].isdigit() and row[-1] != "kept"] == ["0", "1", "2"]
    assert controller.said[-1] == "3 runs made and kept"
    assert [(number) for _, number, _ in bench.kept()] == [0, 1, 2]


def test_real_time(bench: Bench) -> None:
    """Two runs in real time at 500 Hz: the loop reports its punctuality, and the error falls."""
    cell = bench.cell(short=True, more=PATIENT)
    drives = bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=2)
    start = controller.event(event="start")
    assert start["mode"] == "realtime"
    assert {"policy", "priority", "mlock", "kernel", "notes"} <= set(start["rt"])
    assert controller.end() == 0, controller.errors
    events = controller.events
    assert all(parse_event(line) is not None for line in controller.said)
    first, second = [event for event in events if event["event"] == "iteration"]
    # By a factor of ten in lock-step. A busy machine spoils some of it: nothing is learned from a
    # disturbed run, and a late input waits for the next one.
    spoiled = first["overruns"] + first["missing_samples"] + second["late_updates"]
    share = 0.8 if spoiled + second["overruns"] == 0 else 1.2
    assert second["tracking_rms_m"] < share * first["tracking_rms_m"]
    latency = next(event for event in events if event["event"] == "latency")
    for times in (latency["wake_late_us"], latency["execution_us"]):
        assert 0 <= times["p50"] <= times["p99"] <= times["p999"] <= times["max"]
        assert times["count"] == sum(count for _, count in times["bins"])
        assert times["count"] > 2 * start["n_samples"]
    progress = [event["sample"] for event in events if event["event"] == "progress"]
    assert len(progress) == 2 * (start["n_samples"] // 50)
    assert "1 (x) switch on disabled, 2 (y) switch on disabled" in goodbye(drives)


def test_check_tells_what_would_be_done(bench: Bench) -> None:
    """It opens no bus: an interface that does not exist is no obstacle."""
    check = bench.start("ilc-rt", "check", bench.cell())
    assert check.end() == 0
    assert "axis x (node 1): 0.000 to 0.080 m of -0.020 to 0.100 m" in "\n".join(check.said)
    assert "1515 samples, 3.030 s" in "\n".join(check.said)


def test_latency_is_measured(bench: Bench) -> None:
    """One second of a 1 kHz grid has about a thousand wake-ups, fewer if some were missed."""
    latency = bench.start("ilc-rt", "latency", "--seconds", "1", "--json", "latency.json")
    assert latency.end() == 0
    figures = json.loads((bench.folder / "latency.json").read_text())
    assert figures["cycle_us"] == 1000
    assert 0 < figures["wake_late_us"]["count"] <= 1000


def test_latency_is_measured_under_load_and_drawn(bench: Bench) -> None:
    words = ("--seconds", "1", "--load", "--histogram", "--spin-us", "0", "--json", "busy.json")
    latency = bench.start("ilc-rt", "latency", *words)
    assert latency.end() == 0
    said = "\n".join(latency.said)
    assert "quiet:" in said
    assert "loaded:" in said
    assert re.search(r"^ +[0-9.]+ us +[0-9]+ #+$", said, re.MULTILINE)
    figures = json.loads((bench.folder / "busy.json").read_text())
    assert figures["rt"]["spin_us"] == 0
    for part in (figures, figures["loaded"]):
        assert part["wake_late_us"]["count"] > 0
        assert part["grade"]
        if figures["rt"]["mlock"]:
            # None is the loop's own; the system may move a page now and then.
            assert part["minor_faults"] <= part["wake_late_us"]["count"] // 100
            assert part["major_faults"] == 0
        assert part["sleepless_us"]["count"] > 0
        if part["cyclictest_us"] is not None:
            assert part["cyclictest_us"]["count"] > 0


@pytest.mark.parametrize(
    ("verb", "options"),
    [
        ("run", ["--no-telemetry"]),
        ("run", ["--no-telemetry", "--home"]),
        ("identify", ["--axis", "x"]),
        ("goto", ["x=0.05"]),
        ("home", []),
    ],
)
def test_required_real_time_is_granted_or_nothing_moves(
    bench: Bench, verb: str, options: list[str]
) -> None:
    homing = '[axis.homing]\nkind = "drive"\nmethod = 33\nspeed_zero_m_s = 0.01\n'
    homed = ("[axis.model]", f"{homing}\n[axis.model]")
    cell = bench.cell(
        ("[[axis]]", "[realtime]\ncpu = 1000\n[[axis]]"),
        *([homed] if verb == "home" or "--home" in options else []),
    )
    drives = bench.drives(cell, bus=bench.bus)
    run = bench.start("ilc-rt", verb, cell, *options, "--bus", bench.bus, "--require-rt")
    assert run.end() == 2
    (error,) = run.errors
    assert error.startswith("ilc-rt: --require-rt: ")
    assert "processor 1000 refused" in error
    assert error.endswith("; nothing has moved")
    assert "homed" not in goodbye(drives)
