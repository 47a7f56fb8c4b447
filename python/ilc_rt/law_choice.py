"""Choice of a law with a model, by the task: a reference, points, changing references, bounds.

Imported by `ilc_rt.recommendation` alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import LearningError, StateSpace, TimeVarying
from ilc_rt.law_candidates import ASSUMED, Candidate, best_of, candidates, rms
from ilc_rt.laws import (
    BasisFunctions,
    ConstrainedIlc,
    ModelFreeIlc,
    NormOptimalIlc,
    PointToPointIlc,
    RelevanceIlc,
    RelevanceWeights,
)
from ilc_rt.learning_facts import KNOWN, LearningFacts
from ilc_rt.reached_bounds import reached_bounds
from ilc_rt.recommended import KINDS, Reason, Recommendation, Refused

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import VaryingModel

    Array = NDArray[np.float64]

# Share of a bound from which it counts as reached.
REACHED = 0.9
# Derivatives of the reference by order, as `BasisFunctions` calls them.
DERIVATIVES = ("position", "velocity", "acceleration", "jerk")


@dataclass(frozen=True)
class Task:
    """Plant with its facts, and the motion that is to be learned."""

    model: VaryingModel
    facts: LearningFacts
    given_samples: int | None
    given_reference: ArrayLike | None
    noise_std: float | None
    n_runs: int

    @property
    def n_samples(self) -> int:
        """Samples of a run, as given or as the reference or the model has them."""
        varying = self.model.n_samples if isinstance(self.model, TimeVarying) else None
        reference = None if self.given_reference is None else len(np.asarray(self.given_reference))
        known = [n for n in (self.given_samples, reference, varying) if n is not None]
        if not known:
            message = "n_samples: needed, unless a reference is given"
            raise LearningError(message)
        if len(set(known)) > 1 or known[0] < 2:
            message = f"n_samples = {known[0]}; reference and model have {known[1:]} samples"
            raise LearningError(message)
        return known[0]

    @property
    def reference(self) -> Array:
        """Reference of shape (n_samples, n_outputs); a smooth motion if none is given."""
        n_outputs = self.facts.n_outputs
        if self.given_reference is None:
            return np.repeat(np.hanning(self.n_samples)[:, None], n_outputs, axis=1)
        array = np.asarray(self.given_reference, dtype=np.float64)
        shaped = array.reshape(len(array), -1)
        if shaped.shape[1] != n_outputs or not np.isfinite(shaped).all():
            message = (
                f"reference has shape {array.shape}; finite numbers of shape (n_samples, "
                f"{n_outputs}) are needed"
            )
            raise ValueError(message)
        return shaped

    def unknown(self) -> Recommendation:
        """Return the law of a model that may be wrong by all of itself."""
        if not self.facts.is_single:
            message = (
                "uncertainty: the model may be wrong by 80 % or more at every frequency, and so "
                "teaches nothing; `ilc identify` measures a better one"
            )
            raise LearningError(message)
        reason = Reason(
            "known_hz", 0.0,
            "the model may be wrong by 80 % or more at every frequency: the gradient is measured "
            "on the plant itself",
        )  # fmt: skip
        refused = Refused("NormOptimalIlc", "the model does not say in which direction to learn")
        return Recommendation(
            ModelFreeIlc(), "ModelFreeIlc", {}, KINDS["ModelFreeIlc"], (reason,), (refused,),
            self.facts,
        )  # fmt: skip

    def points(self, points: Sequence[int]) -> Recommendation:
        """Return the law for which some samples count alone."""
        model = self._time_invariant("PointToPointIlc")
        low = float(self.facts.uncertainty[0])
        arguments: dict[str, Any] = {
            "model": model, "n_samples": self.n_samples, "points": list(points),
            # Noise that is learned is forgotten as quickly as the gain is small.
            "gain": 0.5 if self.noise_std else round(1.0 / (1.0 + min(low, 1.0)), 3),
        }  # fmt: skip
        reasons = [
            Reason("points", list(points),
                   f"{len(list(points))} of {self.n_samples} samples count: the motion between "
                   "them is free, and the input is the smallest one"),
            *self._common(),
        ]  # fmt: skip
        refused = (
            Refused("NormOptimalIlc", "it would spend input on samples that do not count"),
            Refused("ModelInverseIlc", "it needs a reference at every sample"),
        )
        return self._made(PointToPointIlc, arguments, reasons, refused)

    def basis(self, *, has_friction: bool) -> Recommendation:
        """Return the law that learns parameters which hold for other references."""
        if self.given_reference is None:
            message = "reference: needed with changes_task, as its derivatives are the basis"
            raise LearningError(message)
        order = self.facts.order if self.facts.order is not None else 2
        names = list(DERIVATIVES[min(self.facts.integrators, 2) : min(order, 3) + 1])
        if has_friction:
            names.append("coulomb")
        arguments = {"model": self.model, "reference": self.reference, "basis": names}
        reasons = [
            Reason("changes_task", value=True,
                   text="the reference changes: parameters of its derivatives hold for the next "
                   "one, an input does not"),
            Reason("order", self.facts.order,
                   f"{order} poles, {self.facts.integrators} of them at rest: the inverse is "
                   f"spanned by {', '.join(names)}"),
            *self._common(),
        ]  # fmt: skip
        refused = (
            Refused("NormOptimalIlc", "its input suits the reference that it learned alone"),
            Refused("FlexibleIlc", "it needs a library of inputs for pieces of references"),
        )
        return self._made(BasisFunctions, arguments, reasons, refused)

    def tracking(self) -> Recommendation:
        """Return the law with the smallest predicted error over the whole reference."""
        if isinstance(self.model, TimeVarying):
            arguments = {"model": self.model, "n_samples": self.n_samples, "q": 1.0, "r": 0.05}
            reason = Reason("varies", value=True, text="the model varies along the run")
            refused = tuple(
                Refused(name, "it needs a model that does not vary along the run")
                for name in ("ModelInverseIlc", "StableInverseIlc", "AdjointIlc", "ConstrainedIlc")
            )
            return self._made(NormOptimalIlc, arguments, [reason, *self._common()], refused)
        model = self._time_invariant("this")
        found = candidates(
            model, self.n_samples, self.facts, self.reference, self.noise_std, self.n_runs
        )
        best = best_of(found)
        if not np.isfinite(best.left):
            message = f"no law is robust within the uncertainty: {best.against}"
            raise LearningError(message)
        made = self._made(
            best.kind, best.arguments, [*self._common(), self._predicted(best)],
            self._against(found, best),
        )  # fmt: skip
        return replace(made, law=best.law, analysis=best.analysis)

    def bounded(self, found: Recommendation, bounds: Mapping[str, Any]) -> Recommendation:
        """Return the law within bounds, if one of them would be reached."""
        model = self._time_invariant("ConstrainedIlc")
        analysis = found.analysis
        predicted = None if analysis is None else analysis.converged_input
        known = None if self.given_reference is None else predicted
        reached = reached_bounds(bounds, known, self.facts.dt_s, REACHED)
        if not reached:
            reason = Reason(
                "bounds", dict(bounds), f"no bound is reached: {', '.join(bounds)} stay inactive"
            )
            refused = Refused("ConstrainedIlc", "no bound is reached; it gives the same input")
            return replace(
                found, reasons=(*found.reasons, reason), refused=(*found.refused, refused)
            )
        own = ("q", "s", "r")
        weights = {name: found.arguments[name] for name in own if name in found.arguments}
        if not weights:
            weights = {"q": 1.0, "r": 0.05}
        arguments: dict[str, Any] = {
            "model": model,
            "n_samples": self.n_samples,
            **weights,
            **dict(bounds),
        }
        reason = Reason("bounds", reached, "; ".join(reached))
        refused = Refused(found.name, "it knows no bounds: its input would be cut off")
        made = self._made(
            ConstrainedIlc, arguments, [reason, *found.reasons], (refused, *found.refused)
        )
        return replace(made, analysis=found.analysis)

    def relevant(self, found: Recommendation, disturbance_std: float) -> Recommendation:
        """Return the law around one that weights past runs by their disturbance."""
        first = rms(self.reference)
        weights = RelevanceWeights(
            error=1.0 / max(first, 1e-12) ** 2, error_rate=0.0,
            disturbance=1.0 / disturbance_std**2, epsilon=1e-6,
        )  # fmt: skip
        arguments = {
            "library": None, "core": found.law, "weights": weights, "dt_s": self.facts.dt_s,
        }  # fmt: skip
        reason = Reason(
            "disturbance_std", disturbance_std,
            f"a disturbance that differs by {disturbance_std:g} from run to run is measured: runs "
            f"made under a similar one teach the most; the core law is {found.name}",
        )  # fmt: skip
        refused = Refused(found.name, "alone it learns from the last run, of another disturbance")
        made = self._made(
            RelevanceIlc, arguments, [reason, *found.reasons], (refused, *found.refused)
        )
        return replace(made, analysis=found.analysis)

    def _time_invariant(self, law: str) -> StateSpace:
        if isinstance(self.model, TimeVarying):
            message = f"model: {law} needs a model that does not vary along the run"
            raise LearningError(message)
        return StateSpace._of(self.model)

    def _made(
        self, kind: type, arguments: dict[str, Any], reasons: list[Reason],
        refused: tuple[Refused, ...],
    ) -> Recommendation:  # fmt: skip
        return Recommendation(
            kind(**arguments), kind.__name__, arguments, KINDS.get(kind.__name__),
            tuple(reasons), refused, self.facts,
        )  # fmt: skip

    def _common(self) -> list[Reason]:
        """Return the facts that matter for every law."""
        facts, found = self.facts, []
        if facts.delay_samples is not None and facts.delay_samples > 1:
            found.append(Reason("delay_samples", facts.delay_samples,
                                f"the input shows after {facts.delay_samples} samples, and the "
                                "law looks as far ahead"))  # fmt: skip
        found += [
            Reason("modes", mode, f"a mode at {mode.frequency_hz:.3g} Hz has a damping of "
                   f"{mode.damping:.2g}: it may lie elsewhere")
            for mode in facts.modes
        ]  # fmt: skip
        if facts.known_hz is not None:
            found.append(Reason("known_hz", facts.known_hz,
                                f"from {facts.known_hz:.3g} Hz the model may be wrong by "
                                f"{100 * KNOWN:.0f} % or more: nothing can be learned "
                                "there"))  # fmt: skip
        if facts.is_non_minimum_phase:
            worst = min(facts.zeros_outside, key=abs)
            found.append(Reason("zeros_outside", facts.zeros_outside,
                                f"a zero at {worst.real:.4g} is outside the unit circle: a causal "
                                "inverse would grow without bound"))  # fmt: skip
        if self.noise_std:
            share = 100.0 * self.noise_std / max(rms(self.reference), 1e-300)
            found.append(Reason("noise_std", self.noise_std,
                                f"noise is {share:.2g} % of the first error"))  # fmt: skip
        return found

    def _predicted(self, best: Candidate) -> Reason:
        factor = best.analysis.robust_factor if best.analysis is not None else None
        robust = "" if factor is None else f"; the worst factor of a run is {factor:.3g}"
        noise = "" if self.noise_std else f" (with noise of {100 * ASSUMED:g} % assumed)"
        return Reason("left", best.left,
                      f"{100.0 * best.left:.2g} % of the first error are predicted after "
                      f"{self.n_runs} runs{noise}{robust}")  # fmt: skip

    def _against(self, found: list[Candidate], best: Candidate) -> tuple[Refused, ...]:
        refused = []
        for one in found:
            if one is best:
                continue
            why = one.against or (
                f"{100.0 * one.left:.2g} % of the first error are predicted, "
                f"{100.0 * best.left:.2g} % with {best.kind.__name__}"
            )
            refused.append(Refused(one.kind.__name__, why))
        tried = {one.kind.__name__ for one in found}
        if "ModelInverseIlc" not in tried:
            outside = bool(self.facts.zeros_outside)
            why = (
                "a zero outside the unit circle has no causal inverse" if outside
                else "it amplifies noise where the gain of the model is small"
            )  # fmt: skip
            refused.append(Refused("ModelInverseIlc", why))
        if "StableInverseIlc" not in tried and self.facts.is_single:
            refused.append(Refused("StableInverseIlc", "no zero is outside the unit circle"))
        refused.append(Refused("PdIlc", "a model is known; a gain and a lead use little of it"))
        refused.append(Refused("ModelFreeIlc", "every iteration takes three runs"))
        return tuple(refused)
