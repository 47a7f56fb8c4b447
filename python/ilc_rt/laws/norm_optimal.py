"""Norm-optimal ILC: `NormOptimalIlc`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import Law
from ilc_rt.given import given

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

    from ilc_rt.laws.arguments import Model, VaryingModel


class NormOptimalIlc(Law):
    """Norm-optimal ILC, exact and in linear time.

    Minimises ``sum z'qz + u's u + v'rv + rate^2 |v[k] - v[k-1]|^2`` with z the
    predicted error, u the next input and v its change.

    Parameters
    ----------
    model : StateSpace, TimeVarying or compatible
        Discrete model from the learned input to the measurement, including the dead time of the
        bus.
    n_samples : int
        Samples of a run.
    q : float or array_like, shape (n,), (n_outputs, n_outputs) or (n, n_outputs, n_outputs)
        Weight of the predicted error.
    s : float or array_like, shape (n,), (n_inputs, n_inputs) or (n, n_inputs, n_inputs)
        Weight of the next input.
    r : float or array_like, shape as `s`
        Weight of the change of the input.
    rate : float
        Weight of the change from one sample to the next; enters squared.

    Raises
    ------
    LearningError
        If a weight is not positive semidefinite, or s, r and rate are zero and the
        model does not determine the input or has an unstable inverse.
    ModelError, TypeError
        If the model is continuous, varies over another number of samples, or is not a model.

    Notes
    -----
    With s = r = 0 this is convex-optimisation ILC (CO-ILC), `rate` being its d. The law pairs each
    sample of the input with the first sample of the error that it affects. The last samples of the
    input have no effect within the run: there s, r and rate alone decide, and if all are zero the
    input is unchanged. An update takes time and memory proportional to n_samples.

    References
    ----------
    [haas2016], Eq. (5) to (12); [barton2010], Eq. (3.13) to (3.15).

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import NormOptimalIlc, discretize, second_order
    >>> axis = discretize(second_order(157.0, 0.5), 0.002)
    >>> law = NormOptimalIlc(axis, 400, rate=3.0)
    >>> law.update(np.zeros(400), np.ones(400)).shape
    (400,)
    >>> half = np.where(np.arange(400) < 200, 1.0, 0.0)
    >>> NormOptimalIlc(axis, 400, q=half, r=0.01).q.shape
    (400,)
    """

    def __new__(
        cls,
        model: VaryingModel,
        n_samples: int,
        q: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
    ) -> Self:
        return super().__new__(cls, "norm_optimal", given(locals()))

    @classmethod
    def contour(
        cls,
        model: VaryingModel,
        reference: ArrayLike,
        q: ArrayLike = 1.0,
        contour: ArrayLike = 1.0,
        along: ArrayLike = 0.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
        axes: Sequence[int] | None = None,
    ) -> Self:
        """Return the law with contour weights: the error normal to the path instead of each axis.

        Parameters
        ----------
        model : StateSpace, TimeVarying or compatible
            Discrete model from the learned input to the measurement.
        reference : array_like, shape (n_samples, n_outputs)
            Reference of every output.
        q, contour, along : float or array_like
            Weights of every output, of the error normal to and along the path, as in
            `ilc_rt.weights.contour`.
        s, r, rate : float or array_like
            Weights of the input, as for the law itself.
        axes : sequence of int, optional
            Outputs that form the path; by default all.

        Returns
        -------
        NormOptimalIlc
            Law for runs of the reference's length.

        Raises
        ------
        LearningError, ModelError, ValueError, TypeError
            As `ilc_rt.weights.contour` and the law itself.

        References
        ----------
        [barton2010], Eq. (4.1) to (4.3), (5.8) to (5.11).

        Examples
        --------
        >>> import numpy as np
        >>> from ilc_rt import NormOptimalIlc, discretize, second_order
        >>> axis = discretize(second_order(157.0, 0.5), 0.002)
        >>> line = np.outer(np.linspace(0.0, 0.1, 100), [1.0, 1.0])
        >>> law = NormOptimalIlc.contour(axis.append(axis), line, contour=30.0, r=0.01)
        >>> law.update(np.zeros((100, 2)), np.ones((100, 2))).shape
        (100, 2)
        """
        return super().__new__(cls, "contour", given(locals()))

    @classmethod
    def formation(
        cls,
        models: Sequence[Model],
        n_samples: int,
        tracking: ArrayLike = 1.0,
        own: ArrayLike = 1.0,
        centre: ArrayLike = 0.0,
        sigma: ArrayLike = 1.0,
        weight: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
        leaders: Sequence[int] | None = None,
        pairs: Sequence[tuple[int, int]] | None = None,
        axes: Sequence[int] | None = None,
    ) -> Self:
        """Return the law of several agents in formation.

        Parameters
        ----------
        models : sequence of StateSpace or compatible
            Discrete model of each agent, all with the same number of outputs.
        n_samples : int
            Samples of a run.
        tracking, own, centre, sigma, weight : float or array_like
            Shares and weights, as in `ilc_rt.weights.formation`.
        s, r, rate : float or array_like
            Weights of the inputs of all agents, as for the law itself.
        leaders, pairs, axes : sequence, optional
            As in `ilc_rt.weights.formation`.

        Returns
        -------
        NormOptimalIlc
            Law of all agents' inputs and errors, one agent after the other.

        Raises
        ------
        LearningError, ModelError, ValueError, TypeError
            As `ilc_rt.weights.formation` and the law itself.

        References
        ----------
        [barton2010], Eq. (6.1) to (6.11).

        Examples
        --------
        >>> import numpy as np
        >>> from ilc_rt import NormOptimalIlc, discretize, second_order
        >>> axis = discretize(second_order(157.0, 0.5), 0.002)
        >>> law = NormOptimalIlc.formation([axis, axis], 100, tracking=0.5, r=0.01)
        >>> law.update(np.zeros((100, 2)), np.ones((100, 2))).shape
        (100, 2)
        """
        return super().__new__(cls, "formation", given(locals()))

    @classmethod
    def dynamic(
        cls,
        model: VaryingModel,
        n_samples: int,
        filter: Model | None = None,
        q: ArrayLike = 1.0,
        plain: ArrayLike | None = None,
        coupling: ArrayLike | None = None,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
        input_filter: Model | None = None,
        input_weight: ArrayLike = 1.0,
        change_filter: Model | None = None,
        change_weight: ArrayLike = 1.0,
    ) -> Self:
        """Return the law with dynamic (frequency-dependent) weights of error, input and change.

        ``sum |w|^2_q + |z|^2_plain + s |u'|^2 + r |v|^2 + ..``, ``w = F (G z)``, and with filters
        of the input ``+ |F_u u'|^2 + |F_v v|^2``, each with its weight.

        Parameters
        ----------
        model : StateSpace, TimeVarying or compatible
            Discrete model from the learned input to the measurement.
        n_samples : int
            Samples of a run.
        filter : StateSpace or compatible, optional
            Causal, stable filter F: one input per output of the model, or per row of `coupling`; by
            default none.
        q : float or array_like, shape (n_samples,), (f, f) or (n_samples, f, f)
            Weight of the filter's outputs.
        plain : float or array_like, optional
            Weight of the unfiltered error; 0 by default.
        coupling : array_like, shape (n_samples, g, n_outputs), optional
            G: coupling of the channels before the filter at each sample, e.g. contour gains.
        s, r, rate : float or array_like
            Weights of the input, as for the law itself.
        input_filter, change_filter : StateSpace or compatible, optional
            Causal, stable filters F_u of the next input and F_v of its change, with one input per
            input of the model, e.g. `ilc_rt.weights.high_pass`.
        input_weight, change_weight : float or array_like
            Weights of their outputs, shaped as `q`.

        Returns
        -------
        NormOptimalIlc
            Law that filters each run's error and input before learning from them.

        Raises
        ------
        LearningError
            If a filter has a pole outside the unit circle, e.g. one meant to run backward, or does
            not take the inputs of the model, or a weight has the wrong shape.
        ModelError, ValueError, TypeError
            If a filter does not match the model, and as the law itself.

        Notes
        -----
        A high-pass weight of the input keeps it free of high frequencies, where the model is wrong;
        the error keeps what lies there. The same weight of the change only slows learning there.

        References
        ----------
        [barton2010], Eq. (J.10) to (J.23); [gupta1980]; [vanharen2024].

        Examples
        --------
        >>> import numpy as np
        >>> from ilc_rt import NormOptimalIlc, discretize, from_transfer_function, second_order
        >>> axis = discretize(second_order(157.0, 0.5), 0.002)
        >>> low_pass = from_transfer_function([0.33], [1.0, -0.67], 0.002)
        >>> law = NormOptimalIlc.dynamic(axis, 100, low_pass, r=0.01)
        >>> law.update(np.zeros(100), np.ones(100)).shape
        (100,)
        >>> from ilc_rt import weights
        >>> high_pass = weights.high_pass(2, 40.0, 0.002)
        >>> law = NormOptimalIlc.dynamic(axis, 100, input_filter=high_pass, input_weight=4.0)
        >>> law.update(np.zeros(100), np.ones(100)).shape
        (100,)
        """
        return super().__new__(cls, "dynamic", given(locals()))

    @property
    def n_samples(self) -> int:
        """Samples of a run."""
        parameters = self.parameters
        return int(parameters.get("n_samples") or len(parameters["reference"]))

    @property
    def q(self) -> Any:  # noqa: ANN401
        """Weight of the predicted error, as given: a number or an array."""
        return _weight(self.parameters.get("q", 1.0))

    @property
    def s(self) -> Any:  # noqa: ANN401
        """Weight of the next input, as given: a number or an array."""
        return _weight(self.parameters["s"])

    @property
    def r(self) -> Any:  # noqa: ANN401
        """Weight of the change of the input, as given: a number or an array."""
        return _weight(self.parameters["r"])

    @property
    def rate(self) -> float:
        """Weight of the change from one sample to the next; enters squared."""
        return float(self.parameters["rate"])

    @property
    def conditioning(self) -> float:
        """Conditioning of the input by the weights, 0 to 1.

        Below about 1e-12 noise determines part of the input.
        """
        return self._figure("conditioning")


def _weight(given: ArrayLike) -> float | NDArray[np.float64]:
    """Return a weight as a number or a copy of the array."""
    weight = np.array(given, float)
    return weight if weight.ndim else float(weight)
