"""The monitor against a real Zenoh session on this computer."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

import pytest
from ports_fixture import free_bus, free_port
from rich.console import Console

from ilc_rt import Cell
from ilc_rt.events import EndEvent, IterationEvent, StartEvent, StateEvent, parse_event
from ilc_rt.monitor import Message, Monitor
from ilc_rt.patience import Patience
from ilc_rt.result import micrometres
from ilc_rt.sources import Memory
from ilc_rt.watched import WatchedCell

zenoh = pytest.importorskip("zenoh")

from ilc_rt.commands import monitor as commands_monitor  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

STATE = {"event": "state", "state": "running", "iteration": 3}


def iteration(index: int, error_m: float) -> dict[str, object]:
    """Return an iteration as the controller publishes it."""
    return {
        "event": "iteration", "id": index + 1, "index": index, "tracking_inf_m": error_m,
        "tracking_rms_m": error_m / 2, "contour_inf_m": error_m / 4, "contour_rms_m": error_m / 8,
        "overruns": 0, "update_ms": 0.3,
    }  # fmt: skip


class Publisher:
    """The publisher of the contract."""

    def __init__(self, port: int) -> None:
        self.endpoint = f"tcp/127.0.0.1:{port}"
        config = zenoh.Config()
        config.insert_json5("listen/endpoints", json.dumps([self.endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.session.declare_queryable(
            "ilc/gantry/state",
            lambda query: query.reply("ilc/gantry/state", json.dumps(STATE)),
        )
        self.history: list[dict[str, object]] = []
        self.session.declare_queryable("ilc/gantry/history/*", self._tell)
        self.token = self.session.liveliness().declare_token("ilc/gantry/alive")

    def _tell(self, query: zenoh.Query) -> None:
        # In any order: the names of the replies have it.
        for number, event in reversed([*enumerate(self.history, -1)]):
            end = "start" if number < 0 else str(number)
            query.reply(f"ilc/gantry/history/{end}", json.dumps(event))

    def put(self, topic: str, payload: object) -> None:
        """Publish one object."""
        self.session.put(f"ilc/gantry/{topic}", json.dumps(payload))


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    """Return a session that stands in for a controller."""
    publisher = Publisher(free_port(socket.SOCK_STREAM))
    yield publisher
    publisher.session.close()


def test_a_late_joiner_sees_the_present_state(publisher: Publisher) -> None:
    """The controller is alive, and its state is queried at once."""
    with Monitor("gantry", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert next(messages) == Message("gantry", "alive", {})
        state = next(messages)
        assert state.event == StateEvent("running", 3)
        publisher.put("iteration", iteration(4, 2e-5))
        seen = next(messages)
        assert isinstance(seen.event, IterationEvent)
        assert seen.event.tracking_inf_m == 2e-5
        publisher.put("servo", {"sample": 17})
        assert next(messages) == Message("gantry", "servo", {"sample": 17})
        publisher.token.undeclare()
        assert next(messages).topic == "gone"


def test_a_late_joiner_hears_what_it_has_missed_once(publisher: Publisher) -> None:
    """Start and runs in order; one that was published at that moment comes once."""
    start = {
        "event": "start", "schema": 1, "cell": "gantry", "campaign": "c", "law": "pd",
        "axis_names": ["x"], "input_units": ["m"], "n_axes": 1, "iterations": 20, "first_index": 0,
        "n_samples": 100, "cycle_s": 2e-3, "mode": "csp", "measure": "tcp", "bus": "loopback:",
    }  # fmt: skip
    runs = [{"event": "iteration", **iteration(index, 2e-3)} for index in range(12)]
    publisher.history = [start, *runs]
    with Monitor("gantry", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert next(messages).topic == "alive"
        past = [next(messages) for _ in range(13)]
        assert all(message.is_past for message in past)
        assert isinstance(past[0].event, StartEvent)
        assert [message.payload["index"] for message in past[1:]] == list(range(12))
        assert next(messages).topic == "state"
        publisher.put("iteration", runs[-1])
        publisher.put("iteration", iteration(12, 2e-5))
        seen = next(messages)
        assert (seen.payload["index"], seen.is_past) == (12, False)


def test_answers_without_end_are_cut(publisher: Publisher, monkeypatch: pytest.MonkeyPatch) -> None:
    """Anyone may answer a question for the past."""
    publisher.history = [STATE, *(iteration(index, 1e-3) for index in range(300))]
    with Monitor("gantry", [publisher.endpoint], scouting=False) as monitor:
        # Its own question for the past comes first.
        assert next(monitor.messages(30.0)).topic == "alive"
        assert len(monitor.ask_history()) == 300
        monkeypatch.setattr("ilc_rt.monitor.REPLIES_MAX", 100)
        assert len(monitor.ask_history()) == 100


def test_a_stranger_that_never_answers_takes_no_more_than_its_share(
    publisher: Publisher, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It comes and goes; what others publish is heard, as if it were not there."""
    now_s = [0.0]
    asked: list[str] = []

    def ask(cell: str) -> list[Message]:
        asked.append(cell)
        now_s[0] += 2.0
        return []

    with Monitor("*", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert next(messages).cell == "gantry"
        monkeypatch.setattr(monitor, "_patience", Patience(lambda: now_s[0]))
        monkeypatch.setattr(monitor, "ask_history", ask)
        monkeypatch.setattr(monitor, "ask_state", ask)
        for _ in range(40):
            monitor._put(Message("mute", "alive", {}))
        monitor._put(Message("gantry", "state", STATE, parse_event(json.dumps(STATE))))
        heard = [next(message for message in messages if message.topic == "state")]
        while heard[-1].is_past:
            heard.append(next(messages))
        assert heard[-1].cell == "gantry"
        assert 10 <= len(asked) <= 16
        # After a while it is asked again.
        now_s[0] += 100.0
        monitor._put(Message("mute", "alive", {}))
        monitor._put(Message("gantry", "fault", {}))
        n_before = len(asked)
        assert next(message for message in messages if message.topic == "fault").cell == "gantry"
        assert len(asked) == n_before + 2


def test_every_answer_of_a_controller_is_heard() -> None:
    """Also the start of a campaign before its state, should a controller answer with both."""
    endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)
    start = {
        "event": "start", "cell": "gantry", "campaign": "c1", "n_samples": 50, "n_axes": 1,
        "axis_names": ["x"], "cycle_s": 0.002, "first_index": 0, "iterations": 9, "measure": "tcp",
        "law": "pd", "bus": "loopback:", "mode": "realtime", "input_units": ["m"],
    }  # fmt: skip

    def answer(query: zenoh.Query) -> None:
        for event in (start, STATE):
            query.reply("ilc/gantry/state", json.dumps(event))

    session.declare_queryable("ilc/gantry/state", answer)
    token = session.liveliness().declare_token("ilc/gantry/alive")
    try:
        with Monitor("gantry", [endpoint], scouting=False) as monitor:
            messages = monitor.messages(30.0)
            cell = WatchedCell("gantry")
            for _ in range(3):
                cell.take(next(messages))
    finally:
        token.undeclare()
        session.close()
    assert (cell.campaign, cell.axis_names, cell.state, cell.iteration) == (
        "c1", ("x",), "running", 3
    )  # fmt: skip
    assert cell.done == pytest.approx(3 / 9)


