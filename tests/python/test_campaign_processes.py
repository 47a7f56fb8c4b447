"""Campaigns over programs in processes, which tests replace: their events, ends and signals."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from ilc_rt import (
    Campaign,
    CampaignError,
    processes,
)
from ilc_rt.events import (
    EndEvent,
    EventError,
    IterationEvent,
    LatencyEvent,
    StartEvent,
    event_payload,
    parse_event,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    Install = Callable[[str, str], None]


START = {
    "event": "start", "cell": "gantry", "campaign": "c1", "n_samples": 4, "n_axes": 2,
    "axis_names": ["x", "y"], "cycle_s": 0.002, "first_index": 0, "iterations": 2,
    "measure": "tcp", "law": "pd", "bus": "udp:239.74.163.2", "mode": "realtime",
    "rt": {"policy": "SCHED_OTHER", "priority": 0, "mlock": False, "kernel": "6", "notes": ["n"]},
}  # fmt: skip


ITERATION = {
    "event": "iteration", "id": 7, "index": 0, "tracking_inf_m": 2e-3, "tracking_rms_m": 1e-3,
    "contour_inf_m": 5e-4, "contour_rms_m": 1e-4, "overruns": 0, "update_ms": 0.5,
}  # fmt: skip


GOOD_DRIVES = """
import signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: (open("drives-end", "w").close(), sys.exit(0)))
print("ready: 2 drives", flush=True)
# A signal just before one long sleep would be answered after it.
for _ in range(600):
    time.sleep(0.1)
"""


def controller(*events: object, then: str = "") -> str:
    """Return a program that prints events, then does something else."""
    lines = "".join(f"print({json.dumps(event)!r}, flush=True)\n" for event in events)
    return f"import os, signal, sys, time\n{lines}{then}\n"


def children() -> set[str]:
    """Return the children of this process, also those that ended and were not reaped."""
    tasks = Path("/proc/self/task").glob("*/children")
    return {child for task in tasks for child in task.read_text(encoding="ascii").split()}


def end(status: str = "completed") -> dict[str, object]:
    """Return an end event."""
    return {"event": "end", "status": status, "reason": "because", "iterations": 1}


def test_processes_give_the_same_stream(
    gantry: Path, tmp_path: Path, programs: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Events of the program arrive typed; drives end after it; all processes are reaped."""
    monkeypatch.chdir(tmp_path)
    programs("ilc-sim", GOOD_DRIVES)
    programs("ilc-rt", controller(START, {"event": "novelty"}, ITERATION, end()))
    before = children()
    campaign = Campaign(gantry, library=tmp_path / "l.db")
    kinds = [type(event) for event in campaign.events(1)]
    assert kinds == [StartEvent, IterationEvent, EndEvent]
    assert campaign.result.records[0].tracking_inf_m == 2e-3
    assert (tmp_path / "drives-end").exists()
    assert children() == before


