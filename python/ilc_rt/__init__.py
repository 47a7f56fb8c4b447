"""The motion controller that learns: iterative learning control on the machine."""

from ilc_rt import control, kinematics, signal, trajectory
from ilc_rt import signal, weights
from ilc_rt import identify, signal
from ilc_rt._native import (
    AdjointIlc,
    Cell,
    ErrorFeedforwardIlc,
    Gate,
    Ladder,
    FlexibleIlc,
    LearningError,
    Library,
    ModelError,
    ModelInverseIlc,
    NormOptimalIlc,
    PdIlc,
    Repeatability,
    RelevanceIlc,
    RelevanceWeights,
    SignalError,
    StateSpace,
    TimeVarying,
    discretize,
    from_transfer_function,
    repeatability,
    second_order,
)
from ilc_rt.campaign import Campaign, Law
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.record import IterationRecord
from ilc_rt.result import CampaignResult

__all__ = [
    "AdjointIlc",
    "BadInputError",
    "Campaign",
    "CampaignError",
    "CampaignResult",
    "Cell",
    "ErrorFeedforwardIlc",
    "Gate",
    "FlexibleIlc",
    "IterationRecord",
    "Ladder",
    "Law",
    "LearningError",
    "Library",
    "ModelError",
    "ModelInverseIlc",
    "NormOptimalIlc",
    "PdIlc",
    "Repeatability",
    "RelevanceIlc",
    "RelevanceWeights",
    "SignalError",
    "StateSpace",
    "control",
    "TimeVarying",
    "discretize",
    "from_transfer_function",
    "kinematics",
    "repeatability",
    "identify",
    "second_order",
    "signal",
    "trajectory",
    "weights",
]
