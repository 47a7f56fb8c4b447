"""Filters, and the frequency that a signal has at each moment.

Butterworth, Gaussian, symmetric and switched low-passes; each can be applied by
itself or given to a law.
"""

from ilc_rt._native import (
    ButterworthFilter,
    FirFilter,
    GaussianFilter,
    SwitchedFilter,
    butterworth,
    fir,
    gaussian,
    instantaneous_frequency,
    zero_phase,
)

__all__ = [
    "ButterworthFilter",
    "FirFilter",
    "GaussianFilter",
    "SwitchedFilter",
    "butterworth",
    "fir",
    "gaussian",
    "instantaneous_frequency",
    "zero_phase",
]
