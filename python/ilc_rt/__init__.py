"""The motion controller that learns: iterative learning control on the machine."""

from ilc_rt._native import Cell, Library
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
    "Library",
]
