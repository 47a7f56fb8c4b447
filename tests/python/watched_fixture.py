"""Messages of a cell as the monitor reads them; tests of what watches a cell import it."""

from __future__ import annotations

import json
from typing import Any

from ilc_rt.dashboard.model import CellModel
from ilc_rt.events import parse_event
from ilc_rt.monitor import Message

START = {
    "event": "start", "cell": "gantry", "campaign": "c1", "n_samples": 50, "n_axes": 2,
    "axis_names": ["x", "y"], "cycle_s": 0.002, "first_index": 0, "iterations": 4,
    "measure": "encoder", "law": "pd", "bus": "loopback:", "mode": "realtime",
    "input_units": ["m", "m"],
}  # fmt: skip
STAGES = {"wake_us": 2000.0, "receive_us": 9.0, "control_us": 8.0, "send_us": 7.0, "slack_us": 0.0}


def said(payload: dict[str, Any], topic: str = "state") -> Message:
    """Return a message as the monitor reads it."""
    return Message("gantry", topic, payload, parse_event(json.dumps(payload)))


def ended(index: int, error_m: float, **more: object) -> Message:
    """Return the end of a run."""
    return said(
        {
            "event": "iteration", "id": index + 1, "index": index, "tracking_inf_m": error_m,
            "tracking_rms_m": error_m / 2, "contour_inf_m": error_m / 4,
            "contour_rms_m": error_m / 8, "axes_tracking_inf_m": [error_m, error_m / 3],
            "axes_tracking_rms_m": [error_m / 2, error_m / 6], "overruns": 1, "update_ms": 0.3,
            **more,
        },
        "iteration",
    )  # fmt: skip


def batch(first: int, iteration: int | None = 0, sample: int = 0, n: int = 25) -> Message:
    """Return a batch of cycles: x lags 10 um behind, once 500 um; y is at rest."""
    rows = [[0.001 * (first + k), 0.5] for k in range(n)]
    encoder = [[x - (5e-4 if first + k == 40 else 1e-5), y] for k, (x, y) in enumerate(rows)]
    return Message("gantry", "servo", {
        "event": "servo", "first_sync": first,
        "iteration_and_sample": [
            None if iteration is None else [iteration, sample + k] for k in range(n)
        ],
        "reference_m": rows, "input": [[1e-4, 0.0]] * n, "encoder_m": encoder,
        "tool_m": [[None, None]] * n,
    })  # fmt: skip


def fed(*messages: Message, model: CellModel | None = None) -> CellModel:
    """Return a model after messages, a tenth of a second apart."""
    model = model or CellModel("gantry")
    for number, message in enumerate(messages):
        model.apply(message, 0.1 * number, 1e9 + 0.1 * number)
    return model
