"""Export of a run from the library to a file of another format."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.errors import BadInputError
from ilc_rt.record import SIGNALS
from ilc_rt.result import axis_names, json_text, write_text
from ilc_rt.text import NAME_MAX, printable

if TYPE_CHECKING:
    from collections.abc import Mapping

# Largest number of characters of a value in a table's header; a program or a law may be long.
VALUE_MAX = 1_000_000
FORMATS = (".npz", ".csv", ".json")


def export_run(row: Mapping[str, Any], path: str | Path) -> None:
    """Write a run as ``.npz``, ``.csv`` or ``.json``, by the file's suffix.

    `row` is the result of `Library.load`. npz and json hold everything; csv holds the signals, one
    sample per line, and the rest as comments in its header.
    """
    target = Path(path)
    if target.suffix not in FORMATS:
        message = f"{target}: the ending must be one of {', '.join(FORMATS)}"
        raise BadInputError(message)
    signals = {
        name: np.asarray(row[name], dtype=np.float64)
        for name in (*SIGNALS, "disturbance")
        if row.get(name) is not None
    }
    rest = {key: value for key, value in row.items() if key not in {*SIGNALS, "disturbance"}}
    if target.suffix == ".npz":
        _write_npz(target, signals, rest)
    elif target.suffix == ".csv":
        # One value per run, not per sample: it is in the header.
        disturbance = signals.pop("disturbance", None)
        rest["disturbance"] = None if disturbance is None else disturbance.tolist()
        write_text(target, _csv_text(signals, rest))
    else:
        content = {**rest, **{name: signal.tolist() for name, signal in signals.items()}}
        write_text(target, json_text(content))


def _write_npz(target: Path, signals: dict[str, Any], rest: dict[str, Any]) -> None:
    figures = np.array(json.dumps(rest, default=str))
    try:
        with target.open("wb") as file:
            np.savez_compressed(file, figures=figures, **signals)
    except OSError as error:
        message = f"{target}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error


def _csv_text(signals: dict[str, Any], rest: dict[str, Any]) -> str:
    names = axis_names(rest)
    n_samples = int(rest["n_samples"])
    columns = {"time_s": np.arange(n_samples) * float(rest["cycle_s"])}
    for name, signal in signals.items():
        quantity, _, unit = name.partition("_m")
        ending = "_m" if name.endswith("_m") else unit
        if signal.ndim == 1:
            columns[name] = signal
            continue
        for axis in range(signal.shape[1]):
            label = names[axis].replace(" ", "") if axis < len(names) else str(axis + 1)
            label = printable(label, NAME_MAX)
            columns[f"{quantity}_{label}{ending}"] = signal[:, axis]
    text = io.StringIO()
    for key, value in rest.items():
        text.write(f"# {key} = {printable(value, VALUE_MAX)}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return text.getvalue()
