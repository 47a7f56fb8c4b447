"""Choice of runs by their entries, and by rules of retention; `ilc_rt.library` imports it."""

from __future__ import annotations

import json
import math
from datetime import datetime, timedelta, timezone
from typing import TYPE_CHECKING, Any

from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

#: Entries of a run that are not in a list: they are long, and the same for many runs.
DESCRIPTIONS = ("program", "law_parameters")
#: Runs that are read with their arrays at once.
READ_AT_ONCE = 100


def kept_by(
    runs: Sequence[Mapping[str, Any]],
    *,
    newest: int | None = None,
    days: float | None = None,
    best: int | None = None,
    now: datetime | None = None,
) -> set[int]:
    """Return the keys of the runs that at least one rule keeps, of runs in the order of their keys.

    Raises
    ------
    BadInputError
        If there is no rule, or one is negative or not finite.

    Examples
    --------
    >>> run = {"campaign": "a", "phase": None, "rolled_back": False}
    >>> runs = [run | {"id": id, "tracking_rms_m": float(id)} for id in (3, 1, 2, 9)]
    >>> sorted(kept_by(runs, best=2))
    [1, 2, 9]
    """
    rules = {"newest": newest, "days": days, "best": best}
    given = {key: value for key, value in rules.items() if value is not None}
    if not given:
        message = f"no rule: at least one of {', '.join(rules)}"
        raise BadInputError(message)
    for key, value in given.items():
        if not math.isfinite(value) or value < 0:
            message = f"{key} = {value}: a number of 0 or more"
            raise BadInputError(message)
    campaigns: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        campaigns.setdefault(str(run["campaign"]), []).append(run)
    # The number of the next run of a campaign follows from the newest.
    kept = {int(of[-1]["id"]) for of in campaigns.values()}
    if newest:
        kept |= {int(run["id"]) for run in runs[-newest:]}
    if days is not None:
        first = (now or datetime.now(timezone.utc)) - timedelta(days=min(days, 1e6))
        text = first.strftime("%Y-%m-%dT%H:%M:%S.") + f"{first.microsecond // 1000:03}Z"
        kept |= {int(run["id"]) for run in runs if str(run["created_utc"]) > text}
    if best:
        for of in campaigns.values():
            good = [run for run in of if run["phase"] is None and not run["rolled_back"]]
            good.sort(key=lambda run: float(run["tracking_rms_m"]))
            kept |= {int(run["id"]) for run in good[:best]}
    return kept


def selected(runs: Sequence[Mapping[str, Any]], wanted: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the runs whose entries have wanted values; a pair is a range with both ends.

    Raises
    ------
    BadInputError
        If a run has no such key.

    Examples
    --------
    >>> selected([{"law": "pd", "tracking_rms_m": 2e-5}], {"tracking_rms_m": (None, 1e-5)})
    []
    """
    unknown = [key for key in wanted if runs and key not in runs[0]]
    if unknown:
        message = f"{unknown[0]}: a run has {', '.join(runs[0])}"
        raise BadInputError(message)
    return [dict(run) for run in runs if all(_is(run[key], value) for key, value in wanted.items())]


def with_descriptions(
    runs: list[dict[str, Any]],
    wanted: Mapping[str, object],
    read: Callable[[list[int]], Sequence[Mapping[str, Any]]],
) -> list[dict[str, Any]]:
    """Return the runs that have wanted `DESCRIPTIONS`, as JSON text or as what it means.

    `read` returns the rows of some keys, with their arrays.
    """
    if not wanted:
        return runs
    meant = {key: _parsed(value) for key, value in wanted.items()}
    found: list[dict[str, Any]] = []
    for first in range(0, len(runs), READ_AT_ONCE):
        part = runs[first : first + READ_AT_ONCE]
        rows = read([int(run["id"]) for run in part])
        found += [
            run
            for run, row in zip(part, rows, strict=True)
            if all(_parsed(row[key]) == value for key, value in meant.items())
        ]
    return found


def _parsed(text: object) -> object:
    """Return what a JSON text means; anything else, and a text that is not JSON, as it is."""
    if not isinstance(text, str):
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text


def _is(value: Any, wanted: Any) -> bool:  # noqa: ANN401 (any value of a run)
    """Return whether a value is the wanted one, or within the wanted range."""
    import numpy as np  # not needed to list runs

    if not isinstance(wanted, tuple) or len(wanted) != 2:
        return np.array_equal(value, wanted)
    if value is None:
        return False
    low, high = wanted
    values = np.ravel(value).tolist()
    return all((low is None or one >= low) and (high is None or one <= high) for one in values)
