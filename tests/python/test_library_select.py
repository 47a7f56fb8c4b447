"""Runs of a library by what they are: selection, tables, Parquet."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

from ilc_rt import BadInputError, Library

if TYPE_CHECKING:
    from pathlib import Path

    from ilc_rt import CampaignResult

N = 8
WARM = [21.0, 22.5, 24.0, 30.0]


@pytest.fixture
def library(tmp_path: Path) -> Library:
    """Return runs of two cells, each warmer and better than the one before."""
    library = Library(tmp_path / "l.db")
    for number, temperature in enumerate(WARM):
        error = np.full(N, 1e-4 / 2**number)
        for cell in ("press", "lathe"):
            library.append(np.zeros(N), error, 0.01, temperature, cell=cell, law="pd")
    return library


def test_a_library_is_counted_and_walked_through(library: Library) -> None:
    with library as same:
        assert len(same) == 2 * len(WARM)
        assert [run["id"] for run in same] == [run["id"] for run in same.list()]
    assert len(Library(":memory:")) == 0


def test_runs_are_selected_by_value_and_range(library: Library) -> None:
    def ids(**wanted: object) -> list[int]:
        return [run["id"] for run in library.select(**wanted)]

    assert ids() == list(range(1, 9))
    assert ids(cell="press") == [1, 3, 5, 7]
    assert ids(cell="press", disturbance=(22.5, 24.0)) == [3, 5]
    assert ids(disturbance=(None, 21.0)) == [1, 2]
    assert ids(tracking_rms_m=(0.0, 2.6e-5), cell="lathe") == [6, 8]
    assert ids(law="norm_optimal") == []
    created = library.list()[0]["created_utc"]
    assert ids(created_utc=(created[:4], None)) == list(range(1, 9))
    assert ids(created_utc=(None, "2001")) == []


def test_runs_are_selected_by_program_and_parameters_of_the_law(
    finished: CampaignResult, library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As text, or as what it means; over several batches."""
    monkeypatch.setattr("ilc_rt.retention.READ_AT_ONCE", 2)
    real = Library(finished.library)
    run = real.load(2)
    program, law = json.loads(run["program"]), json.loads(run["law_parameters"])
    assert real.select(program=run["program"], law_parameters=law) == real.list()
    assert real.select(program=dict(reversed(program.items())), index=1) == real.list()[1:2]
    assert real.select(program=program | {"dwell_after_s": 9.0}) == []
    assert real.select(law_parameters=law | {"rate": -1.0}) == []
    elsewhere = library.load(1)["program"]
    assert library.select(program=elsewhere, cell="press") == library.select(cell="press")
    assert library.select(program=program) == []


def test_a_run_without_a_value_is_in_no_range(library: Library) -> None:
    library.append(np.zeros(N), np.ones(N), 0.01)
    assert [run["id"] for run in library.select(disturbance=(None, None))] == list(range(1, 9))
    assert [run["id"] for run in library.select(disturbance=None)] == [9]


def test_a_key_that_no_run_has_is_refused(library: Library) -> None:
    with pytest.raises(BadInputError, match=r"temperature: a run has id, created_utc, cell"):
        library.select(temperature=21.0)


def test_runs_of_a_campaign_are_a_table_and_a_file(
    finished: CampaignResult, tmp_path: Path
) -> None:
    pytest.importorskip("pyarrow")
    library = Library(finished.library)
    table = library.to_dataframe(cell="gantry")
    assert list(table.index) == [1, 2, 3]
    assert table["tracking_rms_m"].is_monotonic_decreasing
    library.to_parquet(tmp_path / "runs.parquet", index=(1, None))
    kept = pd.read_parquet(tmp_path / "runs.parquet")
    assert list(kept["id"]) == [2, 3]
    assert list(kept["tracking_rms_m"]) == list(table["tracking_rms_m"])[1:]
    assert len(library.to_dataframe(cell="elsewhere")) == 0
