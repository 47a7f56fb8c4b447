"""The dashboard in a headless browser, beside a real controller with simulated drives."""

from __future__ import annotations

import shutil
import signal
import socket
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING

import pytest
from ports_fixture import free_port
from processes_fixture import BROWSER_WAIT_MS, PATIENT, Bench, Process

from ilc_rt import Campaign
from ilc_rt.cli import main
from ilc_rt.dashboard.notes import read_notes

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
# Not imported to find out: that is slow, and most workers of pytest never need it.
if find_spec("nicegui") is None:
    pytest.skip("nicegui is not installed", allow_module_level=True)
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this computer"),
    # One browser, one server and one cell for all of them.
    pytest.mark.xdist_group("dashboard"),
    pytest.mark.timeout(600),
]

TELEMETRY = '\n[telemetry]\nlisten = ["{}"]\nscouting = false\n'


class Watched:
    """A cell, its dashboard, and a browser."""

    def __init__(self, bench: Bench, browser: Browser) -> None:
        self.bench, self.browser = bench, browser
        self.endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        self.port = free_port(socket.SOCK_STREAM)
        more = PATIENT + TELEMETRY.format(self.endpoint)
        self.cell = bench.cell(short=True, more=more)
        # For all that is expected below; five seconds are few for a loaded machine.
        sync_api.expect.set_options(timeout=BROWSER_WAIT_MS)
        # The earlier campaign, of which a late joiner learns from the library.
        assert len(list(Campaign(self.cell, library=bench.library, bus="loopback:").run(2))) == 2
        self.dashboard = self.serve()

    def serve(self) -> Process:
        """Start the dashboard, and wait for its address."""
        argv = [
            sys.executable, "-m", "ilc_rt.cli", "dashboard", "gantry", "--port", str(self.port),
            "--no-scouting", "--connect", self.endpoint, "--library", self.bench.library,
        ]  # fmt: skip
        process = Process(argv, self.bench.folder)
        process.line_with(f"dashboard: http://127.0.0.1:{self.port}")
        return process

    def run(self, runs: int, *more: str) -> Process:
        """Start the controller on the drives, in real time."""
        return self.bench.start(
            "ilc-rt", "run", self.cell, "--bus", self.bench.bus, "--iterations", str(runs),
            "--library", self.bench.library, "--events", "--simulated-drives", *more,
        )  # fmt: skip

    def rest(self) -> None:
        """Close what a test has left open, so that one that fails disturbs no other."""
        for context in self.browser.contexts:
            context.close()
        self.bench.close()

    def page(self, path: str, scheme: str = "light", width: int = 1400) -> Page:
        """Open a page in a browser profile of its own."""
        context = self.browser.new_context(
            color_scheme=scheme,  # type: ignore[arg-type]
            viewport={"width": width, "height": 900},
        )
        context.set_default_timeout(BROWSER_WAIT_MS)
        page = context.new_page()
        # Shown beside a failure: the page tells why it was loaded again.
        page.on("console", lambda message: print(message.text))
        page.goto(f"http://127.0.0.1:{self.port}{path}")
        return page


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Watched]:
    with Bench(tmp_path_factory.mktemp("dashboard")) as bench, sync_api.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        watched = Watched(bench, browser)
        try:
            yield watched
        finally:
            browser.close()
            watched.dashboard.close()


@pytest.fixture(autouse=True)
def _rest(request: pytest.FixtureRequest) -> Iterator[None]:
    yield
    if "watched" in request.fixturenames:
        request.getfixturevalue("watched").rest()


def wait(page: Page, name: str, part: str) -> str:
    """Wait until a named text of the page contains a part, and return it."""
    label = page.locator(f'[data-name="{name}"]').first
    sync_api.expect(label).to_contain_text(part)
    return label.inner_text()


def wait_for(page: Page, expression: str) -> None:
    """Wait until a JavaScript expression is true; one that fails, as on a new page, is not yet."""
    page.wait_for_function(f"() => {{ try {{ return {expression} }} catch {{ return false }} }}")


def test_a_card_leads_to_a_cell_that_has_its_history(watched: Watched) -> None:
    page = watched.page("/")
    wait(page, "state", "not heard yet")
    page.click('[data-cell="gantry"]')
    page.wait_for_url("**/cell/gantry")
    # Two runs of the library, though no controller has been heard.
    wait(page, "run", "2 runs")
    wait_for(page, "ilc.option?.('runs')?.series[0]?.data.length === 2")
    wait_for(page, "ilc.option('contour')?.series.length === 2")
    names = [chart.get_attribute("aria-label") for chart in page.locator("[data-chart]").all()]
    assert len(names) == 8
    assert all(names)


def test_numbers_change_while_the_cell_runs_and_it_comes_back(watched: Watched) -> None:
    page = watched.page("/cell/gantry")
    wait(page, "state", "not heard yet")
    watched.bench.drives(watched.cell)
    # It ends when the test stops it: a slow browser finds it running, too.
    controller = watched.run(1000)
    wait(page, "state", "▶ running")
    wait(page, "run", "run ")
    wait_for(page, "ilc.pushes() > 20")
    seen = page.evaluate("ilc.option('live-error').series.map(s => s.data.length)")
    assert len(seen) == 2
    assert min(seen) > 0
    position = page.locator('[data-axis="x"] [data-name="position"]')
    before = position.inner_text()
    wait_for(
        page,
        f"""document.querySelector('[data-axis="x"] [data-name="position"]').innerText
        !== {before!r}""",
    )
    wait_for(page, "ilc.option('runs').series[0]?.data.length > 1")
    controller.signal(signal.SIGKILL)
    wait(page, "state", "silent since")
    # Without the seconds, of which a screen reader would tell every one.
    spoken = page.locator('[role="status"][data-name="spoken"]')
    sync_api.expect(spoken).to_have_text("silent")
    controller.close()
    # The same page follows the next campaign to its end; the drives noticed the loss of the last.
    controller = watched.run(6, "--reset-faults")
    wait(page, "state", "completed")
    assert controller.end() == 0
    wait_for(page, "ilc.option('runs').series[0]?.data.length === 6")
    assert "%" in wait(page, "timing", "execution")
    wait(page, "contour-run", "run 5")


