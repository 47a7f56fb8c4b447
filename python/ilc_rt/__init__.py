"""The motion controller that learns: iterative learning control on the machine."""

from ilc_rt import signal
from ilc_rt._native import (
    Cell,
    FlexibleIlc,
    LearningError,
    Library,
    ModelError,
    NormOptimalIlc,
    PdIlc,
    RelevanceIlc,
    RelevanceWeights,
    SignalError,
    StateSpace,
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
    "FlexibleIlc",
    "IterationRecord",
    "Law",
    "LearningError",
    "Library",
    "ModelError",
    "NormOptimalIlc",
    "PdIlc",
    "RelevanceIlc",
    "RelevanceWeights",
    "SignalError",
    "StateSpace",
    "discretize",
    "from_transfer_function",
    "second_order",
    "signal",
]
