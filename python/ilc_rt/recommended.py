"""Recommendation of a law: the law, the facts that decided, and the laws that are refused.

Made by `ilc_rt.recommendation`.
"""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ilc_rt.analysis import Analysis
    from ilc_rt.learning_facts import LearningFacts

__all__ = ["Reason", "Recommendation", "Refused"]

# Laws as a cell description calls them.
KINDS = {
    "NormOptimalIlc": "norm_optimal", "ConstrainedIlc": "constrained", "PdIlc": "pd",
    "AdjointIlc": "adjoint", "ModelInverseIlc": "model_inverse", "RelevanceIlc": "relevance",
    "BasisFunctions": "basis_functions", "PointToPointIlc": "point_to_point",
    "StableInverseIlc": "stable_inverse", "ModelFreeIlc": "model_free",
}  # fmt: skip


@dataclass(frozen=True)
class Reason:
    """A computed fact that decided, and the sentence it makes.

    Attributes
    ----------
    fact : str
        Name of the fact, e.g. ``"known_hz"``.
    value : object
        Its value.
    text : str
        The sentence.
    """

    fact: str
    value: Any
    text: str


@dataclass(frozen=True)
class Refused:
    """A law that is not recommended, and why.

    Attributes
    ----------
    law : str
        Name of its class.
    why : str
        The reason, with figures.
    """

    law: str
    why: str


@dataclass(frozen=True, repr=False)
class Recommendation:
    """Recommended law, with reasons.

    Attributes
    ----------
    law : Law or object
        The law, ready for `simulate`, an `Experiment` or a `Campaign`.
    name : str
        Name of its class in `ilc_rt`.
    arguments : dict
        Arguments that it was made with.
    kind : str or None
        Name of the law in a cell description (``[learning] law``); None if there is none.
    reasons : tuple of Reason
        Facts that decided.
    refused : tuple of Refused
        Laws that are not recommended.
    facts : LearningFacts or None
        All facts of the model; None without a model.
    analysis : Analysis or None
        Prediction for the law, within the uncertainty; None where there is none.
    """

    law: Any
    name: str
    arguments: dict[str, Any]
    kind: str | None
    reasons: tuple[Reason, ...]
    refused: tuple[Refused, ...]
    facts: LearningFacts | None = None
    analysis: Analysis | None = None

    def __repr__(self) -> str:
        """Return the name, and the arguments that are numbers."""
        return f"Recommendation({self.name}{self._numbers()})"

    def __str__(self) -> str:
        """Return the law, the reasons and the refusals, one per line."""
        lines = [f"{self.name}{self._numbers()}"]
        lines += [f"  because {reason.text}" for reason in self.reasons]
        lines += [f"  not {one.law}: {one.why}" for one in self.refused]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the law, the reasons and the refusals as a table, for a notebook."""
        rows = [("because", reason.text) for reason in self.reasons]
        rows += [(f"not {one.law}", one.why) for one in self.refused]
        body = "".join(
            f"<tr><th>{html.escape(head)}</th><td>{html.escape(text)}</td></tr>"
            for head, text in rows
        )
        title = html.escape(f"{self.name}{self._numbers()}")
        return f"<table><caption>{title}</caption><tbody>{body}</tbody></table>"

    def _numbers(self) -> str:
        shown = [
            f"{name}={value:.4g}" if isinstance(value, float) else f"{name}={value}"
            for name, value in self.arguments.items()
            if isinstance(value, (int, float, str)) and name != "n_samples"
        ]
        return f"({', '.join(shown)})"
