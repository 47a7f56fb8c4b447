"""Legend of a report: what each figure shows, and how a good one looks.

Imported by the report alone; only what a page has is explained on it.
"""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

# By the name of the figure: heading, what it shows, what is good, what to do about a bad one.
FIGURES = {
    "convergence": (
        "Error against run",
        "One point for each run. Filled marks are the largest error of the run, open ones its "
        "root-mean-square value. The scale is logarithmic: equal steps are equal factors.",
        "A straight fall within the first runs, then a level line: what is left does not repeat "
        "from run to run, and no learning removes it.",
        "A line that falls and then climbs for many runs is slow divergence: lower the bandwidth "
        "of the learning filter. A line that is level from the start says that nothing is learned.",
    ),
    "contour": (
        "The contour",
        "The programmed path in grey, and beside it the path that was driven, with its distance "
        "magnified as the title says. Lag along the path is not a contour error.",
        "The last run lies on the grey path; in the lower picture, magnified further, it is ragged "
        "without a pattern.",
        "A bulge at the same corner in every run that does not shrink points to a limit: of "
        "acceleration, of the learned input, or of the learning filter.",
    ),
    "tracking": (
        "Tracking error over time",
        "Programmed less measured position of each axis during a run, in the measurement that was "
        "learned from: first run against last, then the last one alone.",
        "The last run looks like noise around zero, of the same size everywhere.",
        "A remainder with the shape of the first run is still to be learned. An oscillation that "
        "is new in the last run is learned by mistake: lower the bandwidth.",
    ),
    "input": (
        "Learned input",
        "What learning adds to the set point of each axis, after one run and at the end.",
        "Smooth, small beside the motion itself, and largest where the motion accelerates.",
        "High-frequency ripple that grows from run to run is noise being learned. Flat tops are "
        "the limit of the input.",
    ),
    "latency": (
        "Servo loop",
        "The number of cycles for each lateness of the wake-up, and for each duration of the "
        "computation; both scales are logarithmic.",
        "One narrow hill on the left, and the latest cycle far below the cycle time.",
        "A second hill or single cycles far to the right: other work on the computer, or a kernel "
        "that is not made for real time.",
    ),
    "late": (
        "Who was late",
        "The stages of the worst cycle above those of a usual one, and the time that was allowed.",
        "A report without this figure: no cycle was late.",
        "The stage that is longer than in the cycle below it names the cause.",
    ),
}  # fmt: skip

COLUMNS = (
    ("change", "Error of the run compared with the first one; negative is better."),
    ("overruns", "Servo cycles that began at least a whole cycle late; 0 is good."),
    ("learning ms", "Computing time of the next input; it is done while the axes return."),
)
OUTCOMES = (
    ("rolled back", "The error had grown, and the best input so far was restored."),
    ("learning off", "The error had grown, and nothing was learned from the run."),
)

CONTROLS = (
    "Point at a figure to read the values of the nearest line. Drag to move a figure that is "
    "enlarged; the buttons, a double click, or the wheel with Ctrl enlarge it. With the keyboard: "
    "Tab to a figure, left and right along a line (Shift for ten points), up and down to the next "
    "line, + and - to zoom, 0 for all."
)


def guide(names: Iterable[str], *, notes: str) -> str:
    """Return the section as HTML, for the figures of a page.

    `notes` are all notes of the table of runs: only words that appear there are explained.
    """
    entries = "".join(_entry(name, *FIGURES[name]) for name in names)
    explained = (*COLUMNS, *(row for row in OUTCOMES if row[0] in notes))
    words = "".join(
        f"<dt>{html.escape(word)}</dt><dd>{html.escape(text)}</dd>" for word, text in explained
    )
    return (
        '<section class="card" id="read" aria-labelledby="read-title">'
        '<h2 id="read-title">How to read this report</h2>\n'
        f"<p>{html.escape(CONTROLS)}</p>\n{entries}"
        f'<h3>Every run</h3><dl class="words">{words}</dl></section>\n'
    )


def _entry(name: str, heading: str, shows: str, good: str, bad: str) -> str:
    rows = (("Shows", shows), ("Good", good), ("Otherwise", bad))
    listed = "".join(f"<dt>{what}</dt><dd>{html.escape(text)}</dd>" for what, text in rows)
    return (
        f'<h3 id="read-{name}"><a href="#{name}">{html.escape(heading)}</a></h3>\n'
        f'<dl class="words">{listed}</dl>\n'
    )
