"""A start from what another cell has learned: its best campaign becomes one of this cell.

The campaign is written to the library of this cell, where `ilc run --resume` continues it, a law
that recalls runs recalls it, and `--frozen` finds its best input. Whatever a stored run tells must
agree with a run that this cell makes on simulated drives; the first difference is named.
"""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt import library_file
from ilc_rt.campaign import Campaign, load_cell
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.fleet.database import connect, told
from ilc_rt.fleet.sync import is_intact, prepare, store, stored_rows
from ilc_rt.read_only import ReadOnlyLibrary

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import psycopg

#: Between the name of a fetched campaign and that of the cell which has it now.
MARK = "@"
#: The name of a cell in its description.
NAME = re.compile(r"""(^\s*\[cell\][^\[]*?^\s*name\s*=\s*)(?:"[^"\n]*"|'[^'\n]*')""", re.MULTILINE)
#: Largest number of disturbances that a law weighs runs by.
DISTURBANCES_MAX = 7
#: Longest value in a refusal.
VALUE_MAX = 60
# In this order, so that the nearest campaign is refused with the difference that says most.
COMPARED = (
    "n_axes", "axis_names", "input_units", "cycle_s", "measure", "program", "n_samples",
    "reference_m", "law", "law_parameters",
)  # fmt: skip

CANDIDATES = """
SELECT cell, campaign, array_agg(id ORDER BY iteration) AS ids, bool_and(fingerprint IS NOT NULL),
    min((figures ->> 'tracking_rms_m')::double precision)
        FILTER (WHERE figures ->> 'phase' IS NULL) AS best
FROM run WHERE position(%(mark)s IN campaign) = 0 AND law NOT IN ('frozen', 'excitation')
    AND (%(from_cell)s::text IS NULL OR cell = %(from_cell)s)
GROUP BY cell, campaign ORDER BY best, cell, campaign
"""


@dataclass(frozen=True, slots=True)
class Fetched:
    """A campaign that this cell has now: its name there and here, and its runs."""

    from_cell: str
    from_campaign: str
    campaign: str
    runs: int
    stored: int
    best_tracking_rms_m: float


