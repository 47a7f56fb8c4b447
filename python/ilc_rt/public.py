"""Every public name of the package, which `ilc_rt` has without importing it before it is needed.

No other module of the package may import it.
"""

from ilc_rt import control, identify, kinematics, laws, signal, trajectory, weights
from ilc_rt._native import (
    Cell,
    LearningError,
    ModelError,
    SignalError,
    StateSpace,
    TimeVarying,
    TrajectoryError,
    __version__,
)
from ilc_rt.analysis import Analysis, Repeatability, Tuning, analyze, repeatability, tune
from ilc_rt.ask_tell import Experiment
from ilc_rt.campaign import Campaign, Law
from ilc_rt.compared import Compared, compare
from ilc_rt.errors import BadInputError, CampaignError, FaultError, PlantError, SweepError
from ilc_rt.laws import *  # noqa: F403
from ilc_rt.library import Library
from ilc_rt.many import simulate_many
from ilc_rt.many_result import ManyResult
from ilc_rt.models import discretize, from_transfer_function, second_order
from ilc_rt.read_only import ReadOnlyLibrary
from ilc_rt.recommendation import Recommendation, recommend
from ilc_rt.record import IterationRecord
from ilc_rt.result import CampaignResult
from ilc_rt.simulated_tuning import SimulatedTuning, tune_by_simulation
from ilc_rt.simulation import simulate
from ilc_rt.sweep_result import SweepResult
from ilc_rt.sweeping import grid, latin_hypercube, sweep
from ilc_rt.trial_result import TrialResult

__all__ = [
    "Analysis",
    "BadInputError",
    "Campaign",
    "CampaignError",
    "CampaignResult",
    "Cell",
    "Compared",
    "Experiment",
    "FaultError",
    "IterationRecord",
    "Law",
    "LearningError",
    "Library",
    "ManyResult",
    "ModelError",
    "PlantError",
    "ReadOnlyLibrary",
    "Recommendation",
    "Repeatability",
    "SignalError",
    "SimulatedTuning",
    "StateSpace",
    "SweepError",
    "SweepResult",
    "TimeVarying",
    "TrajectoryError",
    "TrialResult",
    "Tuning",
    "__version__",
    "analyze",
    "compare",
    "control",
    "discretize",
    "from_transfer_function",
    "grid",
    "identify",
    "kinematics",
    "latin_hypercube",
    "laws",
    "recommend",
    "repeatability",
    "second_order",
    "signal",
    "simulate",
    "simulate_many",
    "sweep",
    "trajectory",
    "tune",
    "tune_by_simulation",
    "weights",
]
__all__ += laws.__all__
