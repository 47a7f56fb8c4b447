"""Measured frequency responses, their uncertainty, and excitation signals."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt import _native
from ilc_rt.given import given

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["FrequencyResponse", "excitation", "frequency_response", "uncertainty"]


@dataclass(frozen=True, init=False, repr=False, eq=False)
class FrequencyResponse:
    """Measured frequency response, with its coherence.

    Parameters
    ----------
    frequency_hz : array_like, shape (n_frequencies,)
        Frequencies in Hz, increasing.
    response : array_like of complex, shape (n_frequencies,)
        Output over input.
    coherence : array_like or None, shape (n_frequencies,)
        Share of the output power that is coherent with the input, 0 to 1; 1 if None.
    n_averages : float
        Independent averages behind each estimate.

    Raises
    ------
    ValueError
        If the shapes differ or a number is not finite.

    Examples
    --------
    >>> from ilc_rt.identify import FrequencyResponse
    >>> FrequencyResponse([1.0, 2.0], [1.0, 0.5j]).band(1.5, 3.0).frequency_hz
    array([2.])
    """

    frequency_hz: NDArray[np.float64]
    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    n_averages: float

    def __init__(
        self,
        frequency_hz: ArrayLike,
        response: ArrayLike,
        coherence: ArrayLike | None = None,
        n_averages: float = 1.0,
    ) -> None:
        checked = _native.check_response(given(locals()))
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def relative_deviation(self) -> NDArray[np.float64]:
        """Return the relative standard deviation of each estimate.

        ``sqrt((1 - gamma^2) / (2 gamma^2 n))``

        Returns
        -------
        ndarray of float64, shape (n_frequencies,)
            Of the magnitude, and of the phase in rad.

        References
        ----------
        [bendat2010], section 9.2.
        """
        return _native.relative_deviation(vars(self))

    def band(self, from_hz: float, to_hz: float) -> FrequencyResponse:
        """Return the part within a band, both ends included.

        Parameters
        ----------
        from_hz, to_hz : float
            Lowest and highest frequency in Hz.
        """
        inside = (self.frequency_hz >= from_hz) & (self.frequency_hz <= to_hz)
        return FrequencyResponse(
            self.frequency_hz[inside],
            self.response[inside],
            self.coherence[inside],
            self.n_averages,
        )

    def to_control(self) -> Any:  # noqa: ANN401 (python-control is optional)
        """Return the response as an object of python-control.

        Returns
        -------
        control.FrequencyResponseData
            One input, one output; frequencies in rad/s.

        Raises
        ------
        ImportError
            If python-control is not installed.
        """
        return import_module("control").frd(self.response, 2.0 * np.pi * self.frequency_hz)

    @classmethod
    def from_control(cls, data: Any) -> FrequencyResponse:  # noqa: ANN401 (python-control is optional)
        """Return a response of python-control, with coherence 1.

        Parameters
        ----------
        data : control.FrequencyResponseData
            One input, one output.

        Raises
        ------
        ValueError
            If there are several inputs or outputs.
        TypeError
            If it is not such an object.
        """
        omega, values = getattr(data, "omega", None), getattr(data, "frdata", None)
        if omega is None or values is None:
            message = f"data is a {type(data).__name__}; control.FrequencyResponseData is needed"
            raise TypeError(message)
        if np.ndim(values) != 3 or np.shape(values)[:2] != (1, 1):
            message = f"data has shape {np.shape(values)}: one input and one output are needed"
            raise ValueError(message)
        return cls(np.asarray(omega) / (2.0 * np.pi), np.asarray(values)[0, 0])

    def __repr__(self) -> str:
        """Return the number of frequencies and their range."""
        f = self.frequency_hz
        if not f.size:
            return "FrequencyResponse(no frequencies)"
        return f"FrequencyResponse({f.size} frequencies, {f[0]} to {f[-1]} Hz)"


def frequency_response(
    u: ArrayLike,
    y: ArrayLike,
    dt_s: float,
    period_samples: int | None = None,
    segment_samples: int | None = None,
    overlap_samples: int | None = None,
) -> FrequencyResponse:
    """Return the frequency response from input to output, with coherence.

    ``H = S_uy / S_uu``, ``gamma^2 = |S_uy|^2 / (S_uu S_yy)``

    Parameters
    ----------
    u, y : array_like, shape (n_samples,)
        Input and output.
    dt_s : float
        Sample time in seconds.
    period_samples : int or None
        Samples per period of a periodic input: averages over whole periods, without window or
        leakage.
    segment_samples : int or None
        Samples per segment of Welch's method for any other input: Hann window, mean removed; an
        eighth of the signal if neither is given.
    overlap_samples : int or None
        Overlap of the segments in samples; half a segment if None.

    Returns
    -------
    FrequencyResponse
        At the frequencies excited by the input.

    Raises
    ------
    ModelError
        If the lengths differ, a segment does not fit, or the input is zero.

    References
    ----------
    [pintelon2012], section 2.5; [bendat2010], section 6.1.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.identify import frequency_response
    >>> u = np.tile([1.0, -1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 4)
    >>> h = frequency_response(u, 3 * u, 0.1, period_samples=8).response
    >>> np.allclose(h, 3.0)
    True
    """
    found = _native.frequency_response(locals())
    return FrequencyResponse(**found)


def uncertainty(
    measured: FrequencyResponse, model: ArrayLike, deviations: float = 3.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a bound of the multiplicative error of a model from a measured response.

    ``bound(f) = max(|H/G - 1| + z sigma |H/G|)`` over a third of an octave.

    Parameters
    ----------
    measured : FrequencyResponse
        Measured response.
    model : array_like of complex, shape (n_frequencies,)
        Response of the model at the same frequencies.
    deviations : float
        Standard deviations z of the measurement added to the bound.

    Returns
    -------
    frequency_hz : ndarray of float64, shape (n_frequencies,)
    bound : ndarray of float64, shape (n_frequencies,)
        Multiplicative uncertainty, as used by a robust-convergence test.

    Raises
    ------
    ModelError
        If the lengths differ, the model is 0 at a frequency or `deviations` is negative.

    References
    ----------
    [barton2010], section 3.3.

    Examples
    --------
    >>> from ilc_rt.identify import FrequencyResponse, uncertainty
    >>> uncertainty(FrequencyResponse([1.0, 2.0], [1.0, 1.1]), [1.0, 1.0])[1].round(3)
    array([0. , 0.1])
    """
    return _native.uncertainty(_parts(measured) | {"model": model, "deviations": deviations})


def excitation(
    waveform: str,
    amplitude: float,
    from_hz: float,
    to_hz: float,
    period_s: float,
    periods: int,
    dt_s: float,
) -> tuple[NDArray[np.float64], int, int]:
    """Return an excitation that starts and ends at rest.

    Parameters
    ----------
    waveform : {"sweep", "linear-sweep", "multisine"}
        A swept sine (chirp) followed by rest, or a multisine.
    amplitude : float
        Peak, in the unit of the input.
    from_hz, to_hz : float
        Band in Hz, up to 0.45 / dt_s.
    period_s : float
        Length of a period in seconds, at least five cycles of the lowest
        frequency.
    periods : int
        Number of evaluated periods.
    dt_s : float
        Sample time in seconds.

    Returns
    -------
    values : ndarray of float64, shape (n_samples,)
    first_sample : int
        First sample of the first evaluated period.
    period_samples : int
        Samples per period.

    Raises
    ------
    ModelError
        If a value is out of range.
    ValueError
        If `waveform` is unknown.

    References
    ----------
    [schroeder1970]; [pintelon2012], section 5.2.

    Examples
    --------
    >>> from ilc_rt.identify import excitation
    >>> values, first, period = excitation("sweep", 1e-3, 1.0, 40.0, 8.0, 3, 0.001)
    >>> values.shape, first, period
    ((24000,), 0, 8000)
    """
    return _native.excitation(locals())


def _parts(measured: FrequencyResponse) -> dict[str, object]:
    """Return a measured response as a dict."""
    if isinstance(measured, FrequencyResponse):
        return vars(measured)
    line = f"measured = {measured!r:.60}; a FrequencyResponse is needed"
    raise TypeError(line)
