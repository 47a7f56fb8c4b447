"""Weights of norm-optimal learning along the run and by frequency, by their meaning."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt import _native

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt._native import StateSpace

__all__ = [
    "contour",
    "coupled",
    "formation",
    "formation_errors",
    "high_pass",
    "low_pass",
    "schedule",
]


def contour(
    reference: ArrayLike,
    q: ArrayLike = 1.0,
    contour: ArrayLike = 1.0,
    along: ArrayLike = 0.0,
    axes: Sequence[int] | None = None,
) -> NDArray[np.float64]:
    """Return weights that emphasise the error across the path (contour error).

    ``Q_k = q I + contour (I - t_k t_k') + along t_k t_k'`` with ``t_k`` the unit
    tangent of the reference.

    Parameters
    ----------
    reference : ndarray of float64, shape (n_samples, n_outputs)
        Reference of every output; the axes of the path share one unit.
    q : float or ndarray of shape (n_samples,), (p, p) or (n_samples, p, p)
        Weight of each output individually.
    contour : float or ndarray of shape (n_samples,)
        Weight of the error across the path: to first order the contour error.
    along : float or ndarray of shape (n_samples,)
        Weight of the error along the path.
    axes : sequence of int, optional
        Outputs that form the path; by default all.

    Returns
    -------
    ndarray of float64, shape (n_samples, n_outputs, n_outputs)
        Weight of the error, for the parameter `q` of a law.

    Raises
    ------
    LearningError
        If a weight is negative or inconsistent, the path never moves, or it has fewer than two
        axes.

    Notes
    -----
    Where the reference is at rest its tangent is undefined; the one nearest in time is used. With q
    = along = 0 the error along the path has no weight: give the law an s or r above 0.

    References
    ----------
    [barton2010], Eq. (4.1) to (4.3), (5.9) to (5.11).

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import weights
    >>> line = np.outer(np.linspace(0.0, 0.1, 5), [1.0, 1.0])
    >>> weights.contour(line, q=0.0, contour=2.0)[2].round(12).tolist()
    [[1.0, -1.0], [-1.0, 1.0]]
    """
    return _native.contour_weights(locals())


def coupled(
    coupling: ArrayLike, sigma: ArrayLike = 1.0, gamma: ArrayLike = 0.0
) -> NDArray[np.float64]:
    """Return weights shared between channels and coupled signals.

    ``Q_k = sigma_k (gamma_k I + (1 - gamma_k) C_k' C_k)``

    Parameters
    ----------
    coupling : ndarray of float64, shape (n_samples, c, p)
        Contribution of each of p channels to each of c coupled signals, such as ``[-sin theta, cos
        theta]`` for the contour error.
    sigma : float or ndarray of shape (n_samples,)
        Overall weight.
    gamma : float or ndarray of shape (n_samples,)
        Share of the individual channels, 0 to 1.

    Returns
    -------
    ndarray of float64, shape (n_samples, p, p)
        Weight, for the parameter `q`, `s` or `r` of a law.

    Raises
    ------
    LearningError
        If sigma is negative, gamma is outside 0 to 1, or a length is inconsistent.

    References
    ----------
    [barton2010], Eq. (5.2) to (5.7).

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import weights
    >>> coupling = np.broadcast_to([[-0.6, 0.8]], (3, 1, 2))
    >>> weights.coupled(coupling, sigma=2.0, gamma=0.0)[0].round(12).tolist()
    [[0.72, -0.96], [-0.96, 1.28]]
    """
    return _native.coupled_weights(locals())


def schedule(
    segments: Sequence[tuple[int, float]],
    n_samples: int,
    bandwidth_hz: float | None = None,
    dt_s: float | None = None,
) -> NDArray[np.float64]:
    """Return values that switch smoothly between the parts of a run.

    Each value holds from its start; a Gaussian filter smooths the steps.

    Parameters
    ----------
    segments : sequence of (int, float)
        First sample and value of each part; the first at sample 0.
    n_samples : int
        Samples of a run.
    bandwidth_hz : float, optional
        Frequency in Hz at which the gain of the filter is 1/sqrt(2); by default the values step.
        The rise time from 10 % to 90 % is 0.34 / bandwidth_hz seconds.
    dt_s : float, optional
        Sample time in seconds; required with `bandwidth_hz`.

    Returns
    -------
    ndarray of float64, shape (n_samples,)
        Values, within the range of the given ones.

    Raises
    ------
    LearningError
        If the starts do not increase from 0 within the run, or a value is not finite.
    SignalError
        If the filter cannot be designed or is longer than the run.
    ValueError
        If only one of `bandwidth_hz` and `dt_s` is given.

    References
    ----------
    [barton2010], sections 5.4.2 and 5.4.3, listing H.3.

    Examples
    --------
    >>> from ilc_rt import weights
    >>> weights.schedule([(0, 1.0), (2, 30.0)], 4).tolist()
    [1.0, 1.0, 30.0, 30.0]
    """
    return _native.schedule(locals())


def formation(
    n_agents: int,
    n_axes: int,
    n_samples: int,
    tracking: ArrayLike = 1.0,
    own: ArrayLike = 1.0,
    centre: ArrayLike = 0.0,
    sigma: ArrayLike = 1.0,
    weight: ArrayLike = 1.0,
    leaders: Sequence[int] | None = None,
    pairs: Sequence[tuple[int, int]] | None = None,
    axes: Sequence[int] | None = None,
) -> NDArray[np.float64]:
    """Return weights of several agents that keep a formation.

    ``Q = sigma (tracking (own Q_i + centre K' Q_c K) + (1 - tracking) F' F)``

    Parameters
    ----------
    n_agents, n_axes : int
        Agents, and axes of each; their errors are stacked agent by agent.
    n_samples : int
        Samples of a run.
    tracking : float or array that broadcasts to (n_samples, n_agents)
        Share of tracking; the rest goes to the formation.
    own : float or array that broadcasts to (n_samples, n_agents)
        Share of the agent's own error in its tracking.
    centre : float or array that broadcasts to (n_samples, n_agents)
        Share of the error of the formation's centre in an agent's tracking.
    sigma : float or array that broadcasts to (n_samples, n_agents)
        Overall weight.
    weight : float or ndarray of shape (n_samples,), (d, d) or (n_samples, d, d)
        Weight of the d axes of an agent, and of the centre.
    leaders : sequence of int, optional
        The only agents that track their references; replaces `own`.
    pairs : sequence of (int, int), optional
        Pairs of agents that keep their offset; by default all.
    axes : sequence of int, optional
        Axes of an agent that keep the offset; by default all.

    Returns
    -------
    ndarray of float64, shape (n_samples, n_agents * n_axes, n_agents * n_axes)
        Weight of the errors of all agents, for the parameter `q` of a law.

    Raises
    ------
    LearningError
        If a share is outside 0 to 1, a weight is negative, or an agent or axis does not exist.

    Notes
    -----
    The formation error of agents i and j is ``e_j - e_i``: the wanted offset, from their
    references, minus the actual one. Where coupled agents have different gains, the symmetric part
    of the product is used.

    References
    ----------
    [barton2010], Eq. (6.1) to (6.9), (6.13) to (6.15).

    Examples
    --------
    >>> from ilc_rt import weights
    >>> weights.formation(2, 1, 3, tracking=0.75)[0].tolist()
    [[1.0, -0.25], [-0.25, 1.0]]
    """
    return _native.formation_weights(locals())


def formation_errors(
    e: ArrayLike,
    n_agents: int,
    pairs: Sequence[tuple[int, int]] | None = None,
    axes: Sequence[int] | None = None,
) -> NDArray[np.float64]:
    """Return the formation errors of several agents.

    ``e_j - e_i`` for each axis and each pair of agents, axis by axis.

    Parameters
    ----------
    e : ndarray of float64, shape (n_samples, n_agents * n_axes)
        Errors of all agents, one agent after the other.
    n_agents : int
        Agents.
    pairs : sequence of (int, int), optional
        Pairs of agents; by default all.
    axes : sequence of int, optional
        Axes of an agent; by default all.

    Returns
    -------
    ndarray of float64, shape (n_samples, n_axes * n_pairs)
        Wanted offset less actual one.

    Raises
    ------
    LearningError
        If an agent or axis does not exist.

    References
    ----------
    [barton2010], Eq. (4.4).

    Examples
    --------
    >>> from ilc_rt import weights
    >>> weights.formation_errors([[1.0, 2.0, 4.0, 6.0]], 2).tolist()
    [[3.0, 4.0]]
    """
    return _native.formation_errors(locals())


def high_pass(order: int, cutoff_hz: float, dt_s: float, n_channels: int = 1) -> StateSpace:
    """Return a causal Butterworth high-pass as a model, for weights by frequency.

    Parameters
    ----------
    order : int
        Order, 1 to 12.
    cutoff_hz : float
        Cut-off frequency in Hz, where the gain is 1/sqrt(2).
    dt_s : float
        Sample time in seconds.
    n_channels : int
        Channels, all filtered alike.

    Returns
    -------
    StateSpace
        Filter with n_channels inputs and outputs, for `input_filter` or `change_filter` of
        `NormOptimalIlc.dynamic`.

    Raises
    ------
    SignalError
        If the design fails for this order, cut-off or sample time.
    LearningError
        If n_channels is not 1 to 100.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import weights
    >>> high = weights.high_pass(2, 40.0, 0.002)
    >>> w = 2 * np.pi * np.array([4.0, 40.0, 200.0])
    >>> np.abs(high.frequency_response(w)).reshape(-1).round(3).tolist()
    [0.01, 0.707, 1.0]
    """
    return _native.band_filter({"passes": "high", **locals()})


def low_pass(order: int, cutoff_hz: float, dt_s: float, n_channels: int = 1) -> StateSpace:
    """Return a causal Butterworth low-pass as a model, for weights by frequency.

    Parameters
    ----------
    order : int
        Order, 1 to 12.
    cutoff_hz : float
        Cut-off frequency in Hz, where the gain is 1/sqrt(2).
    dt_s : float
        Sample time in seconds.
    n_channels : int
        Channels, all filtered alike.

    Returns
    -------
    StateSpace
        Filter with n_channels inputs and outputs, for `filter` of `NormOptimalIlc.dynamic`.

    Raises
    ------
    SignalError
        If the design fails for this order, cut-off or sample time.
    LearningError
        If n_channels is not 1 to 100.

    Examples
    --------
    >>> from ilc_rt import weights
    >>> weights.low_pass(3, 40.0, 0.002, n_channels=2)
    StateSpace(n_states=8, n_inputs=2, n_outputs=2, dt_s=0.002)
    """
    return _native.band_filter({"passes": "low", **locals()})