def test_a_description_names_axes_and_units_before_the_start(gantry: Path) -> None:
    known = Cell.load(gantry)
    screen = commands_monitor._Screen(Console(), Memory(), known)
    screen.show(Message("gantry", "state", dict(STATE), StateEvent("running", 3)))
    cell = screen._cells["gantry"]
    assert (cell.axis_names, cell.units, cell.state) == (("x", "y"), ("m", "m"), "running")


def test_garbage_on_the_network_is_passed_over(publisher: Publisher) -> None:
    """Anything but a JSON object is dropped; an incomplete event has no type."""
    with Monitor("*", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert [next(messages).topic for _ in range(2)] == ["alive", "state"]
        publisher.session.put("ilc/gantry/iteration", b"\xff\x00 nonsense")
        publisher.session.put("ilc/gantry/iteration", b"[1, 2]")
        publisher.put("iteration", {"index": 1})
        seen = next(messages)
        assert seen.payload == {"index": 1}
        assert seen.event is None


def test_the_verb_prints_the_error_falling(publisher: Publisher) -> None:
    """`ilc monitor` in a process: state, rows, and an end after two runs."""
    command = [sys.executable, "-m", "ilc_rt.cli", "monitor", "gantry", "--no-scouting",
               "--connect", publisher.endpoint, "--iterations", "2", "--timeout", "60"]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in range(2)]
        publisher.put("iteration", iteration(0, 2e-3))
        publisher.put("iteration", iteration(1, 2e-5))
        rest, _ = process.communicate(timeout=60)
    assert said == ["gantry: controller alive\n", "gantry: running (run 3)\n"]
    assert process.returncode == 0
    rows = rest.splitlines()
    assert "max tracking µm" in rows[0]
    assert rows[2].split()[:3] == ["gantry", "1", "20.0"]


