"""Search for the weights of norm-optimal learning over trials of each axis."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt.trials import Bench, Trial, Weights

if TYPE_CHECKING:
    from collections.abc import Callable

    _Found = tuple[float, Weights, list[Trial]]

STEPS_PER_OCTAVE = 2
WORTH_WHILE = 0.98
"""Share of the expected error below which a weight of the change is worth adding."""
BISECTIONS = 2
"""Bisections, in octaves, between the best rate and the first one that grows."""


class WeightSearch:
    """Search for the weight `rate` with the smallest error among those with which no trial grows.

    One bench for each moving axis; `q` is the weight of the error, `levels` its extremes along the
    run; `growth_max` the allowed growth of an error over the smallest one in a trial of `n_runs`;
    `progress` is called with the number of rates that were tried and of all.
    """

    def __init__(
        self,
        benches: list[Bench],
        q: float,
        levels: list[float],
        growth_max: float,
        n_runs: int,
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        self.progress = progress
        self.q = q
        self.benches, self.levels = benches, levels
        self.growth_max, self.n_runs = growth_max, n_runs
        self.refused: float | None = None
        self.held = True
        bases = [
            bench.axis.gain() / (bench.axis.dt_s * 2.0 * np.pi * bench.axis.natural_frequency_hz)
            for bench in benches
        ]
        low, high = 0.25 * min(bases) * levels[0] ** 0.5, 32.0 * max(bases) * levels[-1] ** 0.5
        count = int(np.ceil(STEPS_PER_OCTAVE * np.log2(high / low))) + 1
        self.rates = [rounded(rate) for rate in np.geomspace(high, low, count)]

    def tell(self, done: int) -> None:
        """Tell that so many of the rates have been tried."""
        if self.progress is not None:
            self.progress(done, len(self.rates))

    def weights(self) -> tuple[Weights, list[Trial]]:
        """Return the best weights, with their trials."""
        best: _Found | None = None
        for number, rate in enumerate(self.rates):
            self.tell(number)
            weights = Weights(self.q, 0.0, 0.0, rate)
            trials = self._trials(weights, self.growth_max)
            if trials is None:
                # Below a rate with which an error grows, it grows even more.
                self.refused = rate
                break
            best = self._better(best, weights, trials)
        self.tell(len(self.rates))
        for _ in range(BISECTIONS if best is not None and self.refused is not None else 0):
            assert best is not None
            assert self.refused is not None
            if best[1].rate > 2.0 * self.refused:
                break
            weights = replace(best[1], rate=rounded((best[1].rate * self.refused) ** 0.5))
            trials = self._trials(weights, self.growth_max)
            if trials is None:
                self.refused = weights.rate
            else:
                best = self._better(best, weights, trials)
        if best is None:
            self.held = False
            weights = Weights(self.q, 0.0, 0.0, self.rates[0])
            trials = self._trials(weights, np.inf)
            assert trials is not None
            best = (self._score(trials), weights, trials)
        score, weights, trials = best
        for r in self._changes():
            slower = Weights(weights.q, 0.0, r, weights.rate)
            tried = self._trials(slower, self.growth_max)
            if tried is not None and self._score(tried) < WORTH_WHILE * score:
                score, weights, trials = self._score(tried), slower, tried
        return weights, trials

    def _better(self, best: _Found | None, weights: Weights, trials: list[Trial]) -> _Found:
        score = self._score(trials)
        return (score, weights, trials) if best is None or score < best[0] else best

    def _changes(self) -> list[float]:
        """Return the weights of the change worth trying: only against noise."""
        if all(bench.noise == 0.0 for bench in self.benches):
            return []
        square = max(float(bench.model.dc_gain()[0, 0]) ** 2 for bench in self.benches)
        return [rounded(self.levels[0] * square * share) for share in (0.3, 1.0, 3.0, 10.0)]

    def _trials(self, weights: Weights, growth_max: float) -> list[Trial] | None:
        """Return the trials of all axes; None if an error grows more than allowed.

        Of several weights of the error the larger, with which learning is bolder, may forbid a
        rate; the residual error is that of the smallest.
        """
        found: list[Trial] = []
        for bench in self.benches:
            for level in self.levels[::-1]:
                trials = bench.try_weights(replace(weights, q=level), growth_max)
                if trials is None:
                    return None
                if level == self.levels[0]:
                    found += trials
        return found

    def _score(self, trials: list[Trial]) -> float:
        """Return the mean of the last errors of the trials, over all axes."""
        by_axis: dict[str, list[float]] = {}
        for trial in trials:
            by_axis.setdefault(trial.axis, []).append(float(trial.rms[-1]))
        return float(np.sqrt(sum(np.mean(last) ** 2 for last in by_axis.values())))


def rounded(value: float) -> float:
    """Return a value rounded to three digits."""
    return float(f"{value:.3g}")
