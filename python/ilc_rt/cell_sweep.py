"""Robustness map of a cell: its simulation with drawn parameters, run by the controller.

Imported by the verb `ilc sweep`, and by users for `robustness_map`. No drive moves.
"""

from __future__ import annotations

import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from ilc_rt.campaign import Campaign, load_cell
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.robustness import RobustnessMap, Variation
from ilc_rt.sweeping import latin_hypercube, sweep

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor
    from os import PathLike

    from ilc_rt._native import Cell

__all__ = ["RobustnessMap", "Variation", "parse_variation", "robustness_map"]

CONVERGED_BELOW = 0.5


def parse_variation(text: str) -> Variation:
    """Return the variation of ``KEY=LOW:HIGH`` or ``KEY=LOW:HIGH:log``.

    Raises
    ------
    BadInputError
        If the text has another form, or the range is empty.

    Examples
    --------
    >>> parse_variation("axis.x.simulation.mass_kg=20:200:log")
    Variation(key='axis.x.simulation.mass_kg', low=20.0, high=200.0, scale='log')
    """
    key, _, given = text.partition("=")
    low, high, scale = [*given.split(":"), "linear"][:3] if given.count(":") in {1, 2} else "???"
    try:
        found = Variation(key.strip(), float(low), float(high), scale)
    except ValueError:
        found = Variation("", 0.0, 0.0)
    is_range = found.low < found.high and abs(found.low) + abs(found.high) < float("inf")
    if not found.key or not is_range or found.scale not in {"linear", "log"}:
        message = f"{text}: needed is KEY=LOW:HIGH or KEY=LOW:HIGH:log with numbers LOW < HIGH"
        raise BadInputError(message)
    if found.scale == "log" and found.low <= 0.0:
        message = f"{text}: on a logarithmic scale LOW must be above 0"
        raise BadInputError(message)
    return found


