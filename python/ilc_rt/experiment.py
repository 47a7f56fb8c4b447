"""Experiment of an identification: one axis, and its excitation."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from ilc_rt.options import arguments


@dataclass(frozen=True, slots=True)
class Experiment:
    """One axis excited around a point while all others hold still.

    Attributes
    ----------
    axis : str
        Name of the axis.
    waveform : {"sweep", "linear-sweep", "multisine"}
        Swept sine, or multisine with all harmonics of the period.
    from_hz, to_hz : float
        Band in Hz.
    period_s : float
        Length of a period in seconds.
    periods : int
        Evaluated periods.
    amplitude : float or None
        Peak in the unit of the input; half of the largest possible one if None.
    at_m : float or None
        Position that the axis is excited around; the program's start if None.

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
        """Return the experiment as options of ``ilc-rt identify``."""
        return arguments("identify", asdict(self))
