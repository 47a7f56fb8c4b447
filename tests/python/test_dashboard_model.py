"""State of watched cells, without a browser: windows, captures, words, libraries, notes."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from watched_fixture import STAGES, START, batch, ended, fed, said

from ilc_rt import BadInputError, CampaignResult, Library
from ilc_rt.dashboard import charts
from ilc_rt.dashboard.archive import Archive, distance, relevance
from ilc_rt.dashboard.capture import Capture
from ilc_rt.dashboard.fleet import Fleet
from ilc_rt.dashboard.flight import read_flight
from ilc_rt.dashboard.model import CellModel
from ilc_rt.dashboard.notes import NOTE_MAX, notes_file, read_notes, write_note
from ilc_rt.dashboard.status import SILENT_S, SYMBOLS, axis_words, run_words
from ilc_rt.dashboard.window import Window
from ilc_rt.monitor import Message


def test_a_peak_of_one_cycle_survives_thinning() -> None:
    window = Window(1, span=10, n_buckets=8)
    values = np.zeros((200, 1))
    values[137], values[150] = 7.0, -3.0
    for first in range(0, 200, 25):
        window.extend(first, values[first : first + 25])
    first, low, high = window.since(0)
    # The newest bucket is still being filled; of the others the ring has the last seven.
    assert (first, window.end) == (12, 19)
    assert high.ravel().tolist() == [0.0, 7.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert low.ravel().tolist() == [0.0, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0]
    assert len(window.since(17)[1]) == 2


def test_lost_batches_leave_a_gap_and_old_values_never_come_back() -> None:
    window = Window(1, span=5, n_buckets=6)
    window.extend(0, np.ones((20, 1)))
    window.extend(35, np.full((10, 1), 2.0))
    first, low, _ = window.since(0)
    assert first == 3
    assert np.array_equal(np.isnan(low.ravel()), [False, True, True, True, False])
    assert low[-1, 0] == 2.0


def test_a_capture_knows_whether_it_is_complete() -> None:
    capture = Capture(3, 2)
    capture.put(np.arange(0, 3000), np.ones((3000, 3, 2)))
    assert capture.n_samples == 3000
    assert capture.is_complete(3000)
    assert not capture.is_complete(6000)
    capture.put(np.array([10**9, -1]), np.ones((2, 3, 2)))
    assert capture.n_samples == 3000


def test_a_campaign_is_followed_from_its_start_to_its_end() -> None:
    model = fed(Message("gantry", "alive", {}), said(START))
    assert model.axis_names == ("x", "y")
    for state, level in (("enabling", "busy"), ("returning", "busy"), ("running", "run")):
        fed(said({"event": "state", "state": state, "iteration": 1}), model=model)
        assert model.status(0.2).level == level
    fed(said({"event": "progress", "iteration": 1, "sample": 25, "n_samples": 50}), model=model)
    assert run_words(model) == "run 1 (2 of 4), 50 %"
    fed(ended(0, 1e-3), ended(1, 1e-4), model=model)
    assert [record.index for record in model.records] == [0, 1]
    assert model.overruns == 2
    fed(said({"event": "end", "status": "completed", "iterations": 2}), model=model)
    status = model.status(1e6)
    assert (status.words, status.level) == ("completed", "idle")
    assert run_words(model) == "2 runs"


def test_signals_reach_window_and_captured_run() -> None:
    model = fed(said(START), batch(0), batch(25, sample=25), ended(0, 1e-3), batch(50, None))
    assert model.window is not None
    _, low, high = model.window.since(0)
    assert np.nanmax(high[:, 0]) == pytest.approx(5e-4)
    assert np.nanmin(low[:, 0]) == pytest.approx(1e-5)
    run = model.last_run
    assert run is not None
    assert (run.iteration, run.n_samples) == (0, 50)
    assert run.reference_m[49, 0] == pytest.approx(0.049)
    assert np.allclose(run.input[:, 0], 1e-4)
    epoch = model.epoch
    fed(batch(0), model=model)
    assert model.epoch == epoch + 1, "a loop that starts again begins a new window"


def test_a_run_that_was_heard_in_part_is_not_drawn() -> None:
    model = fed(said(START), batch(25, sample=25), ended(0, 1e-3), batch(50, 1, 0))
    assert model.last_run is None


def test_the_last_batch_may_come_after_the_end_of_its_run() -> None:
    start = START | {"n_samples": 25}
    model = fed(said(start), batch(0), ended(0, 1e-3), batch(25, 0, 25, n=3))
    assert model.last_run is not None
    assert model.last_run.n_samples == 28


def test_a_fault_names_its_axis_in_words() -> None:
    reason = "axis y (node 2): following error 3 mm, limit 2 mm"
    fault = {"event": "fault", "reason": reason, "kind": "following_error", "axis": "y"}
    model = fed(said(START), said(fault, "fault"))
    assert model.status(0.2).level == "fault"
    assert axis_words(model, 1, 0.2).words == f"fault: {reason}"
    assert axis_words(model, 0, 0.2).words == "stopped with the others"
    assert model.log[-1].kind == "fault"
    fed(said({"event": "state", "state": "bringing_up"}), model=model)
    assert model.fault is None


def test_a_rollback_and_learning_off_keep_their_reason() -> None:
    judged = {
        "event": "judged", "id": 2, "index": 1, "rolled_back": False, "learning_off": True,
        "remark": "the error grew twice: learning is off",
    }  # fmt: skip
    model = fed(said(START), ended(0, 1e-3), ended(1, 2e-3), said(judged, "iteration"))
    assert model.decision is model.last
    assert model.decision is not None
    assert model.decision.learning_off
    assert model.decision.remark == judged["remark"]
    option = charts.runs(model)
    assert option["series"][0]["markLine"]["data"][0]["name"] == "learning off"


def test_silence_is_told_and_ends_by_itself() -> None:
    model = fed(Message("gantry", "alive", {}), said(START), batch(0))
    assert model.status(0.2 + SILENT_S / 2).level != "silent"
    status = model.status(12.3)
    assert (status.words, status.level) == ("silent since 12 s", "silent")
    model.apply(Message("gantry", "gone", {}), 13.0, 1e9)
    assert model.status(13.0).level == "silent"
    assert "gone without an end" in model.log[-1].text
    model.apply(Message("gantry", "alive", {}), 20.0, 1e9)
    model.apply(said({"event": "state", "state": "running", "iteration": 0}), 20.1, 1e9)
    assert model.status(20.2).words == "running"
    assert any("is back" in note.text for note in model.log)


def test_drives_that_are_brought_up_are_not_silent() -> None:
    model = fed(said({"event": "state", "state": "bringing_up"}))
    assert model.status(60.0).words == "bringing the drives up"


@pytest.mark.parametrize(
    "change",
    [
        {"first_sync": "1"}, {"first_sync": -1}, {"iteration_and_sample": []},
        {"reference_m": [["a", 0.0]] * 25}, {"reference_m": [[0.0]] * 25}, {"encoder_m": None},
        {"input": [[1e400, 0.0]] * 24}, {"reference_m": {}}, {"iteration_and_sample": [[0, 0]]},
    ],
)  # fmt: skip
def test_a_strange_batch_is_left_out(change: dict[str, Any]) -> None:
    model = fed(said(START))
    fed(Message("gantry", "servo", batch(0).payload | change), model=model)
    assert model.window is None


def test_strange_places_of_samples_hurt_nothing() -> None:
    places = [[0, 10**12], [0, -1], [True, 0], ["0", 0], [0], None] * 4 + [[0, 0]]
    message = batch(0)
    message.payload["iteration_and_sample"] = places
    model = fed(said(START), message, batch(25, 1, 0))
    assert model.window is not None
    assert model.last_run is None


def test_a_fleet_follows_who_is_wanted() -> None:
    every, one = Fleet(), Fleet(["press"])
    for fleet in (every, one):
        fleet.apply(said(START), 0.0, 1e9)
    assert list(every.cells) == ["gantry"]
    assert list(one.cells) == ["press"]
    assert one.cells["press"].status(5.0).words == "not heard yet"


def test_timing_is_told_with_its_cause() -> None:
    late = {
        "event": "late", "tick": 7, "cause": "wake_up", "stages": STAGES,
        "usual": STAGES | {"wake_us": 12.0}, "iteration": 1, "count": 3,
    }  # fmt: skip
    histogram = {"p50": 1.0, "p99": 2.0, "p999": 3.0, "max": 4.0, "bins": [[1.0, 5], [4.0, 1]]}
    latency = {"event": "latency", "wake_late_us": histogram, "execution_us": histogram}
    model = fed(said(START), said(late, "latency"), said(latency, "latency"))
    assert model.n_late == 3
    assert "the host woke the loop 2000 µs late (usually 12)" in model.log[-1].text
    assert charts.late_cycle(model)["series"][0]["data"] == [12.0, 2000.0]
    assert charts.timing(model)["series"][0]["data"] == [[1.0, 5], [4.0, 1]]


def test_every_level_has_a_sign_of_its_own() -> None:
    assert len(set(SYMBOLS.values())) == len(SYMBOLS)


def test_the_time_left_follows_the_clock_of_the_messages() -> None:
    """Half of a run of four in 10 s leaves 70 s."""
    model = fed(said(START))
    model.apply(said({"event": "state", "state": "running", "iteration": 0}), 0.0, 1e9)
    assert model.left_s is None
    half = said({"event": "progress", "iteration": 0, "sample": 25, "n_samples": 50})
    model.apply(half, 10.0, 1e9 + 10.0)
    assert model.left_s == pytest.approx(70.0)


def test_a_comparison_ends_where_its_runs_end(finished: CampaignResult) -> None:
    archive = Archive([finished.library])
    runs = archive.aligned([(0, 1), (0, 3)], axis=0)
    command, error = (charts.compared(runs, what, 0) for what in ("command", "error"))
    assert command["xAxis"]["max"] == error["xAxis"]["max"] == "dataMax"
    assert (command["yAxis"]["scale"], error["yAxis"]["scale"]) == (True, False)
    captured = archive.capture("gantry", finished.campaign)
    model = CellModel("gantry")
    model.remember(archive.campaign("gantry"), "")
    assert charts.inputs(model, captured)["xAxis"]["max"] == "dataMax"


def test_runs_are_drawn_in_one_unit_and_without_zeros() -> None:
    model = fed(said(START), ended(0, 1e-3), ended(1, 0.0))
    option = charts.runs(model)
    assert option["yAxis"]["type"] == "log"
    assert option["series"][0]["data"] == [[0, 1000.0], [1, None]]
    json.dumps(option, allow_nan=False)


def test_a_long_line_is_thinned_to_its_extremes() -> None:
    values = np.zeros(100_000)
    values[54_321] = 3.0
    points = charts.thinned(np.arange(100_000) * 1e-3, values, 1e3, 1000)
    assert len(points) == 1000
    assert max(y for _, y in points if y is not None) == 3000.0
    assert all(b[0] > a[0] for a, b in pairwise(points))  # type: ignore[operator]


def test_runs_of_other_campaigns_lie_on_one_time(finished: CampaignResult, tmp_path: Path) -> None:
    other = tmp_path / "other.db"
    run = Library(finished.library).load(2)
    late = {key: np.vstack([run[key][:1]] * 10 + [run[key]]) for key in ("error_m", "reference_m")}
    moved = np.vstack([run["input"][:1]] * 10 + [run["input"]])
    Library(other).append(
        moved, late["error_m"], run["cycle_s"], reference_m=late["reference_m"], cell="gantry"
    )
    archive = Archive([finished.library, other])
    runs = archive.aligned([(0, 2), (1, 1)], axis=0)
    assert runs[1].shift_s == pytest.approx(-10 * run["cycle_s"])
    assert runs[1].is_same
    option = charts.compared(runs, "error", 0)
    assert len(option["series"]) == 2
    first, second = (dict(series["data"]) for series in option["series"])
    assert second[1.0] == pytest.approx(first[1.0], abs=1e-3)
    with pytest.raises(BadInputError, match="no run 99 any more"):
        archive.load((0, 99))
    with pytest.raises(BadInputError, match="library 7: there are 2"):
        archive.load((7, 1))


def test_what_is_no_library_is_refused_and_a_missing_one_is_empty(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text("[cell]\n")
    with pytest.raises(BadInputError):
        Archive([file])
    later = Archive([tmp_path / "later.db"])
    assert later.rows() == []
    Library(tmp_path / "later.db").append(np.zeros(3), np.ones(3), 0.01)
    assert [row["id"] for row in later.rows()] == [1]


def test_relevance_falls_with_error_and_distance() -> None:
    rows = [
        {"tracking_rms_m": 1e-4, "disturbance": [20.0]},
        {"tracking_rms_m": 1e-4, "disturbance": [30.0]},
        {"tracking_rms_m": 1e-3, "disturbance": [20.0]},
    ]
    shares = relevance(rows, {"disturbance": [20.0]})
    assert sum(shares) == pytest.approx(1.0)
    assert shares[0] > max(shares[1:])
    assert distance(rows[1], rows[0]) == 10.0
    assert distance({"disturbance": None}, rows[0]) is None
    assert relevance([], {}) == []


def test_a_run_without_a_finite_error_takes_no_share_of_the_others() -> None:
    """As another program may have written it."""
    good = {"tracking_rms_m": 1e-4, "disturbance": [20.0]}
    odd = [good | {"tracking_rms_m": error} for error in (float("nan"), 1e300, None)]
    assert relevance([good, *odd, good], good) == [0.5, 0.0, 0.0, 0.0, 0.5]
    assert relevance(odd, good) == [0.0, 0.0, 0.0]


def test_who_watches_makes_and_changes_no_library(tmp_path: Path, finished: CampaignResult) -> None:
    """An empty file stays empty; one that is deleted between two looks is not made again."""
    empty, gone = tmp_path / "empty.db", tmp_path / "gone.db"
    empty.touch()
    gone.write_bytes(Path(finished.library).read_bytes())
    (record, *_) = CampaignResult.from_library(gone).records
    archive = Archive([empty, gone])
    assert len(archive.rows()) == 3
    archive.sources[0].check()
    with pytest.raises(BadInputError, match="an empty file"):
        archive.sources[0].load(1)
    gone.unlink()
    # As if it had been deleted just after its stamp was looked at.
    assert archive.sources[1].rows() == []
    for load in (lambda: archive.sources[1].load(1), record.row):
        with pytest.raises(BadInputError, match=r"gone\.db: no such library"):
            load()
    assert [path.name for path in tmp_path.iterdir()] == ["empty.db"]
    assert empty.stat().st_size == 0


def test_notes_are_kept_beside_the_library(tmp_path: Path) -> None:
    library = tmp_path / "l.db"
    assert read_notes(library) == {}
    write_note(library, "c1/3", "  belt tightened\n")
    write_note(library, "c1/4", "<b>ü</b>")
    assert read_notes(library) == {"c1/3": "belt tightened", "c1/4": "<b>ü</b>"}
    write_note(library, "c1/3", "")
    assert read_notes(library) == {"c1/4": "<b>ü</b>"}
    assert [path.name for path in tmp_path.iterdir()] == ["l.db.notes.json"]
    with pytest.raises(BadInputError, match=f"at most {NOTE_MAX}"):
        write_note(library, "c1/3", "x" * (NOTE_MAX + 1))
    notes_file(library).write_text("[1]")
    with pytest.raises(BadInputError, match="an object of texts is needed"):
        read_notes(library)
    with pytest.raises(BadInputError):
        write_note(library, "c1/3", "not lost")
    assert notes_file(library).read_text() == "[1]"


def test_dashboards_beside_each_other_lose_no_note(tmp_path: Path) -> None:
    """Two processes that write at the same time, each notes of its own."""
    code = (
        "import sys; from pathlib import Path; from ilc_rt.dashboard.notes import write_note\n"
        "sys.stdin.read(1)\n"
        "for number in range(40): write_note(Path('l.db'), f'{sys.argv[1]}/{number}', 'seen')"
    )
    writers = [
        subprocess.Popen([sys.executable, "-c", code, name], cwd=tmp_path, stdin=subprocess.PIPE)
        for name in ("a", "b")
    ]
    for writer in writers:
        assert writer.stdin is not None
        writer.stdin.write(b"!")
        writer.stdin.close()
    assert [writer.wait(60.0) for writer in writers] == [0, 0]
    assert len(read_notes(tmp_path / "l.db")) == 80
    assert [path.name for path in tmp_path.iterdir()] == ["l.db.notes.json"]


def test_a_flight_record_beside_the_library_tells_who_was_late(tmp_path: Path) -> None:
    histogram = {"p50": 1.0, "p99": 2.0, "p999": 3.0, "max": 4.0, "bins": [[1.0, 5]]}
    late = {"tick": 7, "cause": "wake_up", "stages": STAGES, "usual": STAGES | {"wake_us": 12.0}}
    record = {
        "cell": "gantry", "campaign": "c1", "stages_us": {"wake": histogram, "send": histogram},
        "late": {"wake_up": 2, "receive": 1, "missed": 4}, "worst": [late],
    }  # fmt: skip
    file = tmp_path / "l.gantry.late.json"
    file.write_text(json.dumps(record))
    found = read_flight(tmp_path / "l.db", "gantry")
    assert found is not None
    assert (found.n_late, list(found.timing)) == (3, ["wake-up late", "send"])
    model = CellModel("gantry")
    model.remember_flight(found)
    assert model.late is not None
    assert charts.late_cycle(model)["series"][0]["data"] == [12.0, 2000.0]
    fed(said(START), model=model)
    model.remember_flight(found)
    assert model.late is None, "the record of an earlier run is not that of this one"
    for text in ("", "[]", '{"late": 3}', json.dumps(record | {"worst": [{}]})):
        file.write_text(text)
        assert read_flight(tmp_path / "l.db", "gantry") is None
    assert read_flight(tmp_path / "l.db", "nobody") is None
