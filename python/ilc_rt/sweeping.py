"""Sweeps: the same function over many cases, in this process, in others or on a cluster."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import re
from collections.abc import Mapping
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.errors import BadInputError, SweepError
from ilc_rt.sweep_result import SweepResult
from ilc_rt.workers import without_ctrl_c

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from os import PathLike

__all__ = ["grid", "latin_hypercube", "sweep"]

CASES_MAX = 10_000_000


def sweep(
    function: Callable[..., Any],
    cases: Iterable[Mapping[str, Any]],
    executor: Executor | None = None,
    seed: int = 0,
    *,
    file: str | PathLike[str] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> SweepResult:
    """Call a function for every case, in any order on any executor, with the same result.

    Parameters
    ----------
    function : callable
        Called with the keywords of a case; with a keyword `seed` (a whole number) or `rng` (a
        generator) of its own for every case, if it takes one. It returns a number, an array, or a
        mapping of names to numbers, texts and arrays. For another process it must be importable.
    cases : iterable of mappings
        Keywords of each case; `grid` and `latin_hypercube` make them.
    executor : concurrent.futures.Executor or None
        Where the calls are made: a pool of processes or threads, or a cluster's, e.g.
        ``distributed.Client(address).get_executor()``; None for one after another, here.
    seed : int
        Seed of the sweep, from which that of each case derives by its number.
    file : path or None
        File that every result is written to at once. If it exists, the cases in it are not called
        again; it must be of the same cases and seed.
    progress : callable or None
        Called with the number of finished cases and of all, after each.

    Returns
    -------
    SweepResult
        Cases and results in the order of the cases.

    Raises
    ------
    SweepError
        If the function fails, naming the case; the results before it are in the file.
    BadInputError
        If the file cannot be written, or is of another sweep.
    TypeError
        If a case is not a mapping, or a result is not of these kinds.

    Examples
    --------
    >>> from ilc_rt import grid, sweep
    >>> def area(width, height):
    ...     return width * height
    >>> result = sweep(area, grid(width=[1.0, 2.0], height=[3.0, 4.0]))
    >>> result.arrays()["value"]
    array([3., 4., 6., 8.])
    """
    if not callable(function):
        message = f"function = {function!r}: a function is needed"
        raise TypeError(message)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        message = f"executor = {executor!r}: an executor of concurrent.futures is needed"
        raise TypeError(message)
    every = [_case(number, case) for number, case in enumerate(cases)]
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**128:
        message = f"seed = {seed!r}: a whole number from 0 is needed"
        raise ValueError(message)
    offered = _offered(function)
    store = None if file is None else _Store(Path(file), _fingerprint(function, every, seed))
    found: dict[int, Any] = {}

    def keep(number: int, value: object) -> None:
        # The same conversion with and without a file, so that a resumed sweep is the same.
        found[number] = encoded = encode(value)
        if store is not None:
            store.write(number, encoded)
        if progress is not None:
            progress(len(found), len(every))

    try:
        if store is not None:
            found |= store.read(len(every))
        todo = [number for number in range(len(every)) if number not in found]
        if executor is None:
            for number in todo:
                keep(number, _call(function, every[number], number, seed, offered))
        else:
            _parallel(function, every, todo, executor, seed, offered, keep)
    finally:
        if store is not None:
            store.close()
    values = [decode(found[number]) for number in range(len(every))]
    return SweepResult(tuple(every), values, seed)


def grid(**axes: Iterable[Any]) -> list[dict[str, Any]]:
    """Return the cases of a full grid, the last name changing fastest.

    Parameters
    ----------
    **axes
        Values of each name.

    Examples
    --------
    >>> grid(a=[1, 2], b="xy")
    [{'a': 1, 'b': 'x'}, {'a': 1, 'b': 'y'}, {'a': 2, 'b': 'x'}, {'a': 2, 'b': 'y'}]
    """
    cases: list[dict[str, Any]] = [{}]
    for name, values in axes.items():
        row = list(values)
        if len(cases) * len(row) > CASES_MAX:
            message = f"{name}: more than {CASES_MAX} cases"
            raise ValueError(message)
        cases = [{**case, name: value} for case in cases for value in row]
    return cases


def latin_hypercube(
    ranges: Mapping[str, tuple[float, float] | tuple[float, float, str]],
    n_samples: int,
    seed: int = 0,
) -> list[dict[str, float]]:
    """Return random cases that cover the range of each name evenly.

    Parameters
    ----------
    ranges : mapping of str to tuple
        Least and greatest value of each name, and ``"log"`` for an even cover of its logarithm.
    n_samples : int
        Number of cases, 1 to 10 000 000.
    seed : int
        Seed of the drawing.

    Raises
    ------
    ValueError
        If a range is empty, not finite, or not above 0 on a logarithmic scale.
    TypeError
        If `ranges` is not a mapping, or a range has no two ends.

    References
    ----------
    [mckay1979].

    Examples
    --------
    >>> cases = latin_hypercube({"mass_kg": (20.0, 200.0, "log")}, 3)
    >>> [20.0 <= case["mass_kg"] <= 200.0 for case in cases]
    [True, True, True]
    """
    if (
        isinstance(n_samples, bool)
        or not isinstance(n_samples, int)
        or not 1 <= n_samples <= CASES_MAX
    ):
        message = f"n_samples = {n_samples!r}: a whole number from 1 to {CASES_MAX} is needed"
        raise ValueError(message)
    if not isinstance(ranges, Mapping):
        message = f"ranges = {ranges!r}: a mapping of names to pairs is needed"
        raise TypeError(message)
    rng = np.random.default_rng(seed)
    columns = {}
    for name, (low, high, *scale) in ranges.items():
        is_log = scale == ["log"]
        if scale not in ([], ["log"], ["linear"]):
            message = f"{name}: the scale is {scale[0]!r}; allowed 'log' or 'linear'"
            raise ValueError(message)
        if not (np.isfinite(low) and np.isfinite(high) and low < high) or (is_log and low <= 0):
            message = f"{name}: from {low} to {high} is not a range of this scale"
            raise ValueError(message)
        share = (rng.permutation(n_samples) + rng.random(n_samples)) / n_samples
        if is_log:
            columns[name] = low * (high / low) ** share
        else:
            columns[name] = low + (high - low) * share
    return [
        {name: float(values[number]) for name, values in columns.items()}
        for number in range(n_samples)
    ]


def case_seed(seed: int, number: int) -> int:
    """Return the seed of a case, which depends on that of the sweep and its number alone.

    Examples
    --------
    >>> case_seed(0, 1) == case_seed(0, 1), case_seed(0, 1) == case_seed(0, 2)
    (True, False)
    """
    low, high = np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(2, np.uint32)
    return int(low) + (int(high) << 32)


def encode(value: object) -> Any:  # noqa: ANN401 (a value of JSON)
    """Return a result as a value of JSON; every number keeps all its bits.

    Raises
    ------
    TypeError
        If it is of a kind that a sweep does not keep.

    Examples
    --------
    >>> encode({"rms": np.float64(0.1), "e": np.arange(2)})
    {'rms': 0.1, 'e': {'array': [0, 1], 'dtype': 'int64'}}
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        # Subclasses, as those of NumPy, have another text.
        plain = {bool: bool, int: int, float: float, str: str}
        kind = next((known for known in plain if isinstance(value, known)), None)
        return value if kind is None else kind(value)
    if isinstance(value, np.generic) and value.dtype.kind in "biuf":
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return {"array": value.tolist(), "dtype": str(value.dtype)}
    if isinstance(value, (list, tuple)):
        return encode(np.asarray(value))
    if hasattr(value, "items"):
        return {str(name): encode(part) for name, part in value.items()}
    message = (
        f"a result of the kind {type(value).__name__} cannot be kept; numbers, texts, arrays and "
        "mappings of them can"
    )
    raise TypeError(message)