def robustness_map(
    cell: str | PathLike[str],
    variations: Sequence[Variation | str],
    samples: int = 50,
    iterations: int = 10,
    *,
    converged_below: float = CONVERGED_BELOW,
    executor: Executor | None = None,
    seed: int = 0,
    file: str | PathLike[str] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> RobustnessMap:
    """Let a cell learn with varied parameters, and report for which it converges.

    Every case is a campaign of the real controller in lock-step, on simulated drives in the
    process of the executor.

    Parameters
    ----------
    cell : path
        The cell description.
    variations : sequence of Variation or str
        Keys that are varied, e.g. ``"axis.x.simulation.mass_kg=20:200:log"``: an entry of a list is
        named by its `name` or its number from 0.
    samples : int
        Number of cases, drawn from all ranges together (Latin hypercube).
    iterations : int
        Runs of each campaign.
    converged_below : float
        A case converges if it has no fault, learning stays on, and the error of its last run is
        below this share of the first one's.
    executor, seed, file, progress
        As for `ilc_rt.sweep`.

    Returns
    -------
    RobustnessMap
        The cases, the share that converges, the worst error over each parameter.

    Raises
    ------
    BadInputError
        If a key is not in the cell, or the cell is refused at an end of a range.
    SweepError
        If a case could not be run.

    Examples
    --------
    >>> from ilc_rt.cell_sweep import robustness_map
    >>> found = robustness_map(
    ...     "examples/01_gantry.toml", ["axis.y.simulation.mass_kg=15:25"], samples=2, iterations=4)
    >>> found.converged_share
    1.0
    """
    ranges = [parse_variation(one) if isinstance(one, str) else one for one in variations]
    if not ranges:
        message = "variations: at least one key to vary is needed"
        raise BadInputError(message)
    load_cell(Path(cell), allow_divergent=True)
    text = Path(cell).read_text(encoding="utf-8-sig")
    beside = _files_beside(text, Path(cell).absolute().parent)
    for end in ("low", "high"):
        # A cell that is refused is refused before anything is run.
        with tempfile.TemporaryDirectory(prefix="ilc-sweep-") as folder:
            _varied(text, beside, {one.key: getattr(one, end) for one in ranges}, Path(folder))
    drawn = latin_hypercube(
        {one.key: (one.low, one.high, one.scale) for one in ranges}, samples, seed
    )
    cases = [
        {"text": text, "beside": beside, "values": values, "iterations": iterations}
        for values in drawn
    ]
    found = sweep(run_case, cases, executor, seed, file=file, progress=progress)
    rows = tuple(
        {"values": values, **result} for values, result in zip(drawn, found.values, strict=True)
    )
    return RobustnessMap(str(cell), tuple(ranges), iterations, seed, converged_below, rows)


def run_case(
    text: str, beside: dict[str, str], values: dict[str, float], iterations: int
) -> dict[str, Any]:
    """Run a campaign of a cell with other values; this is what another process runs.

    Parameters
    ----------
    text : str
        The cell description.
    beside : dict of str to str
        Files that it names, with their content.
    values : dict of str to float
        Values by their keys.
    iterations : int
        Runs.

    Returns
    -------
    dict
        Errors of the first, best and last run in m, whether learning was switched off, the fault.
    """
    with tempfile.TemporaryDirectory(prefix="ilc-sweep-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cell = _varied(text, beside, values, Path(folder))
        campaign = Campaign(
            cell, library=Path(folder, "library.db"), bus="loopback:", drives="simulated",
            allow_divergent=True, telemetry=False,
        )  # fmt: skip
        fault = None
        try:
            for _ in campaign.run(iterations):
                pass
        except CampaignError as error:
            fault = error.reason
        result = campaign.result
        comparison = result.comparison
        errors = [comparison.compared(record) for record in comparison.learned]
        return {
            "first_m": errors[0] if errors else None,
            "best_m": min(errors, default=None),
            "last_m": errors[-1] if errors else None,
            "runs": len(result.records),
            "learning_off": any(record.learning_off for record in result.records),
            "fault": fault,
        }


@dataclass(frozen=True)
class _Place:
    """Place of a value in a description: the table or list, and the key in it."""

    table: Any
    key: Any


def _varied(text: str, beside: dict[str, str], values: dict[str, float], folder: Path) -> Cell:
    """Write the cell with other values into a folder, and load it."""
    try:
        document = tomlkit.parse(text)
    except TOMLKitError as error:
        message = f"cell: {' '.join(str(error).split())}"
        raise BadInputError(message) from error
    for key, value in values.items():
        place = _place(document, key)
        is_whole = isinstance(place.table.get(place.key), int)
        place.table[place.key] = round(value) if is_whole else float(value)
    for name, content in beside.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(content, encoding="utf-8")
    path = folder / "cell.toml"
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    shown = ", ".join(f"{key} = {value:g}" for key, value in values.items())
    try:
        return load_cell(path, allow_divergent=True)
    except BadInputError as error:
        message = f"with {shown}: {error.reason.replace(f'{path}: ', '')}"
        raise BadInputError(message) from error


def _place(document: Any, key: str) -> _Place:  # noqa: ANN401 (of tomlkit)
    *path, last = key.split(".")
    table = document
    for part in path:
        if isinstance(table, list):
            named = [entry for entry in table if entry.get("name") == part]
            numbered = [table[int(part)]] if part.isdigit() and int(part) < len(table) else []
            found = (named or numbered or [None])[0]
        else:
            found = table.get(part)
        if not isinstance(found, (dict, list)):
            has = [e.get("name") for e in table] if isinstance(table, list) else list(table)
            message = f"{key}: there is no {part}; there is {', '.join(map(str, has))}"
            raise BadInputError(message)
        table = found
    if isinstance(table, list):
        message = f"{key}: names a list; name an entry of it, and its key"
        raise BadInputError(message)
    if isinstance(table.get(last), (dict, list, str)):
        message = f"{key}: is not a number"
        raise BadInputError(message)
    return _Place(table, last)


def _files_beside(text: str, folder: Path) -> dict[str, str]:
    """Return the files of its folder that a cell description names."""
    found: dict[str, str] = {}

    def visit(part: Any) -> None:  # noqa: ANN401 (of tomlkit)
        if isinstance(part, dict):
            part = list(part.values())
        if isinstance(part, list):
            for inner in part:
                visit(inner)
        elif isinstance(part, str) and len(part) < 200 and "\0" not in part:
            path = folder / part
            if not Path(part).is_absolute() and ".." not in Path(part).parts and path.is_file():
                found[part] = path.read_text(encoding="utf-8")

    visit(tomlkit.parse(text).unwrap())
    return found
