"""Lost deadlines: what the loop's flight recorder leaves behind, and how it is shown."""

from __future__ import annotations

import json
from copy import deepcopy
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import pytest
from processes_fixture import PATIENT, Bench

from ilc_rt import plots
from ilc_rt.events import Histogram, LateEvent, LatencyEvent, event_payload, parse_event
from ilc_rt.lateness import LateCounts, LateCycle, StageSpans, late_sentence
from ilc_rt.report import render

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from ilc_rt import CampaignResult

USUAL = StageSpans(wake_us=12.0, receive_us=30.0, control_us=200.0, send_us=40.0, slack_us=718.0)
SLOW = replace(USUAL, control_us=931.0, slack_us=-13.0)
WORST = LateCycle(tick=7, cause="computation", stages=SLOW, usual=USUAL, allowed_us=900.0, missed=2)
#: Every cycle is late.
NO_TIME = "\n[realtime]\nlate_share = 0.05\n"


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """Return a folder with a bus; its programs end with the test."""
    with Bench(tmp_path) as bench:
        yield bench


def test_a_run_in_real_time_leaves_its_record(bench: Bench) -> None:
    """The last lines, the events, the file and `why` tell the same cycles."""
    cell = bench.cell(short=True, more=PATIENT + NO_TIME)
    bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=1)
    assert controller.end() == 0, controller.errors
    latency = parse_event(
        next(line for line in controller.said if json.loads(line)["event"] == "latency")
    )
    assert isinstance(latency, LatencyEvent)
    assert latency.late is not None
    assert latency.file is not None
    assert [times.axis for times in latency.answers] == ["x", "y", None]
    assert all(times.count > 100 for times in latency.answers)
    record = json.loads((bench.folder / latency.file).read_text(encoding="utf-8"))
    assert record["late"] == asdict(latency.late)
    assert set(record["stages_us"]) == {"wake", "receive", "control", "send"}
    counts = [record["stages_us"][name]["count"] for name in ("wake", "receive", "send")]
    assert len(set(counts)) == 1

    for target in (cell, bench.library, latency.file):
        why = bench.start("ilc-rt", "why", target, "--library", bench.library, "--json", "why.json")
        assert why.end() == 0, why.errors
        assert json.loads((bench.folder / "why.json").read_text(encoding="utf-8")) == record
        heads = [line.split()[0] for line in why.said]
        assert heads[:6] == ["cell", "us", "wake", "receive", "control", "send"]
        worst = [line for line in why.said if line.strip().startswith(f"{tick_of(record)} ")]
        assert len(worst) == min(1, len(record["worst"]))


def tick_of(record: dict[str, Any]) -> int:
    """Return the number of the worst cycle; -1 without one."""
    return int(record["worst"][0]["tick"]) if record["worst"] else -1


def test_the_last_lines_of_a_run_have_the_stages(bench: Bench) -> None:
    """For people, without --events."""
    cell = bench.cell(short=True, more=PATIENT)
    bench.drives(cell)
    controller = bench.start(
        "ilc-rt", "run", cell, "--bus", bench.bus, "--iterations", "1", "--simulated-drives",
        "--library", bench.library, "--no-telemetry",
    )  # fmt: skip
    assert controller.end() == 0, controller.errors
    heads = [line.split()[0] for line in controller.said if line.strip()]
    first = heads.index("us")
    assert heads[first : first + 5] == ["us", "wake", "receive", "control", "send"]
    assert "cycles" in controller.said[controller.said.index(next(
        line for line in controller.said if line.startswith("send "))) + 1]  # fmt: skip


def test_there_has_to_be_a_record(bench: Bench) -> None:
    """Otherwise one line says what makes one."""
    cell = bench.cell(short=True)
    (bench.folder / "foreign.json").write_text('{"cell": 3}', encoding="utf-8")
    for target, words in (
        (cell, "there is no flight record"),
        ("library.db", "there is no flight record"),
        ("foreign.json", "not a flight record"),
        ("missing.toml", "missing.toml"),
    ):
        why = bench.start("ilc-rt", "why", target)
        assert why.end() == 2
        assert len(why.errors) == 1
        assert words in why.errors[0]