def test_a_slow_browser_is_sent_no_more_than_it_shows(watched: Watched) -> None:
    page = watched.page("/cell/gantry")
    watched.bench.drives(watched.cell)
    watched.run(1000)
    wait_for(page, "ilc.pushes() > 2")
    page.evaluate("""() => {
        const held = [];
        const shown = ilc.shown;
        ilc.shown = () => new Promise((done) => held.push(done));
        window.after = () => (performance.now() - since) / 1000;
        window.since = performance.now();
        window.before = ilc.pushes();
        window.release = () => { ilc.shown = shown; held.forEach((done) => done()); };
    }""")
    wait_for(page, "after() > 2")
    # One that was on its way, then one for each five seconds without an answer.
    pushes, after_s = page.evaluate("[ilc.pushes() - before, after()]")
    assert pushes <= 2 + after_s / 5, (pushes, after_s)
    page.evaluate("release()")
    wait_for(page, f"ilc.pushes() > before + {pushes + 2}")


def test_runs_of_two_campaigns_are_compared_on_one_cursor(watched: Watched) -> None:
    page = watched.page("/library")
    for key in ("0-1", "0-2"):
        page.check(f'[data-run="{key}"]')
    for chart in ("compare-error", "compare-input"):
        wait_for(page, f"ilc.option('{chart}')?.series.length === 2")
    legend = page.evaluate("ilc.option('compare-input').series.map(s => s.name)")
    assert legend[0].endswith("run 0")
    assert legend[1].endswith("run 1")
    page.fill("textarea.note", "<i>oiled</i>")
    page.press("textarea.note", "Tab")
    sync_api.expect(page.locator('tr[aria-selected="true"]').first).to_contain_text("<i>oiled</i>")
    assert list(read_notes(watched.bench.library).values()) == ["<i>oiled</i>"]
    page.fill('input[type="search"]', "oiled")
    sync_api.expect(page.locator("[data-run]")).to_have_count(1)


def test_a_phone_has_one_column_and_the_theme_of_its_system(watched: Watched) -> None:
    page = watched.page("/cell/gantry", scheme="dark", width=390)
    wait_for(page, "document.body.classList.contains('body--dark')")
    wait_for(page, "ilc.option?.('runs')?.xAxis[0].axisLabel.color === '#AEB6C2'")
    lefts = page.evaluate(
        "[...document.querySelectorAll('.panel')].map(p => p.getBoundingClientRect().left)"
    )
    assert len(set(lefts)) == 1
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    # By keyboard alone: the switch follows the ways to the pages.
    for _ in range(3):
        page.keyboard.press("Tab")
    sync_api.expect(page.locator("[data-theme-switch]")).to_be_focused()
    page.keyboard.press("Enter")
    wait_for(page, "document.body.classList.contains('body--light')")
    wait_for(page, "ilc.option('runs').xAxis[0].axisLabel.color === '#5A6068'")


def test_a_lost_connection_is_told_and_mended(watched: Watched) -> None:
    page = watched.page("/cell/gantry")
    wait(page, "run", "run")
    watched.dashboard.signal(signal.SIGTERM)
    assert watched.dashboard.end() == 128 + signal.SIGTERM, watched.dashboard.errors
    watched.dashboard.close()
    sync_api.expect(page.locator("#popup")).to_be_visible()
    watched.dashboard = watched.serve()
    sync_api.expect(page.locator("#popup")).to_be_hidden()
    wait(page, "run", "run")


def test_other_names_of_this_host_are_refused(watched: Watched) -> None:
    """A page of a stranger, whose name resolves to this computer, reaches nothing."""
    with socket.create_connection(("127.0.0.1", watched.port), timeout=60.0) as client:
        client.sendall(b"GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n")
        assert client.recv(64).startswith(b"HTTP/1.1 400 ")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--host", "203.0.113.7"], "an own address and a free port are needed"),
        (["--library", "cell.toml"], "cell.toml"),
        (["missing.toml"], "missing.toml"),
        (["--port", "0", "--router"], "connect has to name its endpoint"),
    ],
)
def test_what_cannot_be_served_is_one_line(
    arguments: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "cell.toml").write_text("[cell]\n")
    monkeypatch.chdir(tmp_path)
    assert main(["dashboard", "--no-scouting", *arguments]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert told in said[0]


def test_another_network_is_served_with_a_warning(tmp_path: Path) -> None:
    argv = [sys.executable, "-m", "ilc_rt.cli", "dashboard", "--no-scouting", "--host", "0.0.0.0",
            "--port", "0", "--timeout", "0.1"]  # fmt: skip
    process = Process(argv, tmp_path)
    try:
        assert process.end() == 0, process.errors
    finally:
        process.close()
    assert process.errors[0].startswith("anyone on that network can watch")