def test_arguments_reach_the_controller(
    gantry: Path, tmp_path: Path, programs: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All arguments are on its command line."""
    monkeypatch.chdir(tmp_path)
    programs("ilc-sim", GOOD_DRIVES)
    programs("ilc-rt", controller(START, end(), then="open('argv', 'w').write(str(sys.argv[1:]))"))
    campaign = Campaign(
        gantry, library="l.db", bus="udp:239.1.1.1", measure="encoder", lockstep=True, resume=True
    )
    list(campaign.run(5))
    said = (tmp_path / "argv").read_text()
    assert said == str(
        ["run", str(gantry), "--events", "--with-parent", "--bus", "udp:239.1.1.1", "--measure",
         "encoder", "--lockstep", "--simulated-drives", "--library", "l.db", "--iterations", "5",
         "--resume"]
    )  # fmt: skip


@pytest.mark.parametrize(
    ("source", "code", "said"),
    [
        ("import sys; sys.exit('cell.toml: bad key')", 1, "cell.toml: bad key"),
        ("import sys; print('no bus', file=sys.stderr); sys.exit(2)", 2, "no bus"),
        ("pass", 1, "exit code 0 and no word"),
        ("import os; os.kill(os.getpid(), 9)", 1, "ended by SIGKILL"),
        ("import time; time.sleep(60)", 1, 'did not say "ready:" within'),
    ],
)
def test_drives_that_do_not_start_are_an_error_of_one_line(
    gantry: Path,
    tmp_path: Path,
    programs: Install,
    monkeypatch: pytest.MonkeyPatch,
    source: str,
    code: int,
    said: str,
) -> None:
    """The error gives the reason, and the controller is never started."""
    monkeypatch.setattr(processes, "READY_DEADLINE_S", 1.0)
    programs("ilc-sim", source)
    programs("ilc-rt", "open('started', 'w').close()")
    before = children()
    campaign = Campaign(gantry, library=tmp_path / "l.db")
    with pytest.raises(CampaignError, match=said) as caught:
        list(campaign.run(1))
    assert caught.value.exit_code == code
    assert "\n" not in str(caught.value)
    assert children() == before


def test_the_controllers_line_and_exit_code_are_handed_on(
    gantry: Path, tmp_path: Path, programs: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A refusal by the controller: its last line, its exit code."""
    monkeypatch.chdir(tmp_path)
    programs("ilc-sim", GOOD_DRIVES)
    programs(
        "ilc-rt", "import sys; print('note\\nilc-rt: bus: load 0.9', file=sys.stderr); sys.exit(2)"
    )
    with pytest.raises(CampaignError, match=r"^bus: load 0\.9$") as caught:
        list(Campaign(gantry, library=tmp_path / "l.db").run(1))
    assert caught.value.exit_code == 2


def test_a_fault_is_raised_after_the_runs_before_it(
    gantry: Path, tmp_path: Path, programs: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Completed runs are kept; the reason is that of the fault."""
    monkeypatch.chdir(tmp_path)
    fault = {"event": "fault", "reason": "x: following error 0.012 m"}
    programs("ilc-sim", GOOD_DRIVES)
    last = {**end("fault"), "reason": "x: following error 0.012 m"}
    programs("ilc-rt", controller(START, ITERATION, fault, last, then="sys.exit(3)"))
    campaign = Campaign(gantry, library=tmp_path / "l.db")
    with pytest.raises(CampaignError, match="following error") as caught:
        list(campaign.run(3))
    assert caught.value.exit_code == 3
    assert len(campaign.result.records) == 1


def test_dying_drives_are_reported_with_the_reason(
    gantry: Path, tmp_path: Path, programs: Install
) -> None:
    """The controller's fault and the end of the drives, in one line."""
    programs(
        "ilc-sim",
        "import sys, time\nprint('ready:', flush=True)\ntime.sleep(0.3)\nsys.exit('out of memory')",
    )
    wait = "time.sleep(1.0)\nprint('node 1 is silent', file=sys.stderr)\nsys.exit(3)"
    programs("ilc-rt", controller(START, then=wait))
    with pytest.raises(CampaignError, match=r"node 1 is silent .*out of memory") as caught:
        list(Campaign(gantry, library=tmp_path / "l.db").run(1))
    assert caught.value.exit_code == 3


CONTROLLED_STOP = """
def stop(*_):
    assert not os.path.exists("drives-end"), "the drives went before the axes were at rest"
    # Not by print: the signal may come while that is under way.
    os.write(1, b'{"event": "end", "status": "interrupted", "reason": "asked", "iterations": 1}\\n')
    open("stopped", "w").close()
    os._exit(130)
signal.signal(signal.SIGINT, stop)
EVENTS
print('{"event": "state", "state": "running", "iteration": 1}', flush=True)
# A signal just before one long sleep would be answered after it.
for _ in range(600):
    time.sleep(0.1)
"""


def stopping_controller(*events: object) -> str:
    """Return a program that can be interrupted from its first event on."""
    lines = "".join(f"print({json.dumps(event)!r}, flush=True)\n" for event in events)
    return "import os, signal, sys, time\n" + CONTROLLED_STOP.replace("EVENTS\n", lines)


def test_interrupting_stops_the_axes_before_the_drives(
    gantry: Path, tmp_path: Path, programs: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C: the controller stops first, then the drives, then the exception is raised."""
    monkeypatch.chdir(tmp_path)
    programs("ilc-sim", GOOD_DRIVES)
    programs("ilc-rt", stopping_controller(START, ITERATION))
    campaign = Campaign(gantry, library=tmp_path / "l.db")
    seen = []
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        for event in campaign.events(5):
            seen.append(event)
            if event.name == "state":
                signal.raise_signal(signal.SIGINT)
    assert isinstance(seen[-1], EndEvent)
    assert campaign.result.status == "interrupted"
    assert (tmp_path / "drives-end").exists()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_leaving_the_loop_early_stops_the_axes(
    gantry: Path, tmp_path: Path, programs: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`break` is a controlled stop too."""
    monkeypatch.chdir(tmp_path)
    programs("ilc-sim", GOOD_DRIVES)
    programs("ilc-rt", stopping_controller(START, ITERATION))
    runs = Campaign(gantry, library=tmp_path / "l.db").run(5)
    next(runs)
    runs.close()
    assert (tmp_path / "stopped").exists()
    assert (tmp_path / "drives-end").exists()


def test_a_controller_that_will_not_stop_is_ended(
    gantry: Path, tmp_path: Path, programs: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the deadline it is killed, and the error says so."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ilc_rt.controllers.STOP_DEADLINE_S", 0.5)
    deaf = controller(START, ITERATION, then="time.sleep(60)")
    programs("ilc-sim", GOOD_DRIVES)
    programs("ilc-rt", "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n" + deaf)
    campaign = Campaign(gantry, library=tmp_path / "l.db")
    with pytest.raises(CampaignError, match="did not stop in time"):  # noqa: PT012
        for _ in campaign.run(5):
            campaign.interrupt()
    assert (tmp_path / "drives-end").exists()


def test_missing_programs_say_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """One line with the remedy."""
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr("sysconfig.get_path", lambda *_: str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(CampaignError, match="make build"):
        processes.find_program("ilc-rt")


@pytest.mark.parametrize(
    "line", ["", "nonsense", "[1]", '{"a": 1}', '{"event": "iteration", "id": 1}',
             '{"event": "latency", "wake_late_us": {}, "execution_us": {}}'],
)  # fmt: skip
def test_lines_that_are_no_events_are_refused(line: str) -> None:
    """Anything but a complete object is an error that shows the line."""
    with pytest.raises(EventError):
        parse_event(line)


def test_events_survive_a_round_trip() -> None:
    """Written events are read back unchanged."""
    histogram = {"p50": 1.0, "p99": 2.0, "p999": 3.0, "max": 4.0, "bins": [[2.0, 10], [4.0, 1]]}
    latency = {"event": "latency", "wake_late_us": histogram, "execution_us": histogram}
    for data in (START, ITERATION, latency, end()):
        event = parse_event(json.dumps(data))
        assert event is not None
        assert parse_event(json.dumps(event_payload(event))) == event
    assert isinstance(parse_event(json.dumps(latency)), LatencyEvent)
