"""Views of results: arrays, tables and pictures of simulations and campaigns alike."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from ilc_rt import (
    CampaignResult,
    PdIlc,
    compare,
    discretize,
    pictures,
    plots,
    second_order,
    simulate,
)
from ilc_rt.report import render

N = 100
AXIS = discretize(second_order(94.0, 0.7), 0.002)
REFERENCE = 0.01 * np.hanning(N)


@pytest.fixture(scope="module")
def two():
    return [simulate(AXIS, PdIlc(kp=kp), REFERENCE, trials=4) for kp in (0.3, 0.6)]


def test_figures_are_arrays(two, finished: CampaignResult) -> None:
    for result in (two[0], finished):
        figures = result.figures()
        for name in ("tracking_rms_m", "tracking_inf_m", "update_ms"):
            expected = [getattr(record, name) for record in result.records]
            np.testing.assert_array_equal(figures[name], expected)
        shape = (len(result.records), result.n_axes)
        assert figures["axes_tracking_rms_m"].shape == shape
        assert figures["rolled_back"].dtype == bool
    assert np.isnan(two[0].figures()["contour_inf_m"]).all()
    assert CampaignResult("nowhere.db").figures() == {}


def test_a_table_of_pandas_has_a_row_per_run(two, finished: CampaignResult) -> None:
    pytest.importorskip("pandas")
    table = finished.to_dataframe()
    assert list(table.index) == [0, 1, 2]
    assert table["contour_inf_m"].iloc[2] == finished.records[2].contour_inf_m
    assert table["axes_tracking_rms_m[1]"].iloc[1] == finished.records[1].axes_tracking_rms_m[1]
    assert len(two[0].to_dataframe()) == 4


def test_a_notebook_shows_sentence_and_table(two) -> None:
    page = two[0]._repr_html_()
    assert two[0].sentence() in page
    assert page.count("<tr>") == 5
    assert CampaignResult("nowhere.db")._repr_html_() == "<p>No run was completed.</p>"


def test_pictures_draw_into_given_axes_and_return_them(two, finished: CampaignResult) -> None:
    panels = Figure().subplots(2, 2)
    drawn = [
        pictures.errors(two, ax=panels[0, 0]),
        pictures.signal({"slow": two[0], "fast": two[1]}, "input", ax=panels[0, 1]),
        pictures.tracking(finished, axis=1, ax=panels[1, 0]),
        pictures.spectrum(finished, run=0, ax=panels[1, 1]),
    ]
    assert drawn == list(panels.flat)
    assert [line.get_label() for line in drawn[0].lines] == ["PdIlc 1", "PdIlc 2"]
    assert [line.get_label() for line in drawn[1].lines] == ["slow", "fast"]
    np.testing.assert_allclose(
        drawn[0].lines[1].get_ydata(), 1e6 * two[1].figures()["tracking_rms_m"]
    )
    np.testing.assert_allclose(drawn[1].lines[0].get_ydata(), 1e6 * two[0].input[-1, :, 0])
    assert two[0].plot(figure="tracking_inf_m").get_ylabel() == "tracking inf in µm"


def test_a_spectrum_has_the_amplitude_of_a_sine() -> None:
    """10 periods of 3 mm."""
    sine = 3e-3 * np.sin(2 * np.pi * 10 * np.arange(1000) / 1000)
    axes = pictures.spectrum(simulate([0.0], None, sine, trials=1, dt_s=0.001))
    frequency_hz, amplitude = axes.lines[0].get_data()
    assert frequency_hz[np.argmax(amplitude)] == pytest.approx(10.0)
    assert amplitude.max() == pytest.approx(3000.0, rel=0.01)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda r: pictures.errors([]), "at least one result"),
        (lambda r: pictures.errors(r, figure="contour_inf_m"), "no run has it"),
        (lambda r: pictures.signal(r, "force"), "what = 'force'"),
        (lambda r: pictures.signal(r, axis=3), "axis = 3: allowed 0 to 0"),
        (lambda r: pictures.signal(r, run=9), "run = 9: there are 4 runs"),
        (lambda r: pictures.tracking(r, axis=-1), "axis = -1"),
    ],
)
def test_what_cannot_be_drawn_is_named(two, call, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call(two[0])


def test_the_pages_of_a_campaign_take_a_simulation(two) -> None:
    for draw in (plots.convergence, plots.tracking, plots.learned_input):
        assert draw(two[0]) is not None
    assert "PdIlc" in render(two[0])


def test_results_are_compared_in_a_table(two, finished: CampaignResult) -> None:
    found = compare({"slow": two[0], "fast": two[1]})
    for row, result in zip(found.rows, two, strict=True):
        rms = result.figures()["tracking_rms_m"]
        assert (row["first"], row["best"], row["last"]) == (rms[0], rms.min(), rms[-1])
        assert row["runs"] == 4
        reached = [run for run, error in enumerate(rms) if error < 0.1 * rms[0]]
        assert row["runs_to_tenth"] == (reached[0] if reached else None)
    assert str(found).splitlines()[0].startswith("result")
    assert "µm" in str(found)
    assert found._repr_html_().count("<tr>") == 3
    assert compare({"cell": finished}, "contour_inf_m").rows[0]["runs"] == 3


@pytest.mark.parametrize(
    ("results", "figure", "error", "words"),
    [
        ({}, "tracking_rms_m", ValueError, "at least one"),
        ([1], "tracking_rms_m", TypeError, "results is a list"),
        ({"a": 1}, "tracking_rms_m", TypeError, "a: a int"),
        (None, "contour_inf_m", ValueError, "slow: not every run has the figure"),
    ],
)
def test_what_cannot_be_compared_is_named(two, results, figure, error, words: str) -> None:
    with pytest.raises(error, match=words):
        compare({"slow": two[0]} if results is None else results, figure)


def test_a_unit_without_a_prefix_is_shown_as_it_is() -> None:
    result = simulate(AXIS, PdIlc(kp=0.5), REFERENCE, trials=2, unit="V")
    assert pictures.errors(result).get_ylabel() == "tracking rms in V"
    assert " V " in result.sentence()
    plain = simulate(AXIS, PdIlc(kp=0.5), REFERENCE, trials=2, unit="")
    assert pictures.errors(plain).get_ylabel() == "tracking rms"
