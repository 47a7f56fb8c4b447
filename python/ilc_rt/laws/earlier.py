"""Texts by which versions up to 0.1 told native laws apart, so that their campaigns go on.

The native module imports it when a campaign is resumed.
"""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import numpy as np

from ilc_rt.laws.around import Ladder
from ilc_rt.laws.filtered import ErrorFeedforwardIlc, PdIlc
from ilc_rt.laws.modelled import AdjointIlc, ModelInverseIlc
from ilc_rt.laws.norm_optimal import NormOptimalIlc

PLAIN = {"model", "n_samples", "q", "s", "r", "rate"}
FILTERS = {
    "GaussianFilter": "Gaussian",
    "SwitchedFilter": "switched",
    "ButterworthFilter": "zero-phase",
}


def shown(law: object) -> str | None:
    """Return the ``repr`` that a law had; None for a kind whose ``repr`` or meaning was another.

    Parameters
    ----------
    law : object
        A law.

    Examples
    --------
    >>> from ilc_rt import PdIlc
    >>> shown(PdIlc(0.5, 0.0, lead_samples=2))
    'PdIlc(kp=0.5, kd=0, q_filter=None, lead=2)'
    """
    given: dict[str, Any] = getattr(law, "parameters", {})
    if type(law) is PdIlc:
        words = f"kp={_number(given['kp'])}, kd={_number(given['kd'])}"
        last = f"lead={given['lead_samples']}"
        return f"PdIlc({words}, q_filter={_filter(given['q_filter'])}, {last})"
    if type(law) is ErrorFeedforwardIlc:
        limit = given["input_max"]
        bound = "None" if limit is None or np.isinf(limit) else _number(limit)
        words = f"gain={_number(given['gain_per_s'])}, filter={_filter(given['filter'])}"
        return f"ErrorFeedforwardIlc({words}, lead={given['lead_samples']}, limit={bound})"
    if type(law) in {AdjointIlc, ModelInverseIlc}:
        gain = law.gain if isinstance(law, AdjointIlc) else given["gain"]
        words = f"n_samples={given['n_samples']}, gain={_number(gain)}"
        return f"{type(law).__name__}({words}, q_filter={_filter(given['q_filter'])})"
    if type(law) is NormOptimalIlc and set(given) == PLAIN:
        weights = ", ".join(f"{name}={_weight(given[name])}" for name in ("q", "s", "r"))
        words = f"n_samples={given['n_samples']}, {weights}"
        return f"NormOptimalIlc({words}, rate={_number(given['rate'])})"
    if type(law) is Ladder:
        inner = given["law"]
        return f"Ladder({shown(inner) or repr(inner)}, repeats={given['repeats']})"
    return None


def _number(value: float) -> str:
    """Return a number without exponent and trailing zeros."""
    text = format(Decimal(repr(float(value))), "f")
    return text.rstrip("0").rstrip(".") if "." in text else text


def _filter(value: object) -> str:
    if value is None:
        return "None"
    if getattr(value, "causal", False):
        return "causal"
    return FILTERS.get(type(value).__name__, "FIR")


def _weight(value: Any) -> str:  # noqa: ANN401 (as a user gave it)
    shape = np.shape(value)
    return str(shape) if shape else _number(float(value))
