"""What an identification asks of the controller: which axis, excited how."""

from __future__ import annotations

from dataclasses import dataclass

WAVEFORMS = ("sweep", "linear-sweep", "multisine")


@dataclass(frozen=True, slots=True)
class Experiment:
    """One axis excited around a point while all others hold still.

    Attributes
    ----------
    axis : str
        Name of the axis.
    waveform : {"sweep", "linear-sweep", "multisine"}
        A sine of rising frequency, or all harmonics of the period at once.
    from_hz, to_hz : float
        Band in Hz.
    period_s : float
        Length of a period in seconds.
    periods : int
        Periods that are evaluated.
    amplitude : float or None
        Peak in m (csp) or m/s (csv); half of what the limits allow if None.
    at_m : float or None
        Where the axis is excited; at the program's start if None.

    Examples
    --------
    >>> Experiment("x", "sweep", 1.0, 40.0, 8.0, 3).arguments()[:4]
    ['--axis', 'x', '--waveform', 'sweep']
    """

    axis: str
    waveform: str
    from_hz: float
    to_hz: float
    period_s: float
    periods: int
    amplitude: float | None = None
    at_m: float | None = None

    def arguments(self) -> list[str]:
        """Return the experiment as arguments of ``ilc-rt identify``."""
        arguments = ["--axis", self.axis, "--waveform", self.waveform]
        arguments += ["--from-hz", repr(self.from_hz), "--to-hz", repr(self.to_hz)]
        arguments += ["--period-s", repr(self.period_s), "--periods", str(self.periods)]
        if self.amplitude is not None:
            arguments += ["--amplitude", repr(self.amplitude)]
        if self.at_m is not None:
            arguments += ["--at-m", repr(self.at_m)]
        return arguments
