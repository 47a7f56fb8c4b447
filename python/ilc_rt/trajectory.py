"""Trajectories that hold the limits of every axis, and the geometry of contours."""

from ilc_rt._native import (
    Arc,
    ContourError,
    Line,
    Trajectory,
    butterfly,
    contour_error,
    coupling_gains,
    exponential_sigmoid,
    gcode,
    jerk_limited,
    modulated,
    projection_across,
    raster,
    spiral,
    spline,
    tracking_index,
)

__all__ = [
    "Arc",
    "ContourError",
    "Line",
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
    "spiral",
    "spline",
    "tracking_index",
]