def fetch(
    address: str,
    cell: str | Path,
    library: str,
    *,
    from_cell: str | None = None,
    other_drives: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Fetched:
    """Write the best fitting campaign of a fleet to the library of a cell.

    Parameters
    ----------
    address : str
        The database.
    cell : str or pathlib.Path
        Description of the cell (TOML).
    library : str
        Its library; created if missing.
    from_cell : str or None
        Only campaigns of the cell of this name.
    other_drives : bool
        Accept a campaign whose cell has other limits, models or position loops.
    progress : callable or None
        Called with the number of campaigns that were compared and of all, before each.

    Raises
    ------
    BadInputError
        If no campaign fits, with the first difference of the best one; if the cell has an own
        campaign of this name; if database, cell or library cannot be used.
    """
    path = Path(cell)
    name = load_cell(path).name
    here = rehearsed(path, name)
    refusal = ""
    with told(address), contextlib.closing(connect(address, read_only=True)) as connection:
        values = {"mark": MARK, "from_cell": from_cell}
        candidates = connection.execute(CANDIDATES.encode(), values).fetchall()
        for number, (owner, campaign, ids, is_complete, best) in enumerate(candidates):
            if progress is not None:
                progress(number, len(candidates))
            if owner == name or best is None:
                continue
            place = f"campaign {campaign} of {owner}"
            if not is_complete:
                refusal = refusal or f"{place}: not all of its arrays are there: sync its cell"
                continue
            (first,) = stored_rows(connection, ids[:1])
            different = difference(here, first)
            if different is None and not other_drives:
                different = _other_drives(path, owner, first)
            if different is None:
                return _write(connection, library, here, (owner, campaign, ids, float(best)))
            refusal = refusal or f"{place}: {different}"
    whose = f"of {from_cell}" if from_cell else "of another cell"
    message = f"{path}: no campaign {whose} fits" + (f"; {refusal}" if refusal else "")
    raise BadInputError(message)


def rehearsed(cell: Path, name: str) -> dict[str, Any]:
    """Return the row of a first run of a cell on simulated drives, as its library would have it."""
    with tempfile.TemporaryDirectory(prefix="ilc-fetch-") as folder:
        library = str(Path(folder) / "rehearsal.db")
        text = cell.read_text(encoding="utf-8-sig")
        # The cell table has the only name at the beginning of the description.
        renamed, n_found = NAME.subn(lambda found: f"{found[1]}{json.dumps(name)}", text, count=1)
        if not n_found:
            message = f"{cell}: [cell] name: not found as a line of its own"
            raise BadInputError(message)
        # Beside the description, so that files it names are found.
        draft = cell.with_name(f".{cell.stem}-{Path(folder).name}.toml")
        try:
            draft.write_text(renamed, encoding="utf-8")
            _run_once(draft, library)
        except OSError as error:
            message = f"{draft}: cannot be written: {error.strerror}"
            raise BadInputError(message) from error
        finally:
            draft.unlink(missing_ok=True)
        (row,) = library_file.rows(ReadOnlyLibrary(library), [1])
    return row


def _run_once(cell: Path, library: str) -> None:
    """Make a run on simulated drives, with as many disturbances as the law weighs runs by.

    Their values do not matter: what is compared is that of a first run, which they do not change.
    """
    for count in range(DISTURBANCES_MAX + 1):
        measured = np.zeros((1, count)) if count else None
        campaign = Campaign(
            cell, library=library, bus="loopback:", allow_divergent=True, disturbance=measured
        )
        try:
            for _ in campaign.run(1):
                pass
        except CampaignError as error:
            # Refused before anything has moved: another number, or a sensor of another computer.
            if "the disturbance of " not in error.reason or count == DISTURBANCES_MAX:
                raise
        else:
            return


def difference(here: Mapping[str, Any], there: Mapping[str, Any]) -> str | None:
    """Return field, value there and value here of the first difference of two rows.

    Examples
    --------
    >>> row = dict.fromkeys(COMPARED)
    >>> difference(row | {"cycle_s": 0.002}, row | {"cycle_s": 0.004})
    'cycle_s is 0.004 there and 0.002 here'
    """
    for field in COMPARED:
        ours, theirs = here[field], there[field]
        if field == "reference_m":
            # One of other limits has other set points.
            if ours != theirs:
                return f"reference_m: {_furthest(ours, theirs)}"
            continue
        found = _first(field, _parsed(ours), _parsed(theirs))
        if found is not None:
            key, theirs, ours = found
            return f"{key} is {_text(theirs)} there and {_text(ours)} here"
    return None


def _other_drives(path: Path, owner: str, there: Mapping[str, Any]) -> str | None:
    """Return a difference of limits, models or position loops, which a run tells by a digest."""
    ours, theirs = rehearsed(path, owner)["fingerprint"], there["fingerprint"]
    if ours == theirs:
        return None
    return (
        f"fingerprint is {theirs[:12]} there and {ours[:12]} here: limits, models, interfaces, "
        "position loops or bounds of the axes differ, or weights of the law; --other-drives "
        "takes it nevertheless"
    )


def _write(
    connection: psycopg.Connection[Any],
    library: str,
    here: Mapping[str, Any],
    found: tuple[str, str, list[int], float],
) -> Fetched:
    owner, campaign, ids, best = found
    name = f"{campaign}{MARK}{here['cell']}"
    rows = stored_rows(connection, ids)
    for row in rows:
        if not is_intact(row):
            message = f"campaign {campaign} of {owner}: run {row['iteration']} is damaged"
            raise BadInputError(message)
        row |= {"cell": here["cell"], "campaign": name, "fingerprint": here["fingerprint"]}
    prepare(library)
    n_stored = store(library, rows)
    return Fetched(owner, campaign, name, len(rows), n_stored, best)


def _parsed(value: Any) -> Any:  # noqa: ANN401 (any column)
    """Return a text of JSON as what it says."""
    try:
        return json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _first(key: str, ours: Any, theirs: Any) -> tuple[str, Any, Any] | None:  # noqa: ANN401
    """Return key and both values of the first place where two values of JSON differ."""
    if isinstance(ours, dict) and isinstance(theirs, dict):
        for name in sorted({*ours, *theirs}):
            found = _first(f"{key}.{name}", ours.get(name), theirs.get(name))
            if found is not None:
                return found
        return None
    if isinstance(ours, list) and isinstance(theirs, list) and len(ours) == len(theirs):
        for number, (one, other) in enumerate(zip(ours, theirs, strict=True)):
            found = _first(f"{key}[{number}]", one, other)
            if found is not None:
                return found
        return None
    return None if ours == theirs else (key, theirs, ours)


def _furthest(ours: bytes, theirs: bytes) -> str:
    one, other = np.frombuffer(ours, "<f8"), np.frombuffer(theirs, "<f8")
    if one.size != other.size:
        return f"{other.size} numbers there and {one.size} here"
    place = int(np.argmax(np.abs(one - other)))
    return f"number {place} is {other[place]:.9g} there and {one[place]:.9g} here"


def _text(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= VALUE_MAX else text[: VALUE_MAX - 1] + "…"
