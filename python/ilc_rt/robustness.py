"""Robustness of learning over varied parameters: shares, worst errors, and their picture."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BINS = 8


@dataclass(frozen=True)
class Variation:
    """A key of a cell description that is varied.

    Attributes
    ----------
    key : str
        Its path, ``"axis.x.simulation.mass_kg"``.
    low, high : float
        Ends of the range.
    scale : {"linear", "log"}
        Scale on which the range is covered evenly.

    Examples
    --------
    >>> Variation("axis.x.simulation.mass_kg", 20.0, 80.0, "log").edges(2).round(6)
    array([20., 40., 80.])
    """

    key: str
    low: float
    high: float
    scale: str = "linear"

    def edges(self, bins: int) -> Array:
        """Return the edges of equal parts of the range on its scale."""
        if self.scale == "log":
            return np.geomspace(self.low, self.high, bins + 1)
        return np.linspace(self.low, self.high, bins + 1)


@dataclass(frozen=True)
class RobustnessMap:
    """Outcome of learning for every case of a sweep over a cell.

    Attributes
    ----------
    cell : str
        The cell description.
    variations : tuple of Variation
        What was varied.
    iterations : int
        Runs of each case.
    seed : int
        Seed of the drawing.
    converged_below : float
        Share of the first error below which the last one counts as converged.
    cases : tuple of dict
        ``values``, ``first_m``, ``best_m``, ``last_m``, ``runs``, ``learning_off`` and ``fault`` of
        each case.

    Examples
    --------
    >>> case = {"values": {"k": 1.0}, "first_m": 1e-3, "best_m": 1e-4, "last_m": 1e-4, "runs": 5,
    ...         "learning_off": False, "fault": None}
    >>> RobustnessMap("c.toml", (Variation("k", 0.0, 2.0),), 5, 0, 0.5, (case,)).sentence()
    '1 of 1 cases converge (100 %); the worst of them ends at 0.0001 m.'
    """

    cell: str
    variations: tuple[Variation, ...]
    iterations: int
    seed: int
    converged_below: float
    cases: tuple[dict[str, Any], ...]

    @property
    def converged(self) -> NDArray[np.bool_]:
        """True for each case that converged."""
        return np.array([self._converges(case) for case in self.cases], dtype=bool)

    @property
    def converged_share(self) -> float:
        """Share of the cases that converged, 0 to 1."""
        return float(self.converged.mean()) if self.cases else 0.0

    @property
    def last_m(self) -> Array:
        """Error of the last run of each case in m; NaN without a run."""
        last = [case["last_m"] for case in self.cases]
        return np.array([np.nan if value is None else value for value in last], dtype=np.float64)

    def values(self, key: str) -> Array:
        """Return the value of a key in each case."""
        return np.array([case["values"][key] for case in self.cases], dtype=np.float64)

    def by_parameter(self, bins: int = BINS) -> list[dict[str, Any]]:
        """Return share and worst error over equal parts of the range of each key.

        Parameters
        ----------
        bins : int
            Number of parts.

        Returns
        -------
        list of dict
            ``key``, ``low``, ``high``, ``scale``, and ``parts`` with ``from``, ``to``, ``cases``,
            ``converged_share`` and ``worst_error_m`` (None where there is no case).
        """
        found = []
        for one in self.variations:
            edges, values = one.edges(bins), self.values(one.key)
            place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
            parts = [self._part(edges[k], edges[k + 1], place == k) for k in range(bins)]
            found.append({**asdict(one), "parts": parts})
        return found

    def sentence(self) -> str:
        """Return the outcome as a sentence."""
        converged = self.converged
        count = int(converged.sum())
        share = f"{count} of {len(self.cases)} cases converge ({100 * self.converged_share:.0f} %)"
        if not count:
            return f"{share}."
        return f"{share}; the worst of them ends at {self.last_m[converged].max():.3g} m."

    def to_json(self) -> dict[str, Any]:
        """Return everything as values of JSON."""
        cases = [
            {**case, "converged": bool(is_one)}
            for case, is_one in zip(self.cases, self.converged, strict=True)
        ]
        return {
            "cell": self.cell,
            "iterations": self.iterations,
            "seed": self.seed,
            "converged_below": self.converged_below,
            "converged_share": self.converged_share,
            "by_parameter": self.by_parameter(),
            "cases": cases,
        }

    def plot(self, ax: Any = None) -> Any:  # noqa: ANN401 (matplotlib is slow to import)
        """Draw the last error of each case over each parameter; see `ilc_rt.pictures.robustness`.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes or None
            One per parameter, and one for the first two together; None for new ones.

        Returns
        -------
        sequence of matplotlib.axes.Axes
            The axes drawn into.
        """
        return import_module("ilc_rt.pictures.maps").robustness(self, ax=ax)

    def _converges(self, case: dict[str, Any]) -> bool:
        if case["fault"] is not None or case["learning_off"] or case["last_m"] is None:
            return False
        return bool(case["last_m"] < self.converged_below * case["first_m"])

    def _part(self, low: float, high: float, inside: NDArray[np.bool_]) -> dict[str, Any]:
        last = self.last_m[inside]
        known = last[np.isfinite(last)]
        return {
            "from": float(low),
            "to": float(high),
            "cases": int(inside.sum()),
            "converged_share": float(self.converged[inside].mean()) if inside.any() else None,
            "worst_error_m": float(known.max()) if known.size else None,
        }
