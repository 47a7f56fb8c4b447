"""A page that is opened in the middle of a campaign: what a library or a description tells it."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import numpy as np
from watched_fixture import START, ended, fed, said

from ilc_rt import Cell, Library
from ilc_rt.dashboard import charts
from ilc_rt.dashboard.archive import Archive
from ilc_rt.dashboard.model import CellModel
from ilc_rt.watched_axis import drive_words

if TYPE_CHECKING:
    from pathlib import Path

    from ilc_rt import CampaignResult
    from ilc_rt.monitor import Message


def test_another_campaign_whose_start_was_missed_begins_its_runs_anew() -> None:
    model = fed(said(START), ended(0, 1e-3), ended(1, 1e-4), ended(2, 1e-5))
    fed(ended(1, 2e-3, digest="another"), model=model)
    assert [run.index for run in model.records] == [1]
    assert model.campaign is None


def test_a_run_tells_its_campaign() -> None:
    model = fed(ended(3, 1e-3, campaign="a"), ended(4, 1e-4, campaign="a"))
    assert (model.campaign, [run.index for run in model.records]) == ("a", [3, 4])
    assert model.named_by(ended(5, 1e-5, campaign="a", digest="d").event) == ("a", "d")
    # As late in its campaign as that of the other one, whose end was missed.
    fed(ended(5, 2e-3, campaign="b"), model=model)
    assert (model.campaign, [run.index for run in model.records]) == ("b", [5])


def test_a_state_after_the_end_belongs_to_the_next_campaign() -> None:
    reason = "node 2 is silent"
    end = said({"event": "end", "status": "fault", "iterations": 1, "reason": reason})
    fault = said({"event": "fault", "reason": reason, "axis": "y"}, "fault")
    model = fed(said(START), ended(0, 1e-3), fault, end)
    assert [note.kind for note in model.notes] == ["fault"], "the reason is said once"
    assert [note.text for note in model.log][-2:] == [reason, "fault after 1 run"]
    fed(said({"event": "state", "state": "bringing_up"}), model=model)
    assert (model.records, model.campaign, model.fault, model.notes) == ([], None, None, [])
    assert not any(axis.is_faulty for axis in model.axes)
    assert model.axis_names == ("x", "y"), "the axes are those of the cell"
    assert reason in [note.text for note in model.log], "the log goes on"


def test_a_run_that_the_library_had_already_is_the_same_run(finished: CampaignResult) -> None:
    archive = Archive([finished.library])
    rows = archive.campaign("gantry")
    model = fed(said({"event": "state", "state": "running", "iteration": 2}))
    model.remember(rows, "")
    fed(ended(2, 2e-3, digest=rows[2]["digest"]), model=model)
    assert [run.index for run in model.records] == [0, 1, 2]
    assert model.records[2].tracking_inf_m == 2e-3
    assert model.campaign == rows[0]["campaign"]


def test_a_first_run_like_that_of_the_library_begins_another_campaign(
    finished: CampaignResult,
) -> None:
    """Simulated cells make the same first run each time."""
    archive = Archive([finished.library])
    rows = archive.campaign("gantry")
    model = fed()
    model.remember(rows, "")
    fed(ended(0, 1e-3, digest=rows[0]["digest"]), ended(1, 1e-4, digest="new"), model=model)
    assert [run.index for run in model.records] == [0, 1]
    assert model.campaign is None
    model.remember(rows, "")
    fed(said({"event": "state", "state": "running", "iteration": 1}), model=model)
    assert model.records == [], "two runs were made, the library has three"


def test_a_run_tells_the_campaign_whose_start_was_not_heard(
    finished: CampaignResult, tmp_path: Path
) -> None:
    """By its digest, though the library has a newer campaign of the cell."""
    library = Library(tmp_path / "l.db")
    shutil.copy(finished.library, library.path)
    zeros = np.zeros((4, 2))
    library.append(zeros, zeros + 1.0, 0.002, cell="gantry", campaign="newer")
    archive = Archive([library.path])
    last = archive.campaign("gantry", finished.campaign)[-1]
    model = fed(said({"event": "state", "state": "returning", "iteration": 3}))
    event = ended(2, 1e-5, digest=last["digest"])
    fed(event, model=model)
    assert model.lacks(event)
    assert archive.campaign("gantry")[0]["campaign"] == "newer"
    model.remember(archive.campaign("gantry", None, last["digest"]), "")
    assert (model.campaign, [run.index for run in model.records]) == (finished.campaign, [0, 1, 2])
    assert not model.lacks(event)
    assert model.lacks(said(START)), "a start may be an answer to one who came later"
    fed(said(START | {"campaign": str(finished.campaign)}), model=model)
    model.remember(archive.campaign("gantry", model.campaign), "")
    assert [run.index for run in model.records] == [0, 1, 2]


def test_an_older_campaign_of_the_library_tells_the_axes_alone(finished: CampaignResult) -> None:
    """The first run of a campaign that has stored nothing yet is not the fourth of another."""
    archive = Archive([finished.library])
    model = fed(said({"event": "state", "state": "running", "iteration": 0}))
    model.remember(archive.campaign("gantry"), "")
    assert (model.axis_names, model.law) == (("x", "y"), archive.rows()[0]["law"])
    assert (model.records, model.campaign) == ([], None)


def test_a_late_joiner_takes_its_history_from_the_library(finished: CampaignResult) -> None:
    archive = Archive([finished.library])
    model = fed(said({"event": "state", "state": "running", "iteration": 3}))
    model.remember(archive.campaign("gantry"), "")
    assert [run.index for run in model.records] == [0, 1, 2]
    assert (model.axis_names, model.units) == (("x", "y"), ("m", "m"))
    fed(ended(3, 1e-5), model=model)
    assert [record.index for record in model.records] == [0, 1, 2, 3]
    captured = archive.capture("gantry", model.campaign)
    assert captured is not None
    option, factor = charts.contour(model, captured)
    assert factor > 1
    assert option["series"][0]["name"] == "programmed"
    assert archive.capture("nobody", None) is None


def test_the_newest_state_of_each_drive_is_shown() -> None:
    def drives(*states: str | None) -> Message:
        names = ("x", "y")
        told = [{"axis": a, "state": s} for a, s in zip(names, states, strict=True)]
        return said({"event": "drives", "drives": told}, topic="drives")

    model = fed(said(START), drives("switched on", None))
    assert [axis.drive for axis in model.axes] == ["switched on", None]
    assert drive_words(model.axes) == "switched on (x), unknown (y)"
    fed(drives("operation enabled", "operation enabled"), model=model)
    assert drive_words(model.axes) == "operation enabled"
    fed(drives("switch on disabled", "fault"), model=model)
    assert drive_words(model.axes) == "switch on disabled (x), fault (y)"


def test_a_description_names_the_axes_until_the_controller_does(gantry: Path) -> None:
    model = CellModel("gantry")
    model.describe(Cell.load(gantry))
    assert model.axis_names == ("x", "y")
    fed(said(START | {"axis_names": ["u", "v"]}), model=model)
    model.describe(Cell.load(gantry))
    assert model.axis_names == ("u", "v")
