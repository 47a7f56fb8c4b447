"""The figures of a run. Derived from the source of the controller: do not edit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Figures of one run; lengths in metres, angles in radians.

    A figure over several axes is over the linear ones, or in radians over all of a
    cell whose axes are all rotary.

    Attributes
    ----------
    tracking_inf_m : float
        Largest absolute tracking error of any axis, in the measurement learned from.
    tracking_rms_m : float
        RMS over time of the Euclidean norm of the tracking error.
    contour_inf_m : float | None
        Largest contour error: distance of the tool from the reference path; absent if
        the path has no contour.
    contour_rms_m : float | None
        RMS of the contour error.
    axes_tracking_inf_m : tuple[float, ...]
        Largest absolute tracking error of each axis, in its own unit.
    axes_tracking_rms_m : tuple[float, ...]
        RMS tracking error of each axis, in its own unit.
    encoder_tracking_inf_m : float
        Largest absolute tracking error of any axis at the encoders.
    tool_tracking_inf_m : float | None
        Largest absolute tracking error of any axis at the tool; absent without such a
        measurement.
    overruns : int
        Servo cycles that began at least a whole cycle late.
    scaled_cycles : int
        Servo cycles at another feed than 100 %, e.g. in a pause: nothing is learned
        from such a run.
    missing_samples : int
        Samples whose measurement never arrived; the last known one stands in for them.
    late_updates : int
        Runs so far that repeated the old input because the learning update was late.
    update_ms : float
        Computing time of the learning update for this run's input; 0 without one.
    phase : str | None
        Purpose of a run that only measures, probing or searching, so that its error
        does not count; absent for one that is learned from.
    frozen_ratio : float | None
        Error over that of the run a frozen input was taken from; absent when learning.
    rolled_back : bool
        True if the best input was restored after this run (rollback), as the error had
        grown.
    learning_off : bool
        True if nothing was learned from this run and learning is off, as the error had
        grown.
    remark : str | None
        Reason of the decision on the next input, unless the law alone decided; one
        sentence.
    """

    tracking_inf_m: float
    tracking_rms_m: float
    contour_inf_m: float | None = None
    contour_rms_m: float | None = None
    axes_tracking_inf_m: tuple[float, ...] = ()
    axes_tracking_rms_m: tuple[float, ...] = ()
    encoder_tracking_inf_m: float = 0.0
    tool_tracking_inf_m: float | None = None
    overruns: int = 0
    scaled_cycles: int = 0
    missing_samples: int = 0
    late_updates: int = 0
    update_ms: float = 0.0
    phase: str | None = None
    frozen_ratio: float | None = None
    rolled_back: bool = False
    learning_off: bool = False
    remark: str | None = None
