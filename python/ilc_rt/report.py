"""Report of a campaign: a single self-contained HTML file.

Figures and script are embedded and nothing is fetched, so the page can be mailed, archived, printed
and read on a phone. Without its script it is complete; with it, figures are read and enlarged.
"""

from __future__ import annotations

import html
import json
import platform
from dataclasses import asdict
from datetime import datetime, timezone
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ilc_rt import plots
from ilc_rt.comparison import note
from ilc_rt.errors import BadInputError
from ilc_rt.lateness import LateCounts, late_sentence
from ilc_rt.quantity import digits, in_words, signed, unit_for
from ilc_rt.report_figures import plot_card, theme_css
from ilc_rt.report_guide import FIGURES, guide
from ilc_rt.result import CampaignResult, write_text
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from ilc_rt.record import IterationRecord

REPORT_NAME = "ilc-report.html"
REMARKS_SHOWN = 12
FACT_MAX = 4000


def write_report(
    result: CampaignResult,
    path: str | Path,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Write the report of a campaign.

    Parameters
    ----------
    result : CampaignResult
        At least one run.
    path : path
        The file, or a folder, in which ``ilc-report.html`` is written.
    progress : callable or None
        Called with the number of figures that are drawn and of all, before each.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    BadInputError
        If there is no run to report or the file cannot be written.
    """
    target = Path(path)
    if target.is_dir() or not target.suffix:
        target = target / REPORT_NAME
    if not result.records:
        message = f"{target}: not written: no run was completed"
        raise BadInputError(message)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"{target}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error
    write_text(target, render(result, progress))
    return target


def render(result: CampaignResult, progress: Callable[[int, int], object] | None = None) -> str:
    """Return the report as HTML text; `progress` as for `write_report`."""
    style, script = (
        resources.files("ilc_rt").joinpath(f"data/report.{kind}").read_text(encoding="utf-8")
        for kind in ("css", "js")
    )
    count = len(result.records)
    title = f"{printable(result.cell)}: {count} run{'s' if count > 1 else ''}"
    cards = dict(_cards(result, progress or (lambda _done, _total: None)))
    notes = " ".join(map(note, result.records))
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title>
<style>
{theme_css()}{style}</style>
</head>
<body>
<main>
<header><h1>{html.escape(title)}</h1>
<button type="button" id="theme" hidden>Colours</button></header>
<p class="lead">{html.escape(result.sentence())}</p>
{_warning(result)}{_remarks(result)}<div class="tiles">{"".join(_tiles(result))}</div>
{_contents(cards)}<div class="cards">
{"".join(cards.values())}</div>
<section class="card" id="runs"><h2>Every run</h2>
{_scrolled("Table of every run", _table(result))}</section>
{_axes(result)}{guide(cards, notes=notes)}<section class="card" id="facts"><h2>What ran where</h2>
{_facts(result)}</section>
</main>
<script>
{script}</script>
</body>
</html>
"""


def _cards(
    result: CampaignResult, progress: Callable[[int, int], object]
) -> Iterator[tuple[str, str]]:
    """Yield the figures by name."""
    pictures = (
        ("convergence", plots.convergence,
         "Largest and root-mean-square value of each run, on a logarithmic scale. "
         + ("After the run at the dashed line the best input so far was restored."
            if any(record.rolled_back for record in result.records) else "")),
        ("contour", plots.contour,
         "What is drawn beside the path is the distance from it, magnified; lag along the path "
         "does not show. The lower picture has the last run alone, magnified further."),
        ("tracking", plots.tracking,
         "Programmed less measured position, of the measurement that was learned from."),
        ("input", plots.learned_input,
         "What learning adds to the set point of each axis: after one run and at the end."),
        ("latency", plots.latency,
         "How late the loop woke and how long it computed, counted on a logarithmic scale."),
        ("late", plots.late_cycle, html.escape(_late(result))),
    )  # fmt: skip
    for number, (name, draw, caption) in enumerate(pictures):
        progress(number, len(pictures))
        figure = draw(result)
        if figure is not None:
            yield name, plot_card(figure, name, html.escape(FIGURES[name][0]), caption)


def _contents(names: Iterable[str]) -> str:
    """Return links to the parts of the page."""
    parts = {name: FIGURES[name][0] for name in names}
    parts |= {"runs": "Every run", "read": "How to read this report", "facts": "What ran where"}
    links = " ".join(f'<a href="#{name}">{html.escape(text)}</a>' for name, text in parts.items())
    return f'<nav aria-label="Contents">{links}</nav>\n'


def _late(result: CampaignResult) -> str:
    """Return the number of late cycles, and who was late in the worst one."""
    timing = result.latency
    if timing is None or timing.worst is None:
        return ""
    counts = timing.late or LateCounts()
    n_late = sum(asdict(counts).values()) - counts.missed
    return (
        f"{n_late} cycles lost their deadline, {counts.missed} were skipped. In the worst one "
        f"{late_sentence(timing.worst)}. Below it the stages of a cycle as it should be."
    )


def _tiles(result: CampaignResult) -> Iterator[str]:
    comparison = result.comparison
    first, last = result.records[0], comparison.learned[-1]

    def tile(value: str, what: str, kind: str = "") -> str:
        return f'<div class="tile {kind}"><b>{html.escape(value)}</b><span>{what}</span></div>'

    def course(before: float | None, after: float | None, base: str) -> str:
        unit = unit_for(base, before)
        if first is last:
            return unit.text(after)
        return f"{unit.number(before)} → {unit.number(after)} {unit.symbol}"

    runs = "only run" if first is last else "first → last run"
    if last.contour_inf_m is not None:
        before_m = first.contour_inf_m
        value = course(before_m, last.contour_inf_m, "m")
        yield tile(value, f"largest contour error, {runs}", "main" * comparison.by_contour)
    if change := signed(comparison.compared(first), comparison.compared(last)) * (
        first is not last
    ):
        yield tile(_minus(change), f"{'contour' if comparison.by_contour else 'tracking'} error")
    for base in dict.fromkeys(result.axis_units):
        # Of the only kind of axes, or of each kind separately.
        rms = [c for c in comparison.tracking() if c.name == "RMS tracking"]
        column = next(c for c in rms if c.unit.base == base)
        whose = {"m": "of the linear axes, ", "rad": "of the rotary axes, "}[base]
        value = course(column.of(first), column.of(last), base)
        yield tile(value, f"RMS tracking error, {whose * comparison.is_mixed}{runs}")
    yield tile(str(sum(r.overruns for r in result.records)), "overruns of the servo cycle")
    if result.latency is not None:
        yield tile(f"{result.latency.wake_late_us.max:.0f} µs", "latest wake-up of the loop")


def _table(result: CampaignResult) -> str:
    comparison = result.comparison
    columns = comparison.errors()
    what = "contour" if comparison.by_contour else "tracking"
    head = (
        "run", *(column.heading for column in columns), f"change of {what}", "overruns",
        "learning ms", "",
    )  # fmt: skip
    rows = "".join(
        _cells(
            str(record.index),
            *(column.cell(record) for column in columns),
            "" if record is comparison.first
            else _minus(signed(comparison.compared(comparison.first), comparison.compared(record))),
            str(record.overruns),
            "-" if record.update_ms is None else digits(record.update_ms),
            _notes(record, before),
        )
        for before, record in zip((None, *result.records), result.records, strict=False)
    )  # fmt: skip
    return f"<table><thead><tr>{_headings(head)}</tr></thead><tbody>{rows}</tbody></table>"


def _notes(record: IterationRecord, before: IterationRecord | None) -> str:
    # The record counts the late updates of the campaign up to this run.
    was_late = record.late_updates > (before.late_updates if before else 0)
    gaps = f"{record.missing_samples} samples missing" if record.missing_samples else ""
    return ", ".join(filter(None, (note(record), gaps, "learning late" if was_late else "")))


def _axes(result: CampaignResult) -> str:
    """Return the table per axis, if there are several axes and their figures are known."""
    first, last = result.records[0], result.comparison.learned[-1]
    figures = [(record.axes_tracking_inf_m, record.axes_tracking_rms_m) for record in (first, last)]
    if result.n_axes < 2 or any(len(row) < result.n_axes for pair in figures for row in pair):
        return ""
    rows = []
    for axis, name in enumerate(result.axis_names):
        cells = [printable(name)]
        for before, after in zip(*figures, strict=True):
            unit = unit_for(result.axis_unit(axis), before[axis])
            values = [unit.number(before[axis]), unit.number(after[axis])][first is last :]
            cells += [f"{' → '.join(values)} {unit.symbol}", in_words(before[axis], after[axis])]
        rows.append(_cells(*cells))
    head = ("axis", "max tracking", "", "RMS tracking", "")
    runs = "in its only run" if first is last else "from the first run to the last"
    table = (
        f"<table><thead><tr>{_headings(head)}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )
    return (
        f'<section class="card"><h2>Every axis, {runs}</h2>\n'
        f"{_scrolled('Table of every axis', table)}</section>\n"
    )


def _scrolled(name: str, table: str) -> str:
    """Return a table that a keyboard, too, can move where it is wider than the screen."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{name}">{table}</div>'


def _headings(names: Iterable[str]) -> str:
    return "".join(f'<th scope="col">{name}</th>' for name in names)


def _cells(*values: str) -> str:
    return "<tr>" + "".join(f"<td>{html.escape(value)}</td>" for value in values) + "</tr>"


def _minus(text: str) -> str:
    return text.replace("-", "\N{MINUS SIGN}")


def _facts(result: CampaignResult) -> str:
    facts: list[tuple[str, str]] = [
        ("Cell", f"{result.cell}: {'axes' if result.n_axes > 1 else 'axis'} "
                 f"{', '.join(map(printable, result.axis_names))}"),
        ("Campaign", f"{result.campaign}, in {result.library}"),
        ("Law", "none: frozen input" if result.law == "frozen" else result.law),
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
            ("Processor", "any" if report.cpu is None else str(report.cpu)),
            ("Kernel", report.kernel),
            ("Notes", "; ".join(report.notes)),
        ]
    if result.start is not None:
        facts.append(("Host", f"{platform.node()}, {platform.system()} {platform.machine()}"))
    facts.append(("Written", datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")))
    rows = "".join(
        f'<tr><th scope="row">{name}</th><td>{html.escape(printable(value, FACT_MAX))}</td></tr>'
        for name, value in facts
        if value
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


def _remarks(result: CampaignResult) -> str:
    """Return what prevented learning from continuing, if anything."""
    if not any(map(note, result.records)):
        return ""
    lines = [printable(line) for line in result.comparison.remarks()]
    if len(lines) > REMARKS_SHOWN:
        lines = [*lines[:REMARKS_SHOWN], "…"]
    return f'<p class="warn">{"<br>".join(map(html.escape, lines))}</p>\n'


def _warning(result: CampaignResult) -> str:
    if result.status in {"completed", "running"}:
        return ""
    what = {"fault": "Stopped after a fault", "interrupted": "Stopped on request"}.get(
        result.status, result.status
    )
    why = f": {result.reason}" if result.reason else ""
    return f'<p class="warn">{html.escape(printable(what + why))}</p>\n'
