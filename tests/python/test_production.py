"""Production from Python: frozen inputs, drift, and the runs that are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from ilc_rt import BadInputError, Campaign, CampaignError, Library
from ilc_rt.events import DriftEvent, StartEvent, parse_event
from ilc_rt.wording import describe

if TYPE_CHECKING:
    from pathlib import Path


def test_a_frozen_campaign_repeats_the_best_input_and_says_so(gantry: Path, tmp_path: Path) -> None:
    library = tmp_path / "l.db"
    learned = list(Campaign(gantry, library=library, bus="loopback:").run(3))
    best = min(learned, key=lambda record: record.tracking_rms_m)
    campaign = Campaign(gantry, library=library, bus="loopback:", frozen=True)
    made = list(campaign.run(2))
    assert campaign.result.law == "frozen"
    assert campaign.result.start is not None
    assert "frozen input" in describe(campaign.result.start)
    stored = Library(str(library))
    for record in made:
        assert record.frozen_ratio is not None
        assert np.array_equal(stored.load(record.id)["input"], stored.load(best.id)["input"])
    with pytest.raises((BadInputError, CampaignError), match="no iteration with id 99"):
        list(Campaign(gantry, library=library, bus="loopback:", frozen=True, input_from=99).run(1))


def test_options_of_production_are_refused_where_they_contradict(gantry: Path) -> None:
    for options, says in (
        ({"input_from": "best"}, "--frozen"),
        ({"frozen": True, "resume": True}, "--resume"),
        ({"frozen": True, "input_from": "worst"}, "allowed: best, last, or the id of a run"),
        ({"frozen": True, "relearn_above": 0.5}, "allowed 1 to"),
        ({"keep": 0}, "allowed: all, best, or a number from 1"),
        ({"start": "command"}, "--ctl"),
    ):
        with pytest.raises(BadInputError) as refusal:
            next(Campaign(gantry, bus="loopback:", **options).events(1))
        assert says in refusal.value.reason, options


def test_runs_that_are_not_kept_are_not_in_the_result(gantry: Path, tmp_path: Path) -> None:
    campaign = Campaign(gantry, library=tmp_path / "l.db", bus="loopback:", learning=False, keep=2)
    assert len(list(campaign.run(4))) == 4
    assert [record.index for record in campaign.result.records] == [0, 2, 3]


def test_a_drift_is_an_event_of_its_own() -> None:
    event = parse_event(
        '{"event": "drift", "index": 7, "ratio": 2.0, "allowed": 1.5, "origin": "run 3"}'
    )
    assert event == DriftEvent(7, 1.5, "run 3", 2.0)
    assert StartEvent.__dataclass_fields__["ctl"].default is None
