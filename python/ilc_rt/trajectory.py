"""Trajectories that hold the limits of every axis."""

from ilc_rt._native import (
    Trajectory,
    butterfly,
    exponential_sigmoid,
    gcode,
    jerk_limited,
    modulated,
    raster,
    spiral,
    spline,
    tracking_index,
)

__all__ = [
    "Trajectory",
    "butterfly",
    "exponential_sigmoid",
    "gcode",
    "jerk_limited",
    "modulated",
    "raster",
    "spiral",
    "spline",
    "tracking_index",
]
