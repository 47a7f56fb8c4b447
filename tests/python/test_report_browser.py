"""The report in a browser: both themes, a phone, reading and enlarging by keyboard and pointer."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import tempfile
from typing import TYPE_CHECKING, Any

import pytest

from ilc_rt.pictures.themes import THEMES
from ilc_rt.report import render
from ilc_rt.report_guide import FIGURES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ilc_rt import CampaignResult

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

pytestmark = [
    pytest.mark.xdist_group("report"),
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed"),
]

# Run in the page after its own script; the result becomes an attribute of the document.
TRIAL = """
<script>
const found = {};
const at = (element, name, more) => element.dispatchEvent(new %s(name, {bubbles: true, ...more}));
%s
document.documentElement.setAttribute("data-found", JSON.stringify(found));
</script>
</body>"""


@pytest.fixture(scope="module")
def browse(
    finished: CampaignResult, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., dict[str, Any]]:
    """Return a function that runs a script in the report, and returns what it found."""
    folder = tmp_path_factory.mktemp("browser")
    page = render(finished)

    def run(script: str, *options: str, kind: str = "KeyboardEvent") -> dict[str, Any]:
        file = folder / "report.html"
        # What one page keeps is not seen by the next.
        profile = tempfile.mkdtemp(dir=folder)
        file.write_text(page.replace("</body>", TRIAL % (kind, script)), encoding="utf-8")
        done = subprocess.run(
            [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom",
             "--hide-scrollbars", f"--user-data-dir={profile}", *options,
             file.as_uri()],
            capture_output=True, text=True, timeout=250, check=True,
        )  # fmt: skip
        answer = re.search(r'data-found="([^"]*)"', done.stdout)
        assert answer is not None, done.stderr[-2000:]
        return dict(json.loads(html.unescape(answer[1])))

    return run


KEYS = """
const figure = document.getElementById("convergence");
const svg = figure.querySelector("svg"), output = figure.querySelector("output");
const press = (key) => at(svg, "keydown", {key});
press("ArrowRight"); found.first = output.textContent;
press("ArrowRight"); found.second = output.textContent;
found.marked = !figure.querySelector(".mark").hidden;
press("ArrowDown"); found.other = output.textContent;
const whole = svg.getAttribute("viewBox");
press("+"); found.zoomed = Number(svg.getAttribute("viewBox").split(" ")[2]) / Number(whole.split(" ")[2]);
press("0"); found.again = svg.getAttribute("viewBox").split(" ").map(Number).join() === whole.split(" ").map(Number).join();
figure.querySelector("[data-act=in]").click();
found.button = figure.querySelector(".stage").classList.contains("zoomed");
press("Escape"); found.left = output.textContent;
"""  # noqa: E501


def test_a_keyboard_reads_the_values_of_every_line(
    finished: CampaignResult, browse: Callable[..., dict[str, Any]]
) -> None:
    """Along a line, to the next one, enlarged and back; the values are those of the runs."""
    found = browse(KEYS)
    for index, said in enumerate((found["first"], found["second"])):
        told = re.fullmatch(r"tracking, max: run (\d+), error ([\d.]+) µm", said)
        assert told, said
        assert int(told[1]) == index
        error_um = finished.records[index].tracking_inf_m * 1e6
        assert float(told[2]) == pytest.approx(error_um, rel=6e-3)
    assert found["other"].startswith("tracking, RMS: run 1, error ")
    assert found["marked"]
    assert found["zoomed"] == pytest.approx(1 / 1.5)
    assert found["again"]
    assert found["button"]
    assert found["left"] == ""


POINT = """
const figure = document.getElementById("tracking");
figure.scrollIntoView();
const svg = figure.querySelector("svg"), output = figure.querySelector("output");
const box = svg.getBoundingClientRect();
const plot = JSON.parse(figure.dataset.plot);
const [, , width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
const client = (x, y) => ({clientX: box.left + x / width * box.width, clientY: box.top + y / height * box.height});
const path = document.getElementById(plot.series[0].id).querySelector("path");
const numbers = path.getAttribute("d").match(/-?[\\d.]+/g).map(Number);
const [x, y] = numbers.slice(2 * Math.floor(numbers.length / 4));
at(svg, "pointermove", client(x, y)); found.on = output.textContent;
at(svg, "pointermove", client(1, 1)); found.off = output.textContent;
at(svg, "wheel", {...client(x, y), deltaY: -100, cancelable: true}); found.scrolls = svg.getAttribute("viewBox");
at(svg, "wheel", {...client(x, y), deltaY: -100, ctrlKey: true, cancelable: true});
found.zooms = svg.getAttribute("viewBox");
found.whole = `0 0 ${width} ${height}`;
"""  # noqa: E501


def test_a_pointer_reads_the_nearest_line(browse: Callable[..., dict[str, Any]]) -> None:
    """A value with its unit on a line, nothing outside; the wheel alone scrolls the page."""
    found = browse(POINT, kind="WheelEvent")
    assert re.fullmatch(r"run 0: time [\d.]+ s, error -?[\d.]+ µm", found["on"]), found["on"]
    assert found["off"] == ""
    assert [float(number) for number in found["scrolls"].split()] == [
        float(number) for number in found["whole"].split()
    ]
    assert found["zooms"] != found["scrolls"]


COLOURS = """
const css = (element, name) => getComputedStyle(element)[name];
const line = document.querySelector('#convergence [id="convergence-line-0-0"] path');
const look = () => [css(document.querySelector(".card"), "backgroundColor"), css(line, "stroke")];
found.system = look();
const button = document.getElementById("theme");
button.click(); found.light = look();
button.click(); found.dark = look();
"""


@pytest.mark.parametrize("system", ["light", "dark"])
def test_the_colours_follow_the_system_and_the_switch(
    browse: Callable[..., dict[str, Any]], system: str
) -> None:
    """Page and figures together."""

    def rgb(colour: str) -> str:
        return f"rgb({', '.join(str(int(colour[k : k + 2], 16)) for k in (1, 3, 5))})"

    expected = {name: [rgb(one.ground), rgb(one.last)] for name, one in THEMES.items()}
    found = browse(COLOURS, f"--blink-settings=preferredColorScheme={int(system == 'light')}")
    assert found["system"] == expected[system]
    assert {name: found[name] for name in THEMES} == expected


PHONE = """
const frame = document.documentElement;
found.width = frame.clientWidth;
found.wide = [...document.querySelectorAll("main *")].filter((one) => !one.closest(".scroll, svg, .stage")
  && one.getBoundingClientRect().right > frame.clientWidth + 1).map((one) => one.outerHTML.slice(0, 80));
found.scrolls = frame.scrollWidth > frame.clientWidth;
found.labelled = [...document.querySelectorAll("figure svg")].map((one) =>
  one.getAttribute("aria-labelledby").split(" ").every((id) => document.getElementById(id).textContent.length > 5)
  && one.getAttribute("role") === "img" && one.tabIndex === 0);
found.buttons = [...document.querySelectorAll("button")].every((one) =>
  !one.hidden && (one.getAttribute("aria-label") || one.textContent).length > 5);
found.read = [...document.querySelectorAll("#read h3[id]")].map((one) => one.textContent);
"""  # noqa: E501


def test_a_phone_and_a_screen_reader_get_everything(
    browse: Callable[..., dict[str, Any]],
) -> None:
    """Nothing is wider than the screen but tables in their frame; every figure has a name."""
    found = browse(PHONE, "--window-size=500,900")
    assert found["width"] <= 500
    assert found["wide"] == []
    assert not found["scrolls"]
    assert found["labelled"] == [True] * 4
    assert found["buttons"]
    shown = ("convergence", "contour", "tracking", "input")
    assert found["read"] == [FIGURES[name][0] for name in shown]


def test_a_picture_can_be_taken(finished: CampaignResult, tmp_path: Path) -> None:
    """The page draws: a screenshot is more than an empty ground."""
    (tmp_path / "report.html").write_text(render(finished), encoding="utf-8")
    picture = tmp_path / "page.png"
    subprocess.run(
        [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--window-size=1280,2400",
         f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}",
         (tmp_path / "report.html").as_uri()],
        capture_output=True, timeout=250, check=True,
    )  # fmt: skip
    assert picture.stat().st_size > 100_000