def test_the_doctor_gives_a_command_for_every_poor_finding(bench: Bench) -> None:
    """On this computer, whatever it lacks."""
    doctor = bench.start("ilc-rt", "doctor", "--json", "doctor.json")
    assert doctor.end() == 0, doctor.errors
    text = (bench.folder / "doctor.json").read_text(encoding="utf-8")
    findings = json.loads(text)["findings"]
    assert {"kernel", "governor", "priority", "memory", "sleep", "clock"} <= {
        finding["what"] for finding in findings
    }
    for finding in findings:
        assert finding["verdict"] in {"good", "poor", "unknown"}
        assert (finding["mend"] is not None) == (finding["verdict"] == "poor"), finding
        assert any(finding["found"] in line for line in doctor.said)


def test_the_stages_of_a_cell_are_measured_without_its_drives(bench: Bench) -> None:
    """Its loop runs on axes in memory."""
    cell = bench.cell(short=True)
    latency = bench.start("ilc-rt", "latency", cell, "--seconds", "1", "--json", "latency.json")
    assert latency.end() == 0, latency.errors
    figures = json.loads((bench.folder / "latency.json").read_text(encoding="utf-8"))
    assert figures["cycle_us"] == 2000
    for name in ("wake_late_us", "receive_us", "control_us", "send_us"):
        assert 0 < figures[name]["count"] <= 500
    assert figures["control_us"]["p50"] > 0


@pytest.mark.parametrize(
    ("cycle", "words"),
    [
        (WORST, "the computation took 931 µs (usually 200); 2 cycles were skipped"),
        (replace(WORST, cause="wake_up", missed=1),
         "the host woke the loop 12 µs late (usually 12); 1 cycle was skipped"),
        (replace(WORST, cause="preemption", missed=0),
         "the host gave the processor to another thread: the cycle took 1013 µs (usually 282)"),
        (replace(WORST, cause="receive", missed=0, node=2, axis="y"),
         "receiving took 30 µs (usually 30), most of it for node 2 (y)"),
        (replace(WORST, cause="receive", missed=0, node=10, stages=USUAL, answer_us=1310.0,
                 usual_answer_us=320.0),
         "node 10 (tool) answered 1310 µs after SYNC (usually 320)"),
        (replace(WORST, cause="receive", missed=0, node=1, axis="x", stages=USUAL),
         "node 1 (x) did not answer"),
        (replace(WORST, cause="receive", missed=0, stages=USUAL),
         "the bus brought all answers after the next SYNC"),
        (replace(WORST, cause="send", missed=0),
         "the bus took the commands late: sending took 40 µs (usually 40)"),
        (replace(WORST, cause="send", missed=0, refused=True),
         "the bus did not take every frame: its queue was full"),
        (replace(WORST, cause="moon", missed=0), "moon"),
    ],
)  # fmt: skip
def test_every_cause_has_a_sentence(cycle: LateCycle, words: str) -> None:
    """As the controller says it."""
    assert late_sentence(cycle) == words


def test_a_late_event_survives_a_round_trip() -> None:
    """With its stages as objects."""
    event = LateEvent(**{**asdict_of(WORST), "iteration": 3, "count": 5})
    again = parse_event(json.dumps(event_payload(event)))
    assert again == event
    assert isinstance(again, LateEvent)
    assert again.stages.control_us == 931.0


def asdict_of(cycle: LateCycle) -> dict[str, Any]:
    """Return the fields of a cycle, its stages as they are."""
    return {name: getattr(cycle, name) for name in asdict(cycle)}


def test_the_report_shows_the_worst_cycle_beside_a_good_one(finished: CampaignResult) -> None:
    """As bars of the same scale, with a sentence; without a late cycle there is no picture."""
    times = Histogram(1.0, 2.0, 3.0, 4.0, ((2.0, 10), (4.0, 1)))
    result = deepcopy(finished)
    result.latency = LatencyEvent(times, times, late=LateCounts())
    assert plots.late_cycle(result) is None
    assert 'id="late"' not in render(result)
    counts = LateCounts(computation=3, missed=2)
    result.latency = LatencyEvent(times, times, late=counts, worst=WORST, good=USUAL)
    text = render(result)
    assert 'id="late"' in text
    assert "3 cycles lost their deadline, 2 were skipped" in text
    assert "the computation took 931 µs (usually 200)" in text
    figure = plots.late_cycle(result)
    assert figure is not None
    bars = figure.axes[0].patches
    assert [round(bar.get_width()) for bar in bars] == [12, 30, 931, 40, 12, 30, 200, 40]
    assert bars[3].get_x() == pytest.approx(12 + 30 + 931)
