"""Result of an identification: response, model, residual, and their Bode plot.

`identify` makes it; the command `ilc identify` prints and writes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ilc_rt.fits import VelocityLoopFit
from ilc_rt.result import json_text, write_text
from ilc_rt.text import label

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ilc_rt.experiment import Experiment
    from ilc_rt.fits import SecondOrderFit
    from ilc_rt.response import FrequencyResponse

    Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Identification:
    """Result of an experiment.

    Attributes
    ----------
    measured : FrequencyResponse
        Response from input to measured output, in the band of the excitation.
    model : SecondOrderFit
        Fitted gain, natural frequency, damping and delay.
    described : SecondOrderFit or VelocityLoopFit
        Model that ``[axis.model]`` can express: unit gain and whole samples of
        delay; the velocity loop alone for a csv axis; any gain if the input is an offset of
        velocity or torque.
    uncertainty : tuple of two arrays
        Frequencies in Hz, and the bound of the residual of `described` at each: ``|H/G - 1|`` plus
        three standard deviations of the measurement.
    u, y : ndarray of float64, shape (n_samples,)
        Input and output of the evaluated periods.
    period_samples : int
        Samples in a period.
    dt_s : float
        Sample time in seconds.
    experiment : Experiment
        The experiment, with the actual amplitude.
    interface : str or None
        Mode of the axis, e.g. csp; None if it is not an axis of a cell.
    doubt : str or None
        Reason not to use the model, if there is one.
    axis_model : str
        The section ``[axis.model]`` with the described model; for a torque also the mass, in
        ``[axis.force]``.
    followed : bool
        False if the output does not follow the input: the figures are then meaningless.
    input_unit : str or None
        Unit of the input: m, m/s, N, rad, rad/s or N m; None if it is not an axis of a cell. The
        output is in m or rad.
    """

    measured: FrequencyResponse
    model: SecondOrderFit
    described: SecondOrderFit | VelocityLoopFit
    uncertainty: tuple[Array, Array]
    u: Array
    y: Array
    period_samples: int
    dt_s: float
    experiment: Experiment
    interface: str | None = None
    doubt: str | None = None
    axis_model: str = ""
    followed: bool = True
    input_unit: str | None = None

    def __repr__(self) -> str:
        """Return the result in one line, without the signals."""
        return (
            f"Identification({self.experiment.waveform!r}, n_frequencies={len(self.frequency_hz)}, "
            f"model={self.model!r}, doubt={self.doubt!r})"
        )

    @property
    def frequency_hz(self) -> Array:
        """Frequencies in Hz, shape (n_frequencies,)."""
        return self.measured.frequency_hz

    @property
    def response(self) -> NDArray[np.complex128]:
        """Measured response, shape (n_frequencies,)."""
        return self.measured.response

    @property
    def coherence(self) -> Array:
        """Coherence of input and output, shape (n_frequencies,)."""
        return self.measured.coherence

    def uncertainty_on_grid(self, count: int = 257) -> Array:
        """Return the bound at equally spaced frequencies from 0 to Nyquist.

        Below the band of the excitation the bound at its lower end is used; above it at least 1, as
        the response is unknown there.

        Parameters
        ----------
        count : int
            Number of frequencies, at least 2.

        Raises
        ------
        ValueError
            For fewer than two frequencies.
        """
        if count < 2:
            message = f"count = {count}: at least 2"
            raise ValueError(message)
        grid_hz = np.linspace(0.0, 0.5 / self.dt_s, count)
        frequency_hz, bound = self.uncertainty
        found = np.interp(grid_hz, frequency_hz, bound)
        return np.where(grid_hz > frequency_hz[-1], np.maximum(found, 1.0), found)

    def section(self) -> str:
        """Return the section ``[axis.model]`` with the described model."""
        return self.axis_model

    def rows(self) -> list[tuple[str, str, str]]:
        """Return name, value and standard deviation of every figure, as text.

        For an axis of a cell the figures are those of ``[axis.model]``.
        """
        free, described = self.model, self.described
        gain = ("gain", f"{free.gain:.5f}", f"{free.gain_deviation:.1e}")
        left = ("left over in %", f"{described.residual_rms * 1e2:.2f}", "")
        if isinstance(described, VelocityLoopFit):
            bandwidth = f"{described.bandwidth_hz:.4f}"
            return [
                gain,
                ("velocity bandwidth in Hz", bandwidth, f"{described.bandwidth_deviation_hz:.1e}"),
                ("delay in ms", f"{described.delay_s * 1e3:.4f}", ""),
                left,
            ]
        if self.interface is None:
            described, left = free, ("left over in %", f"{free.residual_rms * 1e2:.2f}", "")
        delay_deviation = described.delay_deviation_s * 1e3
        return [
            gain,
            (
                "natural frequency in Hz",
                f"{described.natural_frequency_hz:.4f}",
                f"{described.natural_frequency_deviation_hz:.1e}",
            ),
            ("damping", f"{described.damping:.5f}", f"{described.damping_deviation:.1e}"),
            (
                "delay in ms",
                f"{described.delay_s * 1e3:.4f}",
                f"{delay_deviation:.1e}" if delay_deviation else "",
            ),
            left,
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the content of the ``--json`` file."""
        model, bound = self.model, self.uncertainty
        return {
            "axis": self.experiment.axis,
            "waveform": self.experiment.waveform,
            "amplitude": self.experiment.amplitude,
            "input_unit": self.input_unit,
            "dt_s": self.dt_s,
            "periods": self.experiment.periods,
            "frequency_hz": self.frequency_hz.tolist(),
            "response_real": self.response.real.tolist(),
            "response_imag": self.response.imag.tolist(),
            "coherence": self.coherence.tolist(),
            "n_averages": self.measured.n_averages,
            "model": {
                "gain": model.gain,
                "gain_deviation": model.gain_deviation,
                "natural_frequency_hz": model.natural_frequency_hz,
                "natural_frequency_deviation_hz": model.natural_frequency_deviation_hz,
                "damping": model.damping,
                "damping_deviation": model.damping_deviation,
                "delay_s": model.delay_s,
                "delay_deviation_s": model.delay_deviation_s,
                "residual_rms": model.residual_rms,
            },
            "uncertainty": {"frequency_hz": bound[0].tolist(), "bound": bound[1].tolist()},
            "axis_model": None if self.doubt else self.section(),
            "doubt": self.doubt,
        }

    def write_json(self, path: str | Path) -> None:
        """Write the figures to a file.

        Raises
        ------
        BadInputError
            If the file cannot be written.
        """
        write_text(path, json_text(self.to_json()))

    def figure(self) -> Figure:
        """Return the Bode plot of measurement and model."""
        # Imported here, as matplotlib is slow to import.
        from ilc_rt.pictures import bode

        panels = bode(
            {"measured": self.measured, "model": self.described},
            uncertainty=self.uncertainty,
            title=f"axis {label(self.experiment.axis)}" if self.experiment.axis else "",
        )
        return cast("Figure", panels[0].figure)
