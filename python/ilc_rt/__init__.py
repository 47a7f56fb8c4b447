"""The motion controller that learns: iterative learning control on the machine."""

from ilc_rt import signal
from ilc_rt._native import (
    LearningError,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    SignalError,
    StateSpace,
    discretize,
    from_transfer_function,
    second_order,
)

__all__ = [
    "LearningError",
    "ModelError",
    "NormOptimalIlc",
    "PdIlc",
    "SignalError",
    "StateSpace",
    "discretize",
    "from_transfer_function",
    "second_order",
    "signal",
]
