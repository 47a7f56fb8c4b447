"""The report: complete, self-contained and correct."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ilc_rt import BadInputError, CampaignResult, IterationRecord, plots
from ilc_rt.deviation import magnification, path_deviation
from ilc_rt.events import Histogram, LatencyEvent
from ilc_rt.report import render, write_report
from ilc_rt.result import micrometres

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.xdist_group("report")

VOID = {"meta", "link", "br", "img", "path", "use", "rect", "line", "circle"}


class Page(HTMLParser):
    """Collects ids and checks that every element is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.references: list[str] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Record ids and references."""
        for name, value in attributes:
            if name == "id" and value:
                self.ids.append(value)
            if name in {"href", "src", "xlink:href"} and value:
                self.references.append(value)
            if value:
                self.references += re.findall(r"url\(([^)]*)\)", value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Handle an element that closes itself."""
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        """Check that it is the one opened last."""
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Collect the text."""
        self.text += data


@pytest.fixture(scope="module")
def page(finished: CampaignResult) -> Page:
    """Return the parsed report of a real campaign."""
    parsed = Page()
    parsed.feed(render(finished))
    parsed.close()
    return parsed


def test_the_page_is_well_formed_and_small(finished: CampaignResult, page: Page) -> None:
    """All elements closed, ids unique, small enough to mail."""
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert len(render(finished).encode()) < 600_000


def test_the_page_needs_nothing_else(finished: CampaignResult, page: Page) -> None:
    """No link leaves the page, and every internal reference has a target."""
    assert not re.search(r"https?:|//[a-z]|@import", render(finished))
    targets = {reference.lstrip("#") for reference in page.references}
    assert all(reference.startswith("#") for reference in page.references)
    assert targets <= set(page.ids)


def test_the_page_shows_the_figures_of_every_run(finished: CampaignResult, page: Page) -> None:
    """Headings, pictures, table and facts are present."""
    for name in ("convergence", "contour", "tracking", "input"):
        assert name in page.ids
    for record in finished.records:
        assert micrometres(record.tracking_inf_m) in page.text
        assert micrometres(record.contour_inf_m) in page.text
    for said in (finished.sentence(), finished.campaign, "error in µm", "x in mm", "lock-step"):
        assert said in page.text
    assert "latency" not in page.ids


def test_latency_and_faults_are_shown(finished: CampaignResult) -> None:
    """A real-time campaign that ended in a fault shows both."""
    times = Histogram(8.0, 20.0, 40.0, 900.0, ((10.0, 900), (50.0, 99), (900.0, 1)))
    faulty = CampaignResult.from_library(finished.library)
    faulty.latency = LatencyEvent(times, times)
    faulty.status, faulty.reason = "fault", "node 2 <silent> & gone"
    text = render(faulty)
    assert 'id="latency"' in text
    assert "Stopped after a fault: node 2 &lt;silent&gt; &amp; gone" in text
    assert "900 µs" in text


def test_one_run_without_learning_is_a_report_too(finished: CampaignResult) -> None:
    """Nothing learned yet: no picture of an input, no comparison."""
    single = CampaignResult.from_library(finished.library)
    del single.records[1:]
    text = render(single)
    assert "1 run" in text
    assert 'id="input"' not in text


def test_a_folder_gets_the_usual_name(finished: CampaignResult, tmp_path: Path) -> None:
    """A path without a suffix is a folder; without a run there is no report."""
    assert write_report(finished, tmp_path / "new") == tmp_path / "new" / "ilc-report.html"
    with pytest.raises(BadInputError, match="no run was completed"):
        write_report(CampaignResult("l.db"), tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInputError, match="cannot be written"):
        write_report(finished, tmp_path / "file" / "r.html")


def test_the_contour_picture_is_to_scale(finished: CampaignResult) -> None:
    """The picture shows the path plus the stated multiple of the deviation."""
    figure = plots.contour(finished)
    assert figure is not None
    upper = figure.axes[0]
    factor = int(
        re.search(r"shown ([\d,]+) times", upper.get_title(loc="left"))[1].replace(",", "")
    )
    record = finished.records[0]
    deviation = path_deviation(record.reference_m, record.tool_or_encoder_m)
    drawn = upper.lines[1].get_xydata() * 1e-3
    np.testing.assert_allclose(drawn, record.reference_m + factor * deviation, atol=1e-12)
    # The controller computes the same distance independently.
    assert record.contour_m is not None
    np.testing.assert_allclose(
        np.linalg.norm(deviation, axis=1).max(), record.contour_inf_m, rtol=0.02
    )


def test_deviation_is_normal_to_the_path_and_ignores_lag() -> None:
    """On a circle, a lag has no effect and a larger radius has the full one."""
    angle = np.linspace(0.0, np.pi, 2001)
    circle = np.column_stack((np.cos(angle), np.sin(angle)))
    lagging = np.column_stack((np.cos(angle - 0.02), np.sin(angle - 0.02)))
    inner = slice(100, -100)
    assert np.abs(path_deviation(circle, lagging)[inner]).max() < 1e-6
    np.testing.assert_allclose(
        path_deviation(circle, 1.01 * circle)[inner], 0.01 * circle[inner], atol=1e-6
    )
    with pytest.raises(ValueError, match="shapes differ"):
        path_deviation(circle, circle[1:])


def record(index: int, error_m: float, contour_m: float | None) -> IterationRecord:
    """Return a record with these figures."""
    return IterationRecord(
        library="l.db", id=index + 1, index=index, tracking_inf_m=error_m,
        tracking_rms_m=error_m / 2, contour_inf_m=contour_m,
    )  # fmt: skip


def test_the_sentence_says_what_was_learned() -> None:
    """First against last; the best one if it was better; tracking if there is no contour."""
    result = CampaignResult("l.db", records=[record(0, 1e-3, 2e-4), record(1, 5e-4, 1e-4)])
    assert result.sentence() == "Contour error from 200 µm to 100 µm (50.0 % less) within 2 runs."
    result.records.append(record(2, 1e-3, 3e-4))
    assert "(50.0 % more) within 3 runs; best 100 µm in run 1." in result.sentence()
    result.records = [record(0, 1e-3, 0.0), record(1, 1e-4, 0.0)]
    assert result.sentence().startswith("Tracking error from 1000 µm to 100 µm (90.0 % less)")
    assert "1 run." in CampaignResult("l.db", records=result.records[:1]).sentence()


@pytest.mark.parametrize("largest_m", [1e-7, 3.3e-6, 1e-4, 9e-3, 0.5])
def test_magnification_is_round_and_fits(largest_m: float) -> None:
    """1, 2 or 5 times a power of ten, and not larger than asked."""
    factor = magnification(largest_m, 0.1)
    assert str(factor).rstrip("0") in {"1", "2", "5"}
    assert factor == 1 or factor * largest_m <= 0.12 * 0.1
    assert magnification(0.0, 0.1) == 1
