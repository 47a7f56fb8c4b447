"""Filters: Butterworth low-pass, forward only or forward and backward."""

from ilc_rt._native import ButterworthFilter, butterworth, zero_phase

__all__ = ["ButterworthFilter", "butterworth", "zero_phase"]
