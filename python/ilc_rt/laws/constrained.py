"""Constrained norm-optimal ILC: `ConstrainedIlc`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from ilc_rt._native import Law
from ilc_rt.given import given
from ilc_rt.laws.arguments import renamed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from typing_extensions import Self

    from ilc_rt.laws.arguments import Bounds, Model


class ConstrainedIlc(Law):
    """Constrained norm-optimal ILC, in linear time.

    Minimises ``sum z'qz + u's u + v'rv + rate^2 |v[k] - v[k-1]|^2`` with z the predicted error, u
    the next input and v its change, over all inputs that satisfy every bound.

    Each bound is a number b, for -b to b, or a pair (lower, upper). A side is a number, an array of
    shape (n_samples,), (n_samples, n_channels) or (1, n_channels), or None; infinite entries mean
    no bound.

    Parameters
    ----------
    model : StateSpace or compatible
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
    input_max : float or tuple, optional
        Bounds of the next input, in its unit.
    change_max : float or tuple, optional
        Bounds of its change from this run to the next, in its unit.
    step_max : float or tuple, optional
        Bounds of its change from sample to sample, in its unit.
    reference : array_like, shape (n_samples,) or (n_samples, n_inputs), optional
        Set points r of the program, in the unit of the input.
    position_bounds : float or tuple, optional
        Bounds of the corrected set point r + u.
    velocity_bounds : float or tuple, optional
        Bounds of its first difference over the sample time, per second.
    acceleration_bounds : float or tuple, optional
        Bounds of its second difference over the squared sample time, per second
        squared.
    output_bounds : float or tuple, optional
        Bounds of the predicted output r - z, in its unit.
    output_reference : array_like, shape (n_samples,) or (n_samples, n_outputs), optional
        The reference of the outputs, if it differs from `reference`.

    Raises
    ------
    LearningError
        If bounds are contradictory, with their names and the sample; if a weight is not positive
        semidefinite, or s, r and rate are zero and the model does not determine the input.
    ModelError
        If the model is continuous.
    ValueError, TypeError
        If an argument has the wrong shape, dtype or a number out of range.

    Notes
    -----
    Before the run the input is 0 and the set point is at its first value: the first step is the
    input itself, and the first accelerations start from rest. If a run begins otherwise, make
    the bounds of those samples infinite. Output samples before the first effect of the input
    cannot be changed.

    The next input exceeds no bound by more than 1e-9 of its size. If no such input is found,
    `update` returns the input of the run and `status` gives the reason. The solver is a primal-dual
    interior-point method with a Riccati recursion for its linear systems; near the optimum, and
    from the last solution on, it solves with the active bounds as equations.

    References
    ----------
    [haas2016], section 4; [mehrotra1992]; [rao1998]; [hintermueller2002].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import ConstrainedIlc, discretize, second_order
    >>> axis = discretize(second_order(157.0, 0.5), 0.002)
    >>> law = ConstrainedIlc(axis, 400, rate=3.0, input_max=0.01)
    >>> e = 0.05 * np.sin(0.05 * np.arange(400))
    >>> u = law.update(np.zeros(400), e)
    >>> law.status, round(float(u.max()), 6)
    ('solved', 0.01)
    """

    @renamed(u_bounds="input_max", v_bounds="change_max", step_bounds="step_max")
    def __new__(
        cls,
        model: Model,
        n_samples: int,
        q: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
        *,
        input_max: Bounds = None,
        change_max: Bounds = None,
        step_max: Bounds = None,
        reference: ArrayLike | None = None,
        position_bounds: Bounds = None,
        velocity_bounds: Bounds = None,
        acceleration_bounds: Bounds = None,
        output_bounds: Bounds = None,
        output_reference: ArrayLike | None = None,
    ) -> Self:
        return super().__new__(cls, "constrained", given(locals()))

    @property
    def n_samples(self) -> int:
        """Samples of a run."""
        return int(self.parameters["n_samples"])

    @property
    def status(self) -> Literal["untried", "solved", "infeasible", "max_iterations"]:
        """Outcome of the last update."""
        return self._figure("status")

    @property
    def message(self) -> str:
        """The status as a sentence, with names and samples of infeasible bounds."""
        return self._figure("message")

    @property
    def iterations(self) -> int:
        """Iterations of the last update; 0 if no bound was active."""
        return self._figure("iterations")

    @property
    def gap(self) -> float:
        """Relative duality gap: bound on the excess of the cost over the optimum."""
        return self._figure("gap")
