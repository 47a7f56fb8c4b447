"""The view of a campaign in a terminal: what it says, at every width, and what it leaves behind."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from ports_fixture import free_port
from rich.console import Console

from ilc_rt import Campaign, Library
from ilc_rt.events import (
    EndEvent,
    FaultEvent,
    IterationEvent,
    JudgedEvent,
    LateEvent,
    ProgressEvent,
    StartEvent,
    StateEvent,
)
from ilc_rt.lateness import StageSpans
from ilc_rt.terminal import CellsView, CellView
from ilc_rt.watched import RUNS_MAX, WatchedCell

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from rich.console import ConsoleOptions, RenderResult

    from ilc_rt import CampaignResult
    from ilc_rt.events import Event

pytestmark = pytest.mark.xdist_group("terminal")

RUNS = 3


@pytest.fixture(scope="module")
def events(gantry: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Event]:
    """Return the events of a campaign by the real controller, in lock-step."""
    library = tmp_path_factory.mktemp("watched") / "library.db"
    return list(Campaign(gantry, library=library, bus="loopback:").events(RUNS))


def watched(events: Iterable[Event], clock_s: Sequence[float] = (0.0,)) -> WatchedCell:
    """Return the cell after these events; the clock stays at its last reading."""
    readings = iter(clock_s)
    last = [clock_s[-1]]
    cell = WatchedCell("gantry", lambda: next(readings, last[0]))
    for event in events:
        cell.see(event)
    return cell


def drawn(view: object, width: int, height: int = 40, **more: object) -> str:
    """Return a view as it is drawn on a console of this size, without colours."""
    console = Console(width=width, height=height, record=True, file=open(os.devnull, "w"), **more)  # noqa: PTH123, SIM115
    with console.file:
        console.print(view)
    return console.export_text()


def started(events: Sequence[Event]) -> StartEvent:
    """Return the start of the campaign."""
    return next(event for event in events if isinstance(event, StartEvent))


def until(events: Sequence[Event], kind: type, index: int = 0) -> list[Event]:
    """Return the events up to one of a kind."""
    places = [place for place, event in enumerate(events) if isinstance(event, kind)]
    return list(events[: places[index] + 1])


@pytest.mark.parametrize("width", [80, 40, 24])
@pytest.mark.parametrize("ascii_only", [False, True])
def test_no_line_is_wider_than_the_terminal(
    events: list[Event], width: int, *, ascii_only: bool
) -> None:
    """At each moment of the campaign, with a fault and a long reason in it."""
    cell = WatchedCell("gantry")
    more = [FaultEvent("axis x: a following error of 12 mm, 5 mm are allowed" * 3, axis="x")]
    for event in [*events, *more]:
        cell.see(event)
        text = drawn(AsciiOnly(cell) if ascii_only else CellView(cell), width)
        assert not (ascii_only and set("█░▁▂▃▄▅▆▇") & set(text))
        assert max(map(len, text.splitlines())) <= width, text


def test_a_run_is_told_with_its_place_progress_axes_and_errors(events: list[Event]) -> None:
    """In the second run: number, both bars, axes with their states, and the first run's error."""
    so_far = [*until(events, IterationEvent), StateEvent("running", 1), ProgressEvent(1, 50, 100)]
    cell = watched(so_far)
    for width in (80, 40):
        text = drawn(CellView(cell), width)
        assert "run 1 (2 of 3): running" in text
        assert re.search(r"run +█+░+  50 %", text)
        assert re.search(r"campaign +█+░+  50 %", text)
        assert re.search(r"^x +following", text, re.MULTILINE)
        assert re.search(r"^y +following", text, re.MULTILINE)
        assert "0 overruns" in text
    (first,) = cell.records
    assert first.contour_inf_m is not None
    text = drawn(CellView(cell), 80)
    assert f"{first.contour_inf_m * 1e6:.0f}" in text
    assert "max tracking µm" in text
    assert "max tracking µm" not in drawn(CellView(cell), 40)


def test_the_error_is_seen_to_fall(events: list[Event]) -> None:
    """A line of bars on a logarithmic scale, from the top to the bottom, and the change."""
    text = drawn(CellView(watched(events)), 80)
    line = next(line for line in text.splitlines() if line.startswith("error"))
    bars = re.findall("[▁▂▃▄▅▆▇█]", line)
    assert (len(bars), bars[0], bars[-1]) == (RUNS, "█", "▁")
    assert "contour, log" in line
    assert re.search(r"\(-\d+\.\d %\)", text)
    assert "completed" in text
    assert re.search(r"^x +at rest", text, re.MULTILINE)


