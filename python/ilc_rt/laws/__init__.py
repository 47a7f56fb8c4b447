"""Learning laws: from one run's error to the next run's input.

Each class documents its equation, its parameters with shapes and units, and its source. All derive
from `Law`, whose `update` is the same for all; a custom law is any object with ``update(u, e,
disturbance=None)``.
"""

from ilc_rt._native import Law as Law
from ilc_rt.laws.around import Filtered, Gate, Ladder, ThroughJacobian
from ilc_rt.laws.basis import PositionHarmonic, position_harmonics
from ilc_rt.laws.basis_functions import BasisFunctions
from ilc_rt.laws.constrained import ConstrainedIlc
from ilc_rt.laws.filtered import ErrorFeedforwardIlc, PdIlc
from ilc_rt.laws.higher_order import HigherOrderIlc
from ilc_rt.laws.model_free import ModelFreeIlc
from ilc_rt.laws.modelled import AdjointIlc, ModelInverseIlc
from ilc_rt.laws.norm_optimal import NormOptimalIlc
from ilc_rt.laws.point_to_point import PointToPointIlc
from ilc_rt.laws.recalled import FlexibleIlc, RelevanceIlc
from ilc_rt.laws.relevance_weights import RelevanceWeights
from ilc_rt.laws.repetitive import RepetitiveIlc
from ilc_rt.laws.stable_inverse import StableInverseIlc

__all__ = [
    "AdjointIlc",
    "BasisFunctions",
    "ConstrainedIlc",
    "ErrorFeedforwardIlc",
    "Filtered",
    "FlexibleIlc",
    "Gate",
    "HigherOrderIlc",
    "Ladder",
    "ModelFreeIlc",
    "ModelInverseIlc",
    "NormOptimalIlc",
    "PdIlc",
    "PointToPointIlc",
    "PositionHarmonic",
    "RelevanceIlc",
    "RelevanceWeights",
    "RepetitiveIlc",
    "StableInverseIlc",
    "ThroughJacobian",
    "position_harmonics",
]
