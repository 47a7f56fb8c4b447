"""A campaign as one HTML file that needs nothing else.

The pictures are inside the page; nothing is fetched, so it can be mailed,
archived, printed and read on a phone.
"""

from __future__ import annotations

import html
import io
import json
import platform
import re
from datetime import datetime, timezone
from importlib import resources
from typing import TYPE_CHECKING, Any

import matplotlib as mpl

from ilc_rt import plots
from ilc_rt.errors import BadInputError
from ilc_rt.result import CampaignResult, micrometres, reduction, report_file, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

    from ilc_rt.record import IterationRecord

def write_report(result: CampaignResult, path: str | Path) -> Path:
    """Write the report of a campaign.

    Parameters
    ----------
    result : CampaignResult
        At least one run.
    path : path
        The file, or a folder that gets ``ilc-report.html``.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    BadInputError
        If there is no run to report, or the file cannot be written.
    """
    target = report_file(path)
    if not result.records:
        message = f"{target}: not written: no run was completed"
        raise BadInputError(message)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"{target}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error
    write_text(target, render(result))
    return target


def render(result: CampaignResult) -> str:
    """Return the report as HTML text."""
    style = resources.files("ilc_rt").joinpath("data/report.css").read_text(encoding="utf-8")
    count = len(result.records)
    title = f"{result.cell}: {count} run{'s' if count > 1 else ''}"
    cards = "".join(_cards(result))
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title>
<style>
{style}</style>
</head>
<body>
<main>
<h1>{html.escape(title)}</h1>
<p class="lead">{html.escape(result.sentence())}</p>
{_warning(result)}<div class="tiles">{"".join(_tiles(result))}</div>
<div class="cards">
{cards}</div>
<section class="card"><h2>Every run</h2>
<div class="scroll">{_table(result)}</div></section>
<section class="card"><h2>What ran where</h2>
{_facts(result)}</section>
</main>
</body>
</html>
"""


def svg(figure: Figure, name: str) -> str:
    """Return a figure as inline SVG, without links and with ids of its own.

    Parameters
    ----------
    figure : Figure
        What to draw.
    name : str
        Prefix of the ids, different for every picture of a page.
    """
    buffer = io.StringIO()
    with mpl.rc_context({**plots.STYLE, "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"\sxmlns(:xlink)?=\"[^\"]*\"", "", text)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r'<svg (height|width)="[^"]*"', "<svg", text, count=1)
    text = re.sub(r'(<svg[^>]*?) (?:width|height)="[^"]*"', r"\1", text, count=2)
    text = text.replace("xlink:href", "href")
    return re.sub(r"\n\s*", "\n", text).strip()


def _cards(result: CampaignResult) -> Iterator[str]:
    pictures = (
        ("convergence", "Error against run", plots.convergence(result),
         "Largest and root-mean-square value of each run, on a logarithmic scale. "
         + ("After the run at the dashed line the best input so far was restored."
            if any(record.rolled_back for record in result.records) else "")),
        ("contour", "The contour", plots.contour(result),
         "What is drawn beside the path is the distance from it, magnified; lag along the path "
         "does not show. The lower picture has the last run alone, magnified further."),
        ("tracking", "Tracking error over time", plots.tracking(result),
         "Programmed less measured position, of the measurement that was learned from."),
        ("input", "Learned input", plots.learned_input(result),
         "What learning adds to the set point of each axis: after one run and at the end."),
        ("latency", "Servo loop", plots.latency(result),
         "How late the loop woke and how long it computed, counted on a logarithmic scale."),
    )  # fmt: skip
    for name, heading, figure, caption in pictures:
        if figure is not None:
            yield (
                f'<figure class="card" id="{name}"><h2>{heading}</h2>\n'
                f"<figcaption>{caption}</figcaption>\n{svg(figure, name)}</figure>\n"
            )


def _tiles(result: CampaignResult) -> Iterator[str]:
    first, last = result.records[0], result.records[-1]

    def tile(value: str, label: str, kind: str = "") -> str:
        return f'<div class="tile {kind}"><b>{html.escape(value)}</b><span>{label}</span></div>'

    if first.contour_inf_m and last.contour_inf_m:
        yield tile(
            f"{micrometres(first.contour_inf_m)} → {micrometres(last.contour_inf_m)} µm",
            "largest contour error, first → last run", "main",
        )  # fmt: skip
        yield tile(_percent(first.contour_inf_m, last.contour_inf_m), "contour error")
    yield tile(
        f"{micrometres(first.tracking_rms_m)} → {micrometres(last.tracking_rms_m)} µm",
        "RMS tracking error, first → last run",
    )
    yield tile(str(sum(r.overruns for r in result.records)), "overruns of the servo cycle")
    if result.latency is not None:
        yield tile(f"{result.latency.wake_late_us.max:.0f} µs", "latest wake-up of the loop")


def _table(result: CampaignResult) -> str:
    head = (
        "run", "max tracking µm", "RMS tracking µm", "max contour µm", "RMS contour µm",
        "contour reduced by", "overruns", "learning ms", "",
    )  # fmt: skip
    first = result.records[0]
    rows = "".join(_row(record, first) for record in result.records)
    cells = "".join(f"<th>{name}</th>" for name in head)
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{rows}</tbody></table>"


def _row(record: IterationRecord, first: IterationRecord) -> str:
    less = ""
    if record is not first and None not in {record.contour_inf_m, first.contour_inf_m}:
        change = reduction(first.contour_inf_m or 0.0, record.contour_inf_m or 0.0)
        less = f"{change:.1f} %".replace("-", "\N{MINUS SIGN}")
    notes = [note for flag, note in ((record.rolled_back, "rolled back"),
                                     (record.late_updates, "learning late")) if flag]  # fmt: skip
    values = (
        str(record.index),
        *map(micrometres, (record.tracking_inf_m, record.tracking_rms_m,
                           record.contour_inf_m, record.contour_rms_m)),
        less,
        str(record.overruns),
        "-" if record.update_ms is None else f"{record.update_ms:.2f}",
        ", ".join(notes),
    )  # fmt: skip
    return "<tr>" + "".join(f"<td>{html.escape(value)}</td>" for value in values) + "</tr>"


def _facts(result: CampaignResult) -> str:
    facts: list[tuple[str, str]] = [
        ("Cell", f"{result.cell}: axes {', '.join(result.axis_names)}"),
        ("Campaign", f"{result.campaign}, in {result.library}"),
        ("Law", result.law),
        ("Its parameters", _parameters(result)),
        ("Learned from", {"tcp": "tool centre point", "encoder": "encoders of the drives"}.get(
            result.measure, result.measure)),
        ("Run", f"{result.n_samples} samples of {result.cycle_s * 1e3:g} ms "
                f"= {result.n_samples * result.cycle_s:.2f} s"),
        ("Bus", result.bus),
        ("Clock", {"realtime": "real time", "lockstep": "lock-step: no wall clock, repeatable "
                   "bit for bit"}.get(result.mode, result.mode)),
    ]  # fmt: skip
    report = result.start.rt if result.start else None
    if report is not None:
        locked = "memory locked" if report.mlock else "memory not locked"
        facts += [
            ("Scheduling", f"{report.policy} priority {report.priority}, {locked}"),
            ("Kernel", report.kernel),
            ("Notes", "; ".join(report.notes)),
        ]
    if result.start is not None:
        facts.append(("Host", f"{platform.node()}, {platform.system()} {platform.machine()}"))
    facts.append(("Written", datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")))
    rows = "".join(
        f"<tr><th>{name}</th><td>{html.escape(value)}</td></tr>" for name, value in facts if value
    )
    return f'<table class="facts"><tbody>{rows}</tbody></table>'


def _parameters(result: CampaignResult) -> str:
    text = result.records[-1].law_parameters
    try:
        values: Any = json.loads(text)
    except ValueError:
        return text
    if not isinstance(values, dict):
        return text
    return ", ".join(f"{key} = {json.dumps(value).strip(chr(34))}" for key, value in values.items())


def _warning(result: CampaignResult) -> str:
    if result.status in {"completed", "running"}:
        return ""
    what = {"fault": "Stopped after a fault", "interrupted": "Stopped on request"}.get(
        result.status, result.status
    )
    why = f": {result.reason}" if result.reason else ""
    return f'<p class="warn">{html.escape(what + why)}</p>\n'


def _percent(before: float, after: float) -> str:
    change = reduction(before, after)
    return f"\N{MINUS SIGN}{change:.1f} %" if change >= 0 else f"+{-change:.1f} %"
