"""Wrappers of any law: `Filtered`, `Gate`, `Ladder`, `ThroughJacobian`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from ilc_rt._native import Law
from ilc_rt.given import given

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

    from ilc_rt.laws.arguments import AnyLaw, QFilter


class _Around(Law):
    """A wrapper of a law."""

    @property
    def law(self) -> Any:  # noqa: ANN401
        """The inner law."""
        return self.parameters["law"]


class Gate(_Around):
    """Gate: stops any law when the error is good enough, or before it diverges.

    Parameters
    ----------
    law : Law or object
        Any law: one of this package, or an object with
        ``update(u, e, disturbance)``.
    tolerance : float or None
        Error up to which the input is kept unchanged; None to keep learning.
    measure : {"rms", "max"}
        Norm of a run's error: the RMS over time of the Euclidean norm of all channels, as in a cell
        description and `tracking_rms_m`; or the largest magnitude of any channel.
    resume : float
        Factor on the tolerance above which learning resumes.
    growth : float
        Factor by which the error may exceed the best one so far; infinite to let
        it grow.
    patience : int
        Number of consecutive runs with such growth before the input of the best run is restored.

    Raises
    ------
    LearningError
        If the tolerance is negative, a ratio below 1 or the patience 0.
    ValueError, TypeError
        If `measure` is not "rms" or "max", or `law` is not a law.

    Notes
    -----
    `state` is "learning", "holding" (within the tolerance) or "rolled_back" (to the best input).
    Learning resumes from "holding" when the error exceeds `resume` times the tolerance, and from
    "rolled_back" when for `patience` runs in a row the error exceeds `growth` times its earlier
    value for the same input.

    References
    ----------
    [filter-based], Section 4 (Fig. 19) and Section 6.3.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import Gate, PdIlc
    >>> law = Gate(PdIlc(kp=1.0, kd=0.0), tolerance=0.1)
    >>> law.update(np.zeros(2), np.full(2, 0.05))
    array([0., 0.])
    >>> law.state
    'holding'
    """

    def __new__(
        cls,
        law: AnyLaw,
        tolerance: float | None = None,
        measure: Literal["rms", "max"] = "rms",
        resume: float = 1.5,
        growth: float = 1.5,
        patience: int = 2,
    ) -> Self:
        return super().__new__(cls, "gate", given(locals()))

    @property
    def state(self) -> Literal["learning", "holding", "rolled_back"]:
        """State of the gate."""
        return self._figure("state")

    @property
    def best_error(self) -> float | None:
        """Error of the best run since learning began or resumed; None before the first."""
        return self._figure("best_error")

    @property
    def best_input(self) -> NDArray[np.float64] | None:
        """Input of the best run, in the shape of `u`; None before the first."""
        return self._figure("best_input")


class Ladder(_Around):
    """Learn from the mean error of several runs with the same input.

    ``u' = u + g (law(u, mean(e)) - u)`` after `repeats` runs, ``u' = u`` between

    Parameters
    ----------
    law : Law or object
        Any law: one of this package, or an object with
        ``update(u, e, disturbance)``.
    repeats : int
        Runs with the same input before each step.
    slow : float
        Ratio of the error to that before the last step above which it decays too
        slowly.
    increase : float
        Factor by which the gain g is then raised; 1 to leave it unchanged.
    lowest, highest : float
        Lowest and highest gain.

    Raises
    ------
    LearningError
        If `repeats` is 0 or a ratio is out of range.
    TypeError
        If `law` is not a law.

    Notes
    -----
    The non-repeatable error falls with the root of `repeats`. The gain is 1 at first; it is halved
    when the repeatable error grew over a step or an input was rolled back, raised when it decayed
    too slowly, and unchanged if the error is less than twice the noise left in the mean. Another
    input starts a new mean.

    References
    ----------
    [filter-based], Section 6.2; the rule for the gain is ours.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import Ladder, PdIlc
    >>> law = Ladder(PdIlc(kp=1.0, kd=0.0), repeats=2)
    >>> law.update(np.zeros(2), np.array([0.0, 1.0]))
    array([0., 0.])
    >>> law.update(np.zeros(2), np.array([0.0, 3.0]))
    array([2., 2.])
    """

    def __new__(
        cls,
        law: AnyLaw,
        repeats: int = 2,
        slow: float = 0.8,
        increase: float = 1.25,
        lowest: float = 0.0625,
        highest: float = 1.5,
    ) -> Self:
        return super().__new__(cls, "ladder", given(locals()))

    @property
    def gain(self) -> float:
        """Gain of the next step."""
        return self._figure("gain")

    @property
    def runs(self) -> int:
        """Number of runs in the mean for the next step."""
        return self._figure("runs")

    @property
    def repeatable_rms(self) -> float | None:
        """RMS of the repeatable error at the last step; None before."""
        return self._figure("repeatable_rms")

    @property
    def noise_rms(self) -> float:
        """RMS of the noise left in the mean at the last step."""
        return self._figure("noise_rms")


class Filtered(_Around):
    """A low-pass (Q-filter) after any law, e.g. after `NormOptimalIlc`.

    ``u' = Q law(u, e)``

    Parameters
    ----------
    law : Law or object
        Any law: one of this package, or an object with
        ``update(u, e, disturbance)``.
    q_filter : Filter, array_like or None
        Low-pass Q of `ilc_rt.signal`, zero-phase unless it is causal.

    Raises
    ------
    SignalError, TypeError
        If `q_filter` is not a filter, or `law` is not a law.

    Notes
    -----
    The filter takes away what lies above the frequency up to which the model of the law holds; a
    part of the error remains there.

    References
    ----------
    [bristow2006].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc
    >>> from ilc_rt.laws import Filtered
    >>> Filtered(PdIlc(1.0, 0.0), [0.25, 0.5, 0.25]).update(np.zeros(4), np.array([0.0, 0, 0, 4]))
    array([0., 1., 3., 4.])
    """

    def __new__(cls, law: AnyLaw, q_filter: QFilter = None) -> Self:
        return super().__new__(cls, "filtered", given(locals()))


class ThroughJacobian(_Around):
    """Learn in joint space from errors at the tool, with any law.

    ``e_joint[k] = pinv(J_k) e_tool[k]``

    Parameters
    ----------
    law : Law or object
        A law of the joints: one of this package, or an object with
        ``update(u, e, disturbance)``.
    jacobian : array_like, shape (n_coordinates, n_joints) or (n_samples, n_coordinates, n_joints)
        Tool motion per joint motion, as returned by `Delta.jacobian`; one matrix for runs of any
        length, or one per sample. Several mechanisms are block-diagonal.

    Raises
    ------
    LearningError
        If a Jacobian is singular: its condition number may be at most 1e6. `update` raises it for
        another number of samples.
    ValueError, TypeError
        If the array has the wrong shape, dtype or a number that is not finite,
        or `law` is not a law.

    Notes
    -----
    `update` takes inputs of shape (n_samples, n_joints) in the unit of the joints, and errors at
    the tool of shape (n_samples, n_coordinates) in m. The inner law receives errors of the joints.
    To weight errors at the tool by Q, give a norm-optimal law of the joints ``q = J.T @ Q @ J``;
    for a constant square J this is the law of the model ``J P``.

    References
    ----------
    [barton2010], Eq. (8.1), (8.5) to (8.7).

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, ThroughJacobian
    >>> law = ThroughJacobian(PdIlc(kp=1.0, kd=0.0, lead_samples=0), [[2.0, 0.0], [0.0, 4.0]])
    >>> law.update(np.zeros((3, 2)), np.ones((3, 2)))[0]
    array([0.5 , 0.25])
    """

    def __new__(cls, law: AnyLaw, jacobian: ArrayLike) -> Self:
        return super().__new__(cls, "through_jacobian", given(locals()))

    @property
    def n_joints(self) -> int:
        """Number of joints: channels of the input."""
        return self._figure("n_joints")

    @property
    def n_coordinates(self) -> int:
        """Number of coordinates of the tool: channels of the error."""
        return self._figure("n_coordinates")