def test_the_example_ends_after_its_runs(publisher: Publisher, gantry: Path) -> None:
    """examples/02_monitor.py draws one bar per run, each shorter than the last."""
    script = gantry.parent / "02_monitor.py"
    with subprocess.Popen(
        [sys.executable, str(script), "3", publisher.endpoint], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("waiting")
        stop = threading.Event()

        def publish() -> None:
            # The example's subscription reaches this session slightly after its first line.
            index = 0
            while not stop.wait(0.1):
                publisher.put("iteration", iteration(index, 2e-3 * 0.5**index))
                index += 1

        thread = threading.Thread(target=publish)
        thread.start()
        rest, _ = process.communicate(timeout=60)
        stop.set()
        thread.join()
    assert process.returncode == 0
    bars = [line.count("#") for line in rest.splitlines()]
    assert len(bars) == 3
    assert bars == sorted(bars, reverse=True)
    assert bars[-1] < bars[0]


def test_a_real_controller_is_followed_from_beginning_to_end(gantry: Path, tmp_path: Path) -> None:
    """A monitor that is already waiting receives everything of a real-time run."""
    endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    cell = tmp_path / "cell.toml"
    settings = f'[telemetry]\nlisten = ["{endpoint}"]\nscouting = false\n'
    cell.write_text(f"{gantry.read_text()}\n{settings}")
    command = [sys.executable, "-m", "ilc_rt.cli", "run", str(cell), "--iterations", "2",
               "--bus", free_bus()]  # fmt: skip
    seen: list[Message] = []
    with (
        Monitor("gantry", [endpoint], scouting=False) as monitor,
        subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process,
    ):
        for message in monitor.messages(90.0):
            seen.append(message)
            if message.topic == "gone":
                break
        out, _ = process.communicate(timeout=60)
    assert process.returncode == 0, out
    topics = {message.topic for message in seen}
    assert topics >= {"alive", "state", "iteration", "servo", "latency", "gone"}
    events = [message.event for message in seen if message.event is not None]
    ends = [event for event in events if isinstance(event, EndEvent)]
    assert [(event.status, event.iterations) for event in ends] == [("completed", 2)]
    last = [event for event in events if isinstance(event, IterationEvent)][-1]
    assert last.index == 1
    assert micrometres(last.tracking_inf_m) in out
    servo = next(message.payload for message in seen if message.topic == "servo")
    assert len(servo["reference_m"][0]) == 2


@pytest.mark.parametrize(
    ("topic", "payload", "said"),
    [
        ("fault", {"event": "fault", "reason": 7}, "reason = 7 is not of its type"),
        ("fault", {"event": "fault", "reason": None}, "reason = None"),
        ("fault", {"event": "fault"}, 'lacks the key "reason"'),
        ("state", {"event": "end", "status": [], "iterations": "2"}, "status = []"),
        ("state", {"event": "progress", "iteration": 1, "sample": "1", "n_samples": 2}, "sample"),
        (
            "state",
            {"event": "progress", "iteration": 1, "sample": 1, "n_samples": True},
            "n_samples",
        ),
        ("iteration", iteration(0, 1e-3) | {"tracking_inf_m": "x"}, "tracking_inf_m = x"),
        ("iteration", iteration(0, 1e-3) | {"index": {}}, "index = {}"),
        ("iteration", iteration(0, float("nan")), "tracking_inf_m = nan"),
        ("latency", {"event": "latency", "wake_late_us": 3, "execution_us": []}, "malformed"),
        ("state", {"event": "start", "cell": 1}, "lacks the key"),
    ],
)
def test_what_a_stranger_publishes_is_one_warning(
    publisher: Publisher, topic: str, payload: object, said: str
) -> None:
    """Wrong types stop neither the monitor nor the terminal view."""
    with Monitor("gantry", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert next(messages).topic == "alive"
        assert next(messages).topic == "state"
        publisher.put(topic, payload)
        message = next(messages)
    assert message.event is None
    assert message.warning is not None
    assert said in message.warning
    view = commands_monitor._View(events=False)
    view.show(message)
    assert (view.runs, view.faults) == (0, 0)


def test_a_newer_version_of_events_is_told_and_shown(publisher: Publisher) -> None:
    start = {
        "event": "start", "schema": 2, "cell": "gantry", "campaign": "c", "n_samples": 10,
        "n_axes": 1, "axis_names": ["x"], "cycle_s": 0.002, "first_index": 0, "iterations": 3,
        "measure": "encoder", "law": "pd", "bus": "udp:", "mode": "realtime", "a_new_field": 1,
    }  # fmt: skip
    with Monitor("gantry", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert next(messages).topic == "alive"
        assert next(messages).topic == "state"
        publisher.put("state", start)
        message = next(messages)
    assert "schema 2 of a newer version; 1 is known here" in str(message.warning)
    assert message.event == parse_event(json.dumps(start))


def test_control_characters_of_strangers_do_not_reach_the_terminal(
    publisher: Publisher, capsys: pytest.CaptureFixture[str]
) -> None:
    """An escape code is shown, not executed; texts are truncated."""
    with Monitor("gantry", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert next(messages).topic == "alive"
        assert next(messages).topic == "state"
        publisher.put("fault", {"event": "fault", "reason": "a\x1b[2J\r\n\x00\x9b31m" + "x" * 9000})
        message = next(messages)
    commands_monitor._View(events=False).show(message)
    shown = capsys.readouterr().out
    assert "FAULT: a\\x1b[2J\\r\\n\\x00\\x9b31mx" in shown
    assert len(shown) < 2500
    assert all(sign.isprintable() for sign in shown.rstrip("\n"))


def test_a_controller_that_asks_is_told_that_all_was_heard(publisher: Publisher) -> None:
    """Events published before the query arrive before its reply."""
    with Monitor("gantry", [publisher.endpoint], scouting=False) as monitor:
        messages = monitor.messages(30.0)
        assert next(messages).topic == "alive"
        assert next(messages).topic == "state"
        for index in range(200):
            publisher.put("iteration", iteration(index, 1e-3))
        replies = list(publisher.session.get("ilc/gantry/heard", timeout=20.0))
        assert [reply.ok is not None for reply in replies] == [True]
        publisher.token.undeclare()
        seen = []
        for message in messages:
            seen.append(message.topic)
            if message.topic == "gone":
                break
    assert seen == ["iteration"] * 200 + ["gone"]
