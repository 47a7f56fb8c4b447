"""Trajectories within the limits of every axis, and the geometry of contours."""

from ilc_rt.trajectory.contour import (
    Arc,
    ContourError,
    Line,
    contour_error,
    coupling_gains,
    projection_across,
)
from ilc_rt.trajectory.curves import butterfly, spiral, spline
from ilc_rt.trajectory.move_plan import MovePlan
from ilc_rt.trajectory.moves import exponential_sigmoid, jerk_limited, modulated, sigmoid_pair
from ilc_rt.trajectory.programs import gcode, raster
from ilc_rt.trajectory.sampled import Trajectory, tracking_index

__all__ = [
    "Arc",
    "ContourError",
    "Line",
    "MovePlan",
    "Trajectory",
    "butterfly",
    "contour_error",
    "coupling_gains",
    "exponential_sigmoid",
    "gcode",
    "jerk_limited",
    "modulated",
    "projection_across",
    "raster",
    "sigmoid_pair",
    "spiral",
    "spline",
    "tracking_index",
]
