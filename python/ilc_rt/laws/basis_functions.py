"""Norm-optimal ILC in the parameters of a feed-forward: `BasisFunctions`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import Law, LearningError, StateSpace
from ilc_rt.given import given
from ilc_rt.laws.basis import basis_signals, named_bases
from ilc_rt.laws.python_law import PythonLaw, signals, weight, whole

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt._native import TimeVarying
    from ilc_rt.laws.basis import Basis

    Array = NDArray[np.float64]


class BasisFunctions(PythonLaw):
    """ILC with basis functions: what is learned on one trajectory holds on every other one.

    ``u = Psi(r) theta``, with theta minimising ``|e + P (u - Psi theta')|_q^2 + |Psi theta'|_s^2 +
    |Psi theta' - u|_r^2``

    Parameters
    ----------
    model : StateSpace or TimeVarying
        Discrete model P from the learned input to the measurement, with one input per axis of the
        reference.
    reference : array_like, shape (n_samples,) or (n_samples, n_axes)
        Reference r of the runs that are learned from.
    basis : sequence of str or callable
        Signals of the reference, each with one parameter per axis: ``"position"``, ``"velocity"``,
        ``"acceleration"``, ``"jerk"``, ``"snap"``, ``"coulomb"`` and ``"viscous"`` friction, or
        functions ``f(reference, dt_s)`` of an axis, e.g. those of `position_harmonics`.
    q : float or array_like, shape (n_samples,) or (n_samples, n_outputs)
        Weight of the predicted error.
    s, r : float or array_like, shape (n_samples,) or (n_samples, n_inputs)
        Weights of the next input, and of its change.
    lead_samples : int or None
        Samples by which the signals are ahead of the reference, 0 to 1000; None for the dead time
        of the model.
    parameters : array_like or None, shape (n_axes, n_functions)
        Parameters to begin with; None for zero.
    learn : bool
        Learn; otherwise the parameters stay as they are.

    Raises
    ------
    LearningError
        If a weight is negative, a name is unknown, or the model does not suit the reference.
    ValueError, TypeError
        If an argument has the wrong shape or dtype, or a number that is not finite.

    Notes
    -----
    The problem is solved in least squares: a parameter that the reference does not excite stays as
    it is. Coulomb friction is the sign of the velocity, smooth below 1 mm/s. An input from
    elsewhere need not be in the span of the functions. Jerk and snap suit smooth references alone:
    those of a path with blended corners have peaks above the bandwidth of any model.

    References
    ----------
    [vandewijdeven2010]; [bolder2015].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import BasisFunctions, discretize, second_order, simulate
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> there, elsewhere = 0.02 * np.hanning(300), 0.05 * np.hanning(500) ** 2
    >>> law = BasisFunctions(axis, there, ["position", "velocity", "acceleration"])
    >>> learned = simulate(axis, law, there, trials=3)
    >>> error = elsewhere - axis.simulate(law.input(elsewhere))
    >>> bool(np.abs(error).max() < 0.001 * np.abs(elsewhere).max())
    True
    """

    def __init__(
        self,
        model: StateSpace | TimeVarying,
        reference: ArrayLike,
        basis: Sequence[Basis] = ("velocity", "acceleration", "coulomb"),
        q: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        lead_samples: int | None = None,
        parameters: ArrayLike | None = None,
        learn: bool = True,  # noqa: FBT001 (like every other parameter of a law)
    ) -> None:
        super().__init__(**given(locals()))
        for needed in ("simulate", "n_inputs", "dt_s"):
            if not hasattr(model, needed):
                message = f"model is a {type(model).__name__}; a StateSpace is needed"
                raise TypeError(message)
        if model.dt_s is None:
            message = "model: a discrete-time model is needed"
            raise LearningError(message)
        self._model, self._dt_s = model, float(model.dt_s)
        self._bases = named_bases(basis)
        self._lead = _lead(model, lead_samples)
        if not isinstance(learn, (bool, np.bool_)):
            message = f"learn = {learn!r}: True or False is needed"
            raise TypeError(message)
        self._r = _reference(reference, model.n_inputs)
        n_samples = len(self._r)
        self._psi = basis_signals(self._bases, self._r, self._dt_s, self._lead)
        self._first = np.zeros(self._psi.shape[:2])
        if parameters is not None:
            start = np.asarray(parameters)
            if start.shape != self._first.shape or start.dtype.kind not in "iuf":
                message = f"parameters has shape {start.shape}; {self._first.shape} is needed"
                raise ValueError(message)
            if not np.isfinite(start).all():
                message = "parameters: only finite numbers are allowed"
                raise ValueError(message)
            self._first = start.astype(np.float64)
        arguments = {
            "model": model,
            "signals": self._psi.reshape(-1, n_samples).T,
            "q": weight("q", q, n_samples, model.n_outputs),
            "s": weight("s", s, n_samples, model.n_inputs),
            "r": weight("r", r, n_samples, model.n_inputs),
            "parameters": self._first.ravel(),
            "learn": bool(learn),
        }
        self._law = Law("parametric", arguments)

    @property
    def coefficients(self) -> dict[str, Array]:
        """Learned parameters by the name of their function, each of shape (n_axes,)."""
        return dict(zip(self._bases, self._theta().T, strict=True))

    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the next input, and learn its parameters.

        Parameters
        ----------
        u, e : array_like, shape (n_samples,) or (n_samples, n_axes)
            Input and error of a run.
        disturbance : object
            Not used.

        Returns
        -------
        ndarray of float64, shape of `u`
            The next input.

        Raises
        ------
        ValueError, TypeError
            If an array does not suit the law.
        """
        del disturbance
        n_inputs, n_outputs = self._model.n_inputs, self._model.n_outputs
        given_u, given_e = signals(u, e, len(self._r), n_inputs, n_outputs)
        return self._law.update(given_u, given_e).reshape(np.shape(u))

    def input(self, reference: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the input that the learned parameters give, for this reference or another one.

        Parameters
        ----------
        reference : array_like or None, shape (n_samples,) or (n_samples, n_axes)
            The other reference, of any length.

        Returns
        -------
        ndarray of float64, shape of the reference
            The input.

        Raises
        ------
        ValueError, TypeError
            If the reference has the wrong shape or dtype, or a number that is not finite.
        """
        given_one = self._arguments["reference"] if reference is None else reference
        axes = _reference(given_one, self._model.n_inputs)
        psi = basis_signals(self._bases, axes, self._dt_s, self._lead)
        return self._signal(psi).reshape(np.shape(given_one))

    def with_reference(self, reference: ArrayLike, **changes: Any) -> BasisFunctions:  # noqa: ANN401
        """Return the law for another reference; it begins with the parameters learned here.

        Parameters
        ----------
        reference : array_like, shape (n_samples,) or (n_samples, n_axes)
            The other reference.
        **changes
            Other parameters of the law that change, e.g. ``learn=False``.

        Returns
        -------
        BasisFunctions
            The law.

        Raises
        ------
        LearningError, ValueError, TypeError
            As the law itself.
        """
        kept = {**self._arguments, "reference": reference, "parameters": self._theta()}
        return type(self)(**{**kept, **changes})

    def reset(self) -> None:
        """Go back to the parameters that the law began with."""
        self._law.reset()

    def _theta(self) -> Array:
        """Return the parameters, shape (n_axes, n_functions)."""
        return np.asarray(self._law._figure("parameters")).reshape(self._first.shape)

    def _signal(self, psi: Array) -> Array:
        return np.einsum("ab,abk->ka", self._theta(), psi)


def _reference(reference: ArrayLike, n_inputs: int) -> Array:
    array = np.asarray(reference)
    if array.dtype.kind not in "iuf":
        message = f"reference has dtype {array.dtype}; numbers are needed"
        raise TypeError(message)
    axes = array.reshape(-1, 1) if array.ndim == 1 else array
    if axes.ndim != 2 or len(axes) < 2 or axes.shape[1] != n_inputs:
        message = (
            f"reference has shape {array.shape}; (n_samples, {n_inputs}) is needed, one axis for "
            "each input of the model, and at least 2 samples"
        )
        raise ValueError(message)
    if not np.isfinite(axes).all():
        message = "reference: only finite numbers are allowed"
        raise ValueError(message)
    return axes.astype(np.float64)


def _lead(model: StateSpace | TimeVarying, lead_samples: int | None) -> int:
    if lead_samples is not None:
        return whole("lead_samples", lead_samples, 0, 1000)
    if not isinstance(model, StateSpace):
        return 0
    known = [delay for row in model.delays() for delay in row if delay is not None]
    return min(known, default=0)
