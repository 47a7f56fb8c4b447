"""Outcome of reproducing a paper, and the JSON file that keeps it.

The file is `{"haas2016": {...}, ...}`: under a paper's name its figures, with "claims" and
"seconds" added. The command, the workers and the gallery import it.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from ilc_papers.papers import NAMES, load
from ilc_rt.errors import BadInputError
from ilc_rt.result import write_text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from ilc_papers.paper import Claim, Figures, Paper, Tell

#: Keys of a paper's entry in the file that are not its figures.
ADDED = ("claims", "seconds", "reduced")


@dataclass(frozen=True)
class Outcome:
    """The figures of one paper, just computed or read from a file.

    `figures` are the results of the systems as stored in JSON, `seconds` the computing time;
    `reduced` is true for reduced sizes.
    """

    paper: Paper
    figures: Figures
    seconds: float
    reduced: bool = False

    @property
    def claims(self) -> list[Claim]:
        """The paper's printed figures beside these."""
        return self.paper.claims(self.figures)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the file: figures, claims, seconds."""
        entry = dict(self.figures)
        entry["claims"] = [asdict(claim) | {"ratio": claim.ratio} for claim in self.claims]
        entry["seconds"] = round(self.seconds, 1)
        if self.reduced:
            entry["reduced"] = True
        return entry


def compute(paper: Paper, *, reduced: bool, tell: Tell) -> Outcome:
    """Run a paper's systems."""
    begun_s = time.monotonic()
    figures = paper.compute(reduced, tell)
    return Outcome(paper, figures, time.monotonic() - begun_s, reduced)


def write_json(outcomes: Sequence[Outcome], path: Path) -> None:
    """Write the figures of one or more papers to a file."""
    entries = {outcome.paper.name: outcome.to_json() for outcome in outcomes}
    write_text(path, _readable(entries) + "\n")


def read_json(
    path: Path, names: Sequence[str], load_paper: Callable[[str], Paper] = load
) -> list[Outcome]:
    """Read the figures of papers from a file, and compute nothing.

    A file that is not one of `write_json`, or lacks one of the papers, is refused.
    """
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        message = f"{path}: cannot be read: {error.strerror}"
        raise BadInputError(message) from error
    except ValueError as error:
        message = f"{path}: no JSON: {error}"
        raise BadInputError(message) from error
    if not isinstance(entries, dict):
        message = f"{path}: holds no papers; `ilc reproduce all --json {path}` writes them"
        raise BadInputError(message)
    missing = [name for name in names if not isinstance(entries.get(name), dict)]
    if missing:
        there = ", ".join(name for name in entries if name in NAMES) or "none"
        message = f"{path}: no figures of {', '.join(missing)}; there is {there}"
        raise BadInputError(message)
    return [_read(path, load_paper(name), dict(entries[name])) for name in names]


def _read(path: Path, paper: Paper, entry: dict[str, Any]) -> Outcome:
    figures = {key: value for key, value in entry.items() if key not in ADDED}
    outcome = Outcome(
        paper, figures, float(entry.get("seconds", 0.0)), reduced=bool(entry.get("reduced"))
    )
    try:
        paper.claims(figures)
    except (KeyError, TypeError, IndexError) as error:
        message = f"{path}: {paper.name}: figures of another version: {error!r}"
        raise BadInputError(message) from error
    return outcome


def _readable(value: object, indent: str = "") -> str:
    """Return JSON with a line for each key, lists of numbers in one line."""
    if isinstance(value, dict) and value:
        inner = indent + "  "
        items = ",\n".join(
            f"{inner}{json.dumps(str(key), ensure_ascii=False)}: {_readable(item, inner)}"
            for key, item in value.items()
        )
        return f"{{\n{items}\n{indent}}}"
    if isinstance(value, list) and value and isinstance(value[0], dict):
        inner = indent + "  "
        items = ",\n".join(inner + _readable(item, inner) for item in value)
        return f"[\n{items}\n{indent}]"
    return json.dumps(value, allow_nan=False, ensure_ascii=False)