def decode(value: Any) -> Any:  # noqa: ANN401 (a value of JSON)
    """Return a result from its value of JSON.

    Examples
    --------
    >>> decode({"array": [0, 1], "dtype": "int64"})
    array([0, 1])
    """
    if isinstance(value, dict):
        if value.keys() == {"array", "dtype"}:
            return np.array(value["array"], dtype=value["dtype"])
        return {name: decode(part) for name, part in value.items()}
    return value


class _Store:
    """File of a sweep: a line for the sweep, then one per result."""

    def __init__(self, path: Path, fingerprint: str) -> None:
        self._path, self._fingerprint = path, fingerprint
        try:
            self._text = path.read_text(encoding="utf-8") if path.exists() else ""
            self._file = path.open("a", encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            message = f"{path}: cannot be used: {getattr(error, 'strerror', None) or error}"
            raise BadInputError(message) from error

    def read(self, n_cases: int) -> dict[int, Any]:
        """Return the results that the file has; it begins with the line of this sweep."""
        # A line that was cut off when the process was killed is made again.
        *lines, cut = self._text.split("\n")
        if not lines:
            os.truncate(self._path, 0)
            self._line({"sweep": self._fingerprint, "cases": n_cases})
            return {}
        os.truncate(self._path, len(self._text.encode()) - len(cut.encode()))
        try:
            head, *rows = [json.loads(line) for line in lines]
            is_ours = head["sweep"] == self._fingerprint
            found = {int(row["case"]): row["value"] for row in rows}
        except (ValueError, KeyError, TypeError) as error:
            message = f"{self._path}: not the file of a sweep"
            raise BadInputError(message) from error
        if not is_ours:
            message = f"{self._path}: of another sweep: its function, cases or seed differ"
            raise BadInputError(message)
        return found

    def write(self, number: int, value: object) -> None:
        """Append a result."""
        self._line({"case": number, "value": value})

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _line(self, content: object) -> None:
        try:
            self._file.write(json.dumps(content) + "\n")
            self._file.flush()
        except OSError as error:
            message = f"{self._path}: cannot be written: {error.strerror}"
            raise BadInputError(message) from error


def _case(number: int, case: Mapping[str, Any]) -> dict[str, Any]:
    if not hasattr(case, "keys"):
        message = f"case {number} is a {type(case).__name__}; a mapping of keywords is needed"
        raise TypeError(message)
    return {str(name): case[name] for name in case}


def _offered(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the keywords for random numbers that a function takes."""
    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return ()
    return tuple(name for name in ("seed", "rng") if name in parameters)


def _call(
    function: Callable[..., Any], case: dict[str, Any], number: int, seed: int,
    offered: tuple[str, ...],
) -> Any:  # noqa: ANN401 (what the function returns)  # fmt: skip
    """Call the function for a case; this is what other processes run."""
    own = {
        "seed": case_seed(seed, number),
        "rng": np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,))),
    }
    extra = {name: own[name] for name in offered if name not in case}
    try:
        return function(**case, **extra)
    except Exception as error:
        shown = ", ".join(f"{name} = {value!r}" for name, value in case.items())
        message = f"case {number} ({shown}): {type(error).__name__}: {error}"
        raise SweepError(message) from error


def _parallel(
    function: Callable[..., Any], every: list[dict[str, Any]], todo: list[int], executor: Executor,
    seed: int, offered: tuple[str, ...], keep: Callable[[int, object], None],
) -> None:  # fmt: skip
    futures: dict[Future[object], int] = {}
    try:
        starting = without_ctrl_c if isinstance(executor, ProcessPoolExecutor) else nullcontext
        for number in todo:
            with starting():
                future = executor.submit(_call, function, every[number], number, seed, offered)
                futures[future] = number
        for future in as_completed(futures):
            keep(futures[future], future.result())
    finally:
        # After a failure or Ctrl-C no further case is begun.
        for future in futures:
            future.cancel()


def _fingerprint(function: Callable[..., Any], every: list[dict[str, Any]], seed: int) -> str:
    name = f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', '')}"
    text = json.dumps([name, every, seed], default=repr, sort_keys=True)
    # An address in a default repr differs between processes.
    return hashlib.sha256(re.sub(r" at 0x[0-9a-f]+", "", text).encode()).hexdigest()
