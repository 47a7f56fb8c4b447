"""The motion controller that learns: iterative learning control on the machine."""

from ilc_rt import signal
from ilc_rt._native import (
    Cell,
    ConstrainedIlc,
    LearningError,
    Library,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    SignalError,
    StateSpace,
    TimeVarying,
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
    "ConstrainedIlc",
    "IterationRecord",
    "Law",
    "LearningError",
    "Library",
    "ModelError",
    "NormOptimalIlc",
    "PdIlc",
    "SignalError",
    "StateSpace",
    "TimeVarying",
    "discretize",
    "from_transfer_function",
    "second_order",
    "signal",
]
