"""Filters, and the instantaneous frequency of a signal.

Butterworth, Gaussian, symmetric FIR and switched low-passes; each can be applied to a signal or
passed to a law as its Q-filter. All derive from `Filter`, whose `zero_phase` is common to all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ilc_rt import _native
from ilc_rt._native import Filter
from ilc_rt.given import given

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

__all__ = [
    "ButterworthFilter",
    "Filter",
    "FirFilter",
    "GaussianFilter",
    "SwitchedFilter",
    "butterworth",
    "fir",
    "gaussian",
    "instantaneous_frequency",
    "zero_phase",
]


class _Filter(Filter):
    """Filter whose parameters are attributes."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Return a parameter of the filter."""
        if not name.startswith("_"):
            figures = self._figures()
            if name in figures:
                return figures[name]
        line = f"{type(self).__name__} has no {name}"
        raise AttributeError(line)


class ButterworthFilter(_Filter):
    """Butterworth low-pass filter.

    Parameters
    ----------
    order : int
        Order, 1 to 12.
    cutoff_hz : float
        Cut-off frequency in Hz (gain 1/sqrt(2)) of one pass. `zero_phase` makes two passes: there
        the gain is 1/2.
    dt_s : float
        Sample time in seconds.
    causal : bool
        In a learning law, apply the filter forward only, with lag, instead of forward and backward,
        with zero phase.

    Raises
    ------
    SignalError
        If the design fails for this order, cut-off or sample time.

    Examples
    --------
    >>> from ilc_rt import signal
    >>> signal.ButterworthFilter(2, 50.0, 0.002).sos.shape
    (1, 6)
    """

    order: int
    cutoff_hz: float
    dt_s: float
    causal: bool

    def __new__(cls, order: int, cutoff_hz: float, dt_s: float, causal: bool = False) -> Self:  # noqa: FBT001
        return super().__new__(cls, "butterworth", given(locals()))

    @property
    def sos(self) -> NDArray[np.float64]:
        """Second-order sections, shape (n_sections, 6): b0 b1 b2 1 a1 a2."""
        return self._sos()

    def filter(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the causally filtered signal, from zero initial state.

        Parameters
        ----------
        x : array_like, shape (n_samples,) or (n_samples, n_channels)
            Signal.

        Returns
        -------
        ndarray of float64, same shape
            Filtered signal.
        """
        return self._forward(x)


class GaussianFilter(_Filter):
    """Gaussian low-pass filter, zero-phase and without overshoot.

    ``w[i] = exp(-(i T / sigma)^2 / 2) / sum``, ``sigma = sqrt(ln 2) / (2 pi f)``

    Parameters
    ----------
    bandwidth_hz : float
        Frequency f in Hz at which the gain is 1/sqrt(2).
    dt_s : float
        Sample time T in seconds.

    Attributes
    ----------
    sigma_samples : float
        Standard deviation of the bell in samples.

    Raises
    ------
    SignalError
        If the design fails for this bandwidth or sample time.

    Notes
    -----
    The signal is mirrored at its ends, between two samples. The bell is truncated to 99.99 % of its
    area.

    References
    ----------
    [barton2010], H.3.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import signal
    >>> float(signal.GaussianFilter(15.0, 0.002).zero_phase(np.ones(100))[3].round(12))
    1.0
    """

    bandwidth_hz: float
    dt_s: float
    sigma_samples: float

    def __new__(cls, bandwidth_hz: float, dt_s: float) -> Self:
        return super().__new__(cls, "gaussian", given(locals()))


class FirFilter(_Filter):
    """Symmetric FIR smoother, zero-phase.

    ``y[k] = sum_i h[i] x[k + i - r]``, ``h[i] = h[2 r - i]``

    Parameters
    ----------
    taps : array_like, shape (2 r + 1,)
        Taps h, symmetric.
    repeats : int
        Number of passes combined into one: the taps are convolved with themselves.

    Raises
    ------
    SignalError
        If the number of taps is even, or they are not symmetric.

    Notes
    -----
    The signal is held constant beyond its ends.

    References
    ----------
    [dimarco2016], Eq. (3.2), whose example uses such a filter.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import signal
    >>> signal.FirFilter(np.array([-1, 4, 10, 4, -1]) / 16, repeats=6).taps.shape
    (25,)
    """

    taps: NDArray[np.float64]
    repeats: int

    def __new__(cls, taps: ArrayLike, repeats: int = 1) -> Self:
        return super().__new__(cls, "fir", given(locals()))


class SwitchedFilter(_Filter):
    """Zero-phase low-pass filter with a different cut-off on each segment.

    ``y[k] = sum_i w_i[k] (Q_i x)[k]``, the weights following half a cosine at the transitions

    Parameters
    ----------
    cutoffs_hz : sequence of float
        Cut-off of one pass on each segment, in Hz.
    starts : sequence of int
        First sample of each segment, 0 for the first one.
    dt_s : float
        Sample time in seconds.
    order : int
        Order of one pass, 1 to 12.
    blend : int
        Length of the transition between segments in samples, half of it before the start of the
        later one.

    Raises
    ------
    SignalError
        If the design fails for a cut-off or the order, the segments are not in order, or the
        numbers of starts and cut-offs differ. `zero_phase` raises it if the signal ends before a
        segment starts.

    References
    ----------
    [filter-based], Eq. (12); the cross-fade is ours.

    Examples
    --------
    >>> from ilc_rt import signal
    >>> signal.SwitchedFilter([10.0, 50.0, 10.0], [0, 300, 600], 0.002, blend=50).starts
    [0, 300, 600]
    """

    cutoffs_hz: list[float]
    starts: list[int]
    dt_s: float
    order: int
    blend: int

    def __new__(
        cls,
        cutoffs_hz: Sequence[float],
        starts: Sequence[int],
        dt_s: float,
        order: int = 2,
        blend: int = 0,
    ) -> Self:
        return super().__new__(cls, "switched", given(locals()))

    @classmethod
    def from_signal(
        cls,
        reference: ArrayLike,
        dt_s: float,
        low_hz: float,
        high_hz: float,
        threshold_hz: float,
        order: int = 2,
        window_s: float | None = None,
        margin_s: float | None = None,
        blend_s: float | None = None,
    ) -> Self:
        """Design the filter from the instantaneous frequency of a motion.

        Parameters
        ----------
        reference : array_like, shape (n_samples,) or (n_samples, n_channels)
            The motion; a velocity reveals the fast parts better than a position.
        dt_s : float
            Sample time in seconds.
        low_hz, high_hz : float
            Cut-offs in Hz for slow and for fast motion.
        threshold_hz : float
            Instantaneous frequency in Hz above which the motion is fast.
        order : int
            Order of one pass.
        window_s : float or None
            Averaging window of the frequency, weighted by the squared amplitude; by default one
            period of the threshold.
        margin_s : float or None
            Time before and after a fast part in which the filter is open; by default one period of
            the lower cut-off.
        blend_s : float or None
            Length of a transition; by default one period of the lower cut-off.

        Returns
        -------
        SwitchedFilter
            Filter for runs of the same length; open wherever any channel is fast.

        Raises
        ------
        SignalError
            If a frequency or time is out of range.

        References
        ----------
        [filter-based], Section 5.
        """
        return super().__new__(cls, "from_signal", given(locals()))


def butterworth(
    order: int,
    cutoff_hz: float,
    dt_s: float,
    causal: bool = False,  # noqa: FBT001
) -> ButterworthFilter:
    """Return a Butterworth low-pass filter, as `ButterworthFilter` describes it.

    Examples
    --------
    >>> from ilc_rt import signal
    >>> signal.butterworth(2, 50.0, 0.002)
    ButterworthFilter(order=2, cutoff_hz=50.0, dt_s=0.002, causal=False)
    """
    return ButterworthFilter(order, cutoff_hz, dt_s, causal)


def gaussian(bandwidth_hz: float, dt_s: float) -> GaussianFilter:
    """Return a Gaussian low-pass filter, as `GaussianFilter` describes it.

    Examples
    --------
    >>> from ilc_rt import signal
    >>> signal.gaussian(15.0, 0.002)
    GaussianFilter(bandwidth_hz=15.0, dt_s=0.002)
    """
    return GaussianFilter(bandwidth_hz, dt_s)


def fir(taps: ArrayLike, repeats: int = 1) -> FirFilter:
    """Return a symmetric FIR smoother, as `FirFilter` describes it.

    Examples
    --------
    >>> from ilc_rt import signal
    >>> signal.fir([0.25, 0.5, 0.25])
    FirFilter(taps=[0.25, 0.5, 0.25], repeats=1)
    """
    return FirFilter(taps, repeats)


def instantaneous_frequency(x: ArrayLike, dt_s: float) -> NDArray[np.float64]:
    """Return the instantaneous frequency of a signal at each sample.

    ``f[k] = wrap(arg a[k+1] - arg a[k]) / (2 pi T)``, a the analytic signal

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Signal that oscillates about zero.
    dt_s : float
        Sample time T in seconds.

    Returns
    -------
    ndarray of float64, shape (n_samples - 1,)
        Frequency in Hz. At small amplitudes it is noise and may be negative.

    Raises
    ------
    SignalError
        If there are fewer than two samples or the sample time is not positive.

    References
    ----------
    [filter-based], Section 5; [oppenheim2009], Ch. 12.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import signal
    >>> x = np.sin(2 * np.pi * 8.0 * 0.002 * np.arange(500))
    >>> float(signal.instantaneous_frequency(x, 0.002)[100].round(9))
    8.0
    """
    return _native.instantaneous_frequency(locals())


def zero_phase(filter: Filter | ArrayLike, x: ArrayLike) -> NDArray[np.float64]:
    """Return the zero-phase filtered signal.

    Parameters
    ----------
    filter : Filter or array_like
        Filter; an array holds the taps of a symmetric FIR filter. A Butterworth filter is applied
        forward and backward, even one that laws apply forward only.
    x : array_like, shape (n_samples,) or (n_samples, n_channels)
        Signal.

    Returns
    -------
    ndarray of float64, same shape
        Filtered signal.

    Raises
    ------
    SignalError
        If the signal is too short for the filter.
    ValueError, TypeError
        If `x` has the wrong shape, dtype or a number that is not finite, or
        `filter` is not a filter.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import signal
    >>> smooth = signal.zero_phase(signal.butterworth(2, 50.0, 0.002), np.ones(100))
    >>> bool(np.allclose(smooth, 1.0))
    True
    """
    return _native.zero_phase(filter, x)