def test_what_went_wrong_is_told_in_words_and_signs(events: list[Event]) -> None:
    """Without colours: fault, roll-back and late cycle are words; a fault comes first."""
    stages = StageSpans(900.0, 1.0, 1.0, 1.0)
    late = LateEvent(tick=7, cause="wake_up", stages=stages, usual=stages, iteration=1, count=3)
    so_far = until(events, IterationEvent, 1)
    judged = JudgedEvent(2, 1, rolled_back=True, learning_off=False, remark="the error grew")
    fault = FaultEvent("node 2 is silent", axis="y", node=2)
    end = EndEvent("fault", 2, "node 2 is silent")
    cell = watched([*so_far, judged, late, fault, end])
    for width in (80, 40):
        text = drawn(CellView(cell), width)
        assert text.index("FAULT: node 2 is silent") < text.index("! run 1: the error grew")
        assert text.count("node 2 is silent") == 1
        assert "rolled back" in text
        assert "! late: " in text
        assert "3 late cycles" in text
        assert re.search(r"^y +FAULT", text, re.MULTILINE)
        assert not re.search(r"^x +FAULT", text, re.MULTILINE)


def test_colour_is_left_out_where_it_is_not_wanted(
    events: list[Event], monkeypatch: pytest.MonkeyPatch
) -> None:
    """NO_COLOR takes the colours; the text stays the same."""
    cell = watched([*events, FaultEvent("node 2 is silent")])
    texts = {}
    for wanted in ("", "1"):
        monkeypatch.setenv("NO_COLOR", wanted)
        console = Console(width=80, height=40, force_terminal=True, color_system="standard")
        with console.capture() as capture:
            console.print(CellView(cell))
        texts[wanted] = capture.get()
    red = re.compile(r"\x1b\[[0-9;]*3[1-7]m")
    assert red.search(texts[""])
    assert not red.search(texts["1"])
    plain = [re.sub(r"\x1b\[[0-9;]*m", "", text) for text in texts.values()]
    assert plain[0] == plain[1]


def test_the_time_left_follows_the_speed_so_far(events: list[Event]) -> None:
    """A quarter of the runs in 10 s leaves 30 s; at first, and until stopped, nothing is shown."""
    start = started(events)
    now = [0.0]
    cell = WatchedCell("gantry", lambda: now[0])
    for event in (replace(start, iterations=4), StateEvent("running", 0)):
        cell.see(event)
    now[0] = 0.5
    cell.see(ProgressEvent(0, 50, 100))
    assert cell.left_s is None
    now[0] = 10.0
    cell.see(ProgressEvent(0, 100, 100))
    assert cell.left_s == pytest.approx(30.0)
    assert "0:30 left" in drawn(CellView(cell), 80)
    cell.see(EndEvent("interrupted", 1))
    assert cell.left_s is None


def test_a_cell_that_goes_on_counts_from_its_first_run(events: list[Event]) -> None:
    """The share done is of the runs to come; the earlier ones are in the table."""
    start = started(events)
    cell = watched([replace(start, first_index=4, iterations=6), StateEvent("running", 5)])
    assert cell.done == pytest.approx(0.5)


def test_the_live_error_of_each_axis_is_the_largest_of_a_batch() -> None:
    """In a run only; a missing measurement is shown; strangers' batches change nothing."""
    cell = watched([StateEvent("running", 0)])
    batch = {
        "first_sync": 0,
        "iteration_and_sample": [[0, 0], [0, 1]],
        "input": [[0.0, 0.0]] * 2,
        "reference_m": [[1.0, 0.0], [1.0, 0.0]],
        "encoder_m": [[0.997, 0.0], [0.999, None]],
        "tool_m": None,
    }
    cell.see_servo(batch)
    assert [list(axis.trail_m) for axis in cell.axes] == [pytest.approx([3e-3]), [0.0]]
    assert cell.axes[0].error_m == pytest.approx(1e-3)
    assert cell.axes[1].error_m is None
    text = drawn(CellView(cell), 80)
    assert re.search(r"^0 +following +1000 mm +1000 µm", text, re.MULTILINE)
    assert re.search(r"^1 +not measured", text, re.MULTILINE)
    for garbage in ({}, {"reference_m": 3}, {"reference_m": [3], "encoder_m": ["x"]},
                    {"reference_m": [[True, "a"]], "encoder_m": [[1e400, {}]]}):  # fmt: skip
        cell.see_servo(garbage)
    drawn(CellView(cell), 80)
    cell.see(StateEvent("returning", 1))
    cell.see_servo(batch)
    assert len(cell.axes[0].trail_m) == 1


