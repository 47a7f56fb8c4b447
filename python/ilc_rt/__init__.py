"""The motion controller that learns: iterative learning control on the machine."""

from ilc_rt import signal, trajectory
from ilc_rt._native import (
    Cell,
    LearningError,
    Library,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    SignalError,
    StateSpace,
    TrajectoryError,
    discretize,
    from_transfer_function,
    second_order,
)
from ilc_rt.campaign import Campaign, Law
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.record import IterationRecord
from ilc_rt.result import CampaignResult

__all__ = [
    "BadInputError",
    "Campaign",
    "CampaignError",
    "CampaignResult",
    "Cell",
    "IterationRecord",
    "Law",
    "LearningError",
    "Library",
    "ModelError",
    "NormOptimalIlc",
    "PdIlc",
    "SignalError",
    "StateSpace",
    "TrajectoryError",
    "discretize",
    "from_transfer_function",
    "second_order",
    "signal",
    "trajectory",
]
