"""Controllers as the loop runs them, tick by tick: PID, cascade, cross-coupled."""

from ilc_rt._native import Cascade, CrossCoupled, Pid

__all__ = ["Cascade", "CrossCoupled", "Pid"]