def test_many_runs_are_bounded_and_their_table_fits_the_terminal(events: list[Event]) -> None:
    """The first run stays, as the others are compared with it; the newest ones follow."""
    run = next(event for event in events if isinstance(event, IterationEvent))
    cell = watched(replace(run, index=index, id=index + 1) for index in range(RUNS_MAX + 50))
    assert len(cell.records) == RUNS_MAX
    assert [cell.records[0].index, cell.records[-1].index] == [0, RUNS_MAX + 49]
    lines = drawn(CellView(cell), 80, height=24).rstrip().splitlines()
    assert len(lines) < 24
    assert lines[-1].split()[0] == str(RUNS_MAX + 49)


def test_several_cells_are_shown_below_each_other(events: list[Event]) -> None:
    """Each with its state; alone, a cell gets its table."""
    one, other = watched([started(events), StateEvent("running", 0)]), WatchedCell("press")
    other.see(StateEvent("homing"))
    other.see(FaultEvent("a guard is open"))
    text = drawn(CellsView([one, other]), 80)
    assert "gantry  run 0 (1 of 3): running" in text
    assert "press  homing" in text
    assert "FAULT: a guard is open" in text
    assert "waiting for a controller" in drawn(CellsView([]), 80)


class AsciiOnly:
    """A view in a terminal whose encoding has no bars."""

    def __init__(self, cell: WatchedCell) -> None:
        self._cell = cell

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw with the encoding of such a terminal."""
        options = options.copy()
        options.encoding = "ascii"
        yield from console.render(CellView(self._cell), options)


class Terminal:
    """A pseudo-terminal with a program in it."""

    def __init__(self, command: Sequence[str], folder: Path, columns: int) -> None:
        self._main, side = pty.openpty()
        self.resize(columns)
        environment = {k: v for k, v in os.environ.items() if k not in {"COLUMNS", "LINES"}}
        self._process = subprocess.Popen(
            command, cwd=folder, stdin=side, stdout=side, stderr=side, start_new_session=True,
            env={**environment, "TERM": "xterm-256color"},
        )  # fmt: skip
        os.close(side)
        self.said = ""

    def resize(self, columns: int) -> None:
        """Tell the program another width, as a terminal does."""
        fcntl.ioctl(self._main, termios.TIOCSWINSZ, struct.pack("HHHH", 30, columns, 0, 0))

    def wait_for(self, pattern: str, since: int = 0) -> int:
        """Read until something was written, and return the number of characters so far."""
        end = time.monotonic() + 60.0
        while not re.search(pattern, self.said[since:]):
            assert time.monotonic() < end, self.said[-3000:]
            assert self._read(), self.said[-3000:]
        return len(self.said)

    def end(self, number: signal.Signals | None = None) -> int:
        """Send a signal, read what remains, and return the exit code."""
        if number is not None:
            self._process.send_signal(number)
        while self._read():
            pass
        return self._process.wait(60)

    def close(self) -> None:
        """End the program, if it has not ended."""
        self._process.kill()
        self._process.wait()
        os.close(self._main)

    def _read(self) -> bool:
        if not select.select([self._main], [], [], 60.0)[0]:
            return False
        try:
            chunk = os.read(self._main, 65536)
        except OSError:
            return False
        self.said += chunk.decode(errors="replace")
        return bool(chunk)


class Controller:
    """A session that publishes events as a controller does."""

    def __init__(self) -> None:
        zenoh = pytest.importorskip("zenoh")
        self.endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        config = zenoh.Config()
        config.insert_json5("listen/endpoints", json.dumps([self.endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        state = json.dumps({"event": "state", "state": "running", "iteration": 3})
        self._answers = self.session.declare_queryable(
            "ilc/gantry/state", lambda query: query.reply("ilc/gantry/state", state)
        )
        self._token = self.session.liveliness().declare_token("ilc/gantry/alive")

    def put(self, topic: str, payload: object) -> None:
        """Publish one object."""
        self.session.put(f"ilc/gantry/{topic}", json.dumps(payload))

    def monitor(self, *more: str) -> list[str]:
        """Return the command that watches it."""
        return [sys.executable, "-m", "ilc_rt.cli", "monitor", "gantry", "--no-scouting",
                "--connect", self.endpoint, *more]  # fmt: skip


@pytest.fixture(scope="module")
def controller() -> Iterator[Controller]:
    controller = Controller()
    yield controller
    controller.session.close()


SCREEN_ON, SCREEN_OFF, CURSOR_ON = "\x1b[?1049h", "\x1b[?1049l", "\x1b[?25h"


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_a_signal_leaves_the_terminal_as_it_was(
    controller: Controller, tmp_path: Path, number: signal.Signals, code: int
) -> None:
    """The live view appears, follows a new width, and is gone; its last state is left below."""
    terminal = Terminal(controller.monitor(), tmp_path, columns=80)
    try:
        terminal.wait_for("run 3: running")
        controller.put("fault", {"event": "fault", "reason": "a guard is open \x1b[2J"})
        seen = terminal.wait_for(r"FAULT: a guard is open \\x1b\[2J")
        terminal.resize(40)
        terminal.wait_for(r"run 3: running", seen)
        assert terminal.end(number) == code
    finally:
        terminal.close()
    assert terminal.said.count(SCREEN_ON) == terminal.said.count(SCREEN_OFF) == 1
    after = terminal.said.rpartition(SCREEN_OFF)[2]
    assert CURSOR_ON in terminal.said.rpartition("\x1b[?25l")[2]
    assert "FAULT: a guard is open" in after
    assert "Traceback" not in after


def test_a_late_joiner_takes_from_a_library_what_it_has_not_heard(
    controller: Controller, finished: CampaignResult, tmp_path: Path
) -> None:
    """Axes, units and earlier runs; the change of a run is that since the first of its campaign."""
    library = ("--library", str(finished.library))
    terminal = Terminal(controller.monitor(*library), tmp_path, columns=100)
    try:
        terminal.wait_for("run 3: running")
        # The axes by their names, and the runs before this one.
        seen = terminal.wait_for(r"x +following")
        terminal.wait_for(r"max tracking")
        assert terminal.end(signal.SIGINT) == 130
    finally:
        terminal.close()
    shown = terminal.said[seen:].rpartition(SCREEN_OFF)[2]
    assert re.findall(r"^ +([0-9]) +[0-9]", shown, re.MULTILINE) == ["0", "1", "2"], shown
    first, _, last = Library(finished.library).list()
    terminal = Terminal(controller.monitor("--plain", "-n", "1", *library), tmp_path, columns=100)
    try:
        terminal.wait_for(r"gantry: running \(run 3\)")
        controller.put("iteration", {
            "event": "iteration", "id": 3, "index": 2, "digest": last["digest"],
            "tracking_inf_m": 0.1 * first["tracking_inf_m"],
            "tracking_rms_m": 0.1 * first["tracking_rms_m"],
            "contour_inf_m": 0.1 * first["contour_inf_m"], "contour_rms_m": 1e-6,
        })  # fmt: skip
        assert terminal.end() == 0
    finally:
        terminal.close()
    assert re.search(r"^gantry +2 .*-90\.0 %", terminal.said, re.MULTILINE), terminal.said


def test_plain_lines_are_printed_where_they_are_wanted(
    controller: Controller, tmp_path: Path
) -> None:
    """With --plain in a terminal, and in a terminal that cannot move its cursor."""
    terminal = Terminal(controller.monitor("--plain", "--iterations", "1"), tmp_path, columns=80)
    try:
        terminal.wait_for(r"gantry: running \(run 3\)")
        controller.put("iteration", {
            "event": "iteration", "id": 1, "index": 0, "tracking_inf_m": 1e-3,
            "tracking_rms_m": 1e-3,
        })  # fmt: skip
        assert terminal.end() == 0
    finally:
        terminal.close()
    assert "\x1b" not in terminal.said
    assert re.search(r"^gantry +0 +1000", terminal.said, re.MULTILINE)
