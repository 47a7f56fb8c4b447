"""Pages of the dashboard over odd libraries and cells: nothing to show, odd names, deleted runs."""

from __future__ import annotations

import shutil
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import pytest
from processes_fixture import BROWSER_WAIT_MS, Process

from ilc_rt import Library

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
if find_spec("nicegui") is None:
    pytest.skip("nicegui is not installed", allow_module_level=True)
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this computer"),
    pytest.mark.xdist_group("odd dashboard"),
    pytest.mark.timeout(600),
]

LONG = "20261129-074100-7aad-of-the-press-in-hall"
ODD = ("my cell", "機械 ünïcode", "<b>x</b>", "a" * 200)


class Served:
    """A dashboard over a library, and a browser."""

    def __init__(self, folder: Path, browser: Browser) -> None:
        self.browser = browser
        # For all that is expected below; five seconds are few for a loaded machine.
        sync_api.expect.set_options(timeout=BROWSER_WAIT_MS)
        self.library = Library(folder / "odd.db")
        for number in range(4):
            error = np.full((40, 1), 1e-4 / (1 + number))
            self.library.append(0.1 * error, error, 0.002, cell="single", campaign=f"{LONG}-1")
        for cell in ODD:
            self.library.append(
                np.zeros(3), np.ones(3), 0.01, cell=cell, campaign="c", law="<i>law</i>"
            )
        argv = [
            sys.executable, "-m", "ilc_rt.cli", "dashboard", "single", "new", "--port", "0",
            "--no-scouting", "--library", "odd.db",
        ]  # fmt: skip
        self.process = Process(argv, folder)
        self.url = self.process.line_with("dashboard: ").partition(": ")[2]

    def page(self, path: str, width: int = 1400) -> Page:
        """Open a page in a browser profile of its own."""
        context = self.browser.new_context(viewport={"width": width, "height": 900})
        context.set_default_timeout(BROWSER_WAIT_MS)
        page = context.new_page()
        page.goto(self.url + path)
        return page


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with sync_api.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        served = Served(tmp_path_factory.mktemp("odd"), browser)
        try:
            yield served
        finally:
            browser.close()
            served.process.close()
        # What fails in a page is logged here.
        assert not any("Traceback" in line for line in served.process.errors)


def words_in(page: Page, chart: str) -> str:
    """Wait for the words in the middle of a chart, and return them."""
    page.wait_for_function(f"ilc.option?.('{chart}')?.title?.[0]?.text")
    return str(page.evaluate(f"ilc.option('{chart}').title[0].text"))


def test_every_page_has_a_language_a_title_and_one_heading(served: Served) -> None:
    """For a screen reader, and to tell tabs apart."""
    for path, name in (("/", "Cells"), ("/library", "Library"), ("/cell/new", "new"),
                       ("/cell/unknown", "unknown")):  # fmt: skip
        page = served.page(path)
        sync_api.expect(page.locator("h1")).to_have_text(name)
        assert page.title() == f"{name} - ilc-rt"
        assert page.evaluate("document.documentElement.lang") == "en"
        page.context.close()


def test_a_chart_that_shows_nothing_says_why(served: Served) -> None:
    page = served.page("/cell/new")
    assert words_in(page, "runs") == "no run has ended yet"
    assert words_in(page, "inputs") == "no run has been heard to its end yet"
    page.goto(f"{served.url}/cell/single")
    page.wait_for_function("ilc.option?.('runs')?.series[0]?.data.length === 4")
    assert words_in(page, "contour") == "a contour needs two linear axes"
    assert words_in(page, "live-error") == "no signals yet; in lock-step a cell sends none"
    page.context.close()


def test_names_are_texts_and_found(served: Served) -> None:
    """Blanks, letters of every script, markup; what is too long does not widen the page."""
    page = served.page("/library", width=390)
    sync_api.expect(page.locator("[data-run]")).to_have_count(8)
    for wanted, cell in (("機械", "機械 ünïcode"), ("my cell", "my cell"), ("<b>", "<b>x</b>")):
        page.fill('input[type="search"]', wanted)
        sync_api.expect(page.locator("[data-run]")).to_have_count(1)
        sync_api.expect(page.locator(".runs-table tbody tr")).to_contain_text(cell)
        sync_api.expect(page.locator(".runs-table tbody tr")).to_contain_text("<i>law</i>")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.context.close()


def test_a_phone_shows_the_names_of_all_runs_that_are_compared(served: Served) -> None:
    page = served.page("/library", width=390)
    for run in (1, 2, 3):
        page.check(f'[data-run="0-{run}"]')
    page.wait_for_function("ilc.option('compare-input')?.series.length === 3")
    legend, grid = page.evaluate(
        "[ilc.option('compare-input').legend[0], ilc.option('compare-input').grid[0]]"
    )
    assert (legend["type"], legend["left"]) == ("plain", 0)
    # Each name takes a row, and the lines begin below them.
    assert grid["top"] == 30 + 3 * 15
    page.set_viewport_size({"width": 1400, "height": 900})
    page.wait_for_function("ilc.option('compare-input').legend[0].type === 'scroll'")
    page.context.close()


def test_a_chosen_run_that_is_deleted_is_left_out(served: Served) -> None:
    """The others stay, and more can be chosen."""
    page = served.page("/library")
    for run in (1, 2):
        page.check(f'[data-run="0-{run}"]')
    page.wait_for_function("ilc.option('compare-error')?.series.length === 2")
    assert served.library.retain(newest=7) == 1
    page.wait_for_function("ilc.option('compare-error')?.series.length === 1")
    told = page.locator('[data-name="compared"]')
    sync_api.expect(told).to_contain_text("▲ 1 chosen run deleted meanwhile. 1 of at most 8 runs")
    page.check('[data-run="0-3"]')
    page.wait_for_function("ilc.option('compare-error')?.series.length === 2")
    sync_api.expect(told).to_contain_text("2 of at most 8 runs")
    assert "deleted" not in told.inner_text()
    for run in (2, 3):
        page.uncheck(f'[data-run="0-{run}"]')
    page.wait_for_function("ilc.option('compare-error')?.series.length === 0")
    assert words_in(page, "compare-error") == "no run is chosen"
    page.context.close()
