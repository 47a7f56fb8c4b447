"""Weights of norm-optimal learning along the run, from what they mean."""

from ilc_rt._native import contour_weights as contour
from ilc_rt._native import coupled_weights as coupled
from ilc_rt._native import formation_errors, schedule
from ilc_rt._native import formation_weights as formation

__all__ = ["contour", "coupled", "formation", "formation_errors", "schedule"]
