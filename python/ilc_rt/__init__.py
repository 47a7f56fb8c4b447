"""The motion controller that learns: iterative learning control on the machine."""

from ilc_rt import signal
from ilc_rt._native import (
    Analysis,
    Cell,
    LearningError,
    Library,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    SignalError,
    StateSpace,
    Tuning,
    analyze,
    discretize,
    from_transfer_function,
    second_order,
    tune,
)
from ilc_rt.campaign import Campaign, Law
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.record import IterationRecord
from ilc_rt.result import CampaignResult

__all__ = [
    "Analysis",
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
    "Tuning",
    "analyze",
    "discretize",
    "from_transfer_function",
    "second_order",
    "signal",
    "tune",
]
