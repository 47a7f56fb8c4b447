"""Trajectories and the geometry of contours."""

from ilc_rt._native import (
    Arc,
    ContourError,
    Line,
    contour_error,
    coupling_gains,
    projection_across,
)

__all__ = [
    "Arc",
    "ContourError",
    "Line",
    "contour_error",
    "coupling_gains",
    "projection_across",
]
