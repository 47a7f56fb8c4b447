import builtins
from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from typing import Any, Literal, Protocol, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "AdjointIlc",
    "Analysis",
    "Arc",
    "ButterworthFilter",
    "Cascade",
    "Cell",
    "ConstrainedIlc",
    "ContourError",
    "CrossCoupled",
    "Delta",
    "ErrorFeedforwardIlc",
    "EventStream",
    "FirFilter",
    "FlexibleIlc",
    "FrequencyResponse",
    "Gantry",
    "Gate",
    "GaussianFilter",
    "KinematicsError",
    "Ladder",
    "LearningError",
    "Library",
    "Line",
    "ModelError",
    "ModelInverseIlc",
    "NormOptimalIlc",
    "PdIlc",
    "Pid",
    "RationalFit",
    "RelevanceIlc",
    "RelevanceWeights",
    "Repeatability",
    "SecondOrderFit",
    "SignalError",
    "StateSpace",
    "SwitchedFilter",
    "ThroughJacobian",
    "TimeVarying",
    "Trajectory",
    "TrajectoryError",
    "Tuning",
    "VelocityLoopFit",
    "__version__",
    "_made",
    "_rational_fit",
    "_second_order_fit",
    "_trajectory",
    "_velocity_loop_fit",
    "analyze",
    "butterfly",
    "butterworth",
    "check_options",
    "contour_error",
    "contour_weights",
    "coupled_weights",
    "coupling_gains",
    "described_options",
    "discretize",
    "evaluate_experiment",
    "excitation",
    "exponential_sigmoid",
    "fir",
    "fit_rational",
    "fit_second_order",
    "fit_velocity_loop",
    "formation_errors",
    "formation_weights",
    "frequency_response",
    "from_transfer_function",
    "gaussian",
    "gcode",
    "identify_axis",
    "instantaneous_frequency",
    "jerk_limited",
    "modulated",
    "projection_across",
    "raster",
    "refuse_divergent",
    "repeatability",
    "run_events",
    "schedule",
    "second_order",
    "sigmoid_pair",
    "single_experiment",
    "spiral",
    "spline",
    "tracking_index",
    "tune",
    "uncertainty",
    "zero_phase",
]

__version__: str

# Docstrings are those of the compiled classes: help(ilc_rt.StateSpace).

class _ForeignModel(Protocol):
    """A model of scipy.signal or python-control."""

    @property
    def dt(self) -> object: ...

class ModelError(ValueError): ...
class SignalError(ValueError): ...
class LearningError(ValueError): ...
class KinematicsError(ValueError): ...
class ContourError(ValueError): ...

@final
class StateSpace:
    def __new__(
        cls,
        a: ArrayLike,
        b: ArrayLike,
        c: ArrayLike,
        d: ArrayLike,
        dt_s: float | None = None,
    ) -> StateSpace: ...
    @property
    def a(self) -> NDArray[np.float64]: ...
    @property
    def b(self) -> NDArray[np.float64]: ...
    @property
    def c(self) -> NDArray[np.float64]: ...
    @property
    def d(self) -> NDArray[np.float64]: ...
    @property
    def dt_s(self) -> float | None: ...
    @property
    def n_states(self) -> int: ...
    @property
    def n_inputs(self) -> int: ...
    @property
    def n_outputs(self) -> int: ...
    def simulate(self, u: ArrayLike, x0: ArrayLike | None = None) -> NDArray[np.float64]: ...
    def markov(self, n: int) -> NDArray[np.float64]: ...
    def lifted(self, n: int) -> NDArray[np.float64]: ...
    def poles(self) -> NDArray[np.complex128]: ...
    def feedback(self, controller: StateSpace | _ForeignModel) -> StateSpace: ...
    def series(self, next: StateSpace | _ForeignModel) -> StateSpace: ...
    def append(self, other: StateSpace | _ForeignModel) -> StateSpace: ...
    def delayed(self, n_samples: int) -> StateSpace: ...
    def zeros(self) -> NDArray[np.complex128]: ...
    def dc_gain(self) -> NDArray[np.float64]: ...
    def frequency_response(self, w_rad_s: ArrayLike) -> NDArray[np.complex128]: ...
    def bode(
        self, w_rad_s: ArrayLike, output: int = 0, input: int = 0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def sensitivity(self, controller: StateSpace | _ForeignModel) -> StateSpace: ...
    def complementary_sensitivity(self, controller: StateSpace | _ForeignModel) -> StateSpace: ...
    def process_sensitivity(self, controller: StateSpace | _ForeignModel) -> StateSpace: ...
    def relative_degrees(self) -> list[int | None]: ...
    def delays(self) -> list[list[int | None]]: ...
    def minimal(self) -> StateSpace: ...
    def to_scipy(self) -> Any: ...  # noqa: ANN401
    def to_control(self) -> Any: ...  # noqa: ANN401

@final
class TimeVarying:
    def __new__(
        cls,
        a: ArrayLike,
        b: ArrayLike,
        c: ArrayLike,
        d: ArrayLike,
        dt_s: float,
    ) -> TimeVarying: ...
    @property
    def a(self) -> NDArray[np.float64]: ...
    @property
    def b(self) -> NDArray[np.float64]: ...
    @property
    def c(self) -> NDArray[np.float64]: ...
    @property
    def d(self) -> NDArray[np.float64]: ...
    @property
    def dt_s(self) -> float | None: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def n_states(self) -> int: ...
    @property
    def n_inputs(self) -> int: ...
    @property
    def n_outputs(self) -> int: ...
    def simulate(self, u: ArrayLike, x0: ArrayLike | None = None) -> NDArray[np.float64]: ...

def from_transfer_function(
    num: ArrayLike, den: ArrayLike, dt_s: float | None = None
) -> StateSpace: ...
def second_order(natural_frequency_rad_s: float, damping: float) -> StateSpace: ...
def discretize(
    model: StateSpace | _ForeignModel, dt_s: float, method: Literal["zoh", "tustin"] = "zoh"
) -> StateSpace: ...

@final
class FrequencyResponse:
    def __new__(
        cls,
        frequency_hz: ArrayLike,
        response: ArrayLike,
        coherence: ArrayLike | None = None,
        n_averages: float = 1.0,
    ) -> FrequencyResponse: ...
    @property
    def frequency_hz(self) -> NDArray[np.float64]: ...
    @property
    def response(self) -> NDArray[np.complex128]: ...
    @property
    def coherence(self) -> NDArray[np.float64]: ...
    @property
    def n_averages(self) -> float: ...
    def relative_deviation(self) -> NDArray[np.float64]: ...
    def band(self, from_hz: float, to_hz: float) -> FrequencyResponse: ...

@final
class SecondOrderFit:
    @property
    def gain(self) -> float: ...
    @property
    def natural_frequency_hz(self) -> float: ...
    @property
    def damping(self) -> float: ...
    @property
    def delay_s(self) -> float: ...
    @property
    def delay_samples(self) -> int: ...
    @property
    def dt_s(self) -> float | None: ...
    @property
    def gain_deviation(self) -> float: ...
    @property
    def natural_frequency_deviation_hz(self) -> float: ...
    @property
    def damping_deviation(self) -> float: ...
    @property
    def delay_deviation_s(self) -> float: ...
    @property
    def residual_rms(self) -> float: ...
    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]: ...
    def state_space(self) -> StateSpace: ...

@final
class VelocityLoopFit:
    @property
    def gain(self) -> float: ...
    @property
    def bandwidth_hz(self) -> float: ...
    @property
    def delay_s(self) -> float: ...
    @property
    def delay_samples(self) -> int: ...
    @property
    def gain_deviation(self) -> float: ...
    @property
    def bandwidth_deviation_hz(self) -> float: ...
    @property
    def delay_deviation_s(self) -> float: ...
    @property
    def residual_rms(self) -> float: ...
    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]: ...

@final
class RationalFit:
    @property
    def model(self) -> StateSpace: ...
    @property
    def delay_s(self) -> float: ...
    @property
    def reflected_poles(self) -> int: ...
    @property
    def residual_rms(self) -> float: ...
    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]: ...

def frequency_response(
    u: ArrayLike,
    y: ArrayLike,
    dt_s: float,
    period_samples: int | None = None,
    segment_samples: int | None = None,
    overlap_samples: int | None = None,
) -> FrequencyResponse: ...
def fit_second_order(
    frequency_hz: ArrayLike,
    response: ArrayLike,
    coherence: ArrayLike | None = None,
    n_averages: float = 2.0,
    dt_s: float | None = None,
    gain: float | None = None,
    delay_s: float | None = None,
) -> SecondOrderFit: ...
def fit_velocity_loop(
    frequency_hz: ArrayLike,
    response: ArrayLike,
    position_gain_per_s: float,
    dt_s: float,
    coherence: ArrayLike | None = None,
    n_averages: float = 2.0,
    delay_s: float | None = None,
) -> VelocityLoopFit: ...
def fit_rational(
    frequency_hz: ArrayLike,
    response: ArrayLike,
    n_zeros: int,
    n_poles: int,
    coherence: ArrayLike | None = None,
    n_averages: float = 2.0,
    delay_s: float = 0.0,
    dt_s: float | None = None,
) -> RationalFit: ...
def identify_axis(
    cell: Cell,
    arguments: list[str],
    excite: Callable[[dict[str, Any]], tuple[ArrayLike, ArrayLike]],
    report: Callable[[str], object],
) -> dict[str, Any]: ...
def single_experiment(arguments: list[str]) -> dict[str, Any]: ...
def evaluate_experiment(
    u: ArrayLike, y: ArrayLike, period_samples: int, from_hz: float, to_hz: float, dt_s: float
) -> dict[str, Any]: ...
def uncertainty(
    measured: FrequencyResponse, model: ArrayLike, deviations: float = 3.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def excitation(
    waveform: str,
    amplitude: float,
    from_hz: float,
    to_hz: float,
    period_s: float,
    periods: int,
    dt_s: float,
) -> tuple[NDArray[np.float64], int, int]: ...

@final
class ButterworthFilter:
    def __new__(
        cls, order: int, cutoff_hz: float, dt_s: float, causal: bool = False
    ) -> ButterworthFilter: ...
    @property
    def order(self) -> int: ...
    @property
    def cutoff_hz(self) -> float: ...
    @property
    def dt_s(self) -> float: ...
    @property
    def causal(self) -> bool: ...
    @property
    def sos(self) -> NDArray[np.float64]: ...
    def filter(self, x: ArrayLike) -> NDArray[np.float64]: ...
    def zero_phase(self, x: ArrayLike) -> NDArray[np.float64]: ...

def butterworth(
    order: int, cutoff_hz: float, dt_s: float, causal: bool = False
) -> ButterworthFilter: ...

@final
class GaussianFilter:
    def __new__(cls, bandwidth_hz: float, dt_s: float) -> GaussianFilter: ...
    @property
    def bandwidth_hz(self) -> float: ...
    @property
    def dt_s(self) -> float: ...
    @property
    def sigma_samples(self) -> float: ...
    def zero_phase(self, x: ArrayLike) -> NDArray[np.float64]: ...

def gaussian(bandwidth_hz: float, dt_s: float) -> GaussianFilter: ...

@final
class FirFilter:
    def __new__(cls, taps: ArrayLike, repeats: int = 1) -> FirFilter: ...
    @property
    def taps(self) -> NDArray[np.float64]: ...
    def zero_phase(self, x: ArrayLike) -> NDArray[np.float64]: ...

def fir(taps: ArrayLike, repeats: int = 1) -> FirFilter: ...

@final
class SwitchedFilter:
    def __new__(
        cls,
        cutoffs_hz: Sequence[float],
        starts: Sequence[int],
        dt_s: float,
        order: int = 2,
        blend: int = 0,
    ) -> SwitchedFilter: ...
    @staticmethod
    def from_signal(
        reference: ArrayLike,
        dt_s: float,
        low_hz: float,
        high_hz: float,
        threshold_hz: float,
        order: int = 2,
        window_s: float | None = None,
        margin_s: float | None = None,
        blend_s: float | None = None,
    ) -> SwitchedFilter: ...
    @property
    def cutoffs_hz(self) -> list[float]: ...
    @property
    def starts(self) -> list[int]: ...
    @property
    def order(self) -> int: ...
    @property
    def blend(self) -> int: ...
    @property
    def dt_s(self) -> float: ...
    def zero_phase(self, x: ArrayLike) -> NDArray[np.float64]: ...

_Filter: TypeAlias = ButterworthFilter | GaussianFilter | SwitchedFilter | FirFilter | ArrayLike

def zero_phase(filter: _Filter, x: ArrayLike) -> NDArray[np.float64]: ...
def instantaneous_frequency(x: ArrayLike, dt_s: float) -> NDArray[np.float64]: ...

class TrajectoryError(ValueError): ...

@final
class Trajectory:
    @property
    def dt_s(self) -> float: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def n_axes(self) -> int: ...
    @property
    def computing_s(self) -> float: ...
    @property
    def t_s(self) -> NDArray[np.float64]: ...
    @property
    def position_m(self) -> NDArray[np.float64]: ...
    @property
    def velocity_m_s(self) -> NDArray[np.float64]: ...
    @property
    def acceleration_m_s2(self) -> NDArray[np.float64]: ...
    @property
    def programmed_m(self) -> NDArray[np.float64]: ...
    @property
    def alphas(self) -> list[tuple[int, str, float, list[tuple[float, float]]]]: ...

def jerk_limited(
    points_m: ArrayLike,
    *,
    feed_m_s: float | ArrayLike,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    setting: str = "complete",
) -> Trajectory: ...
def exponential_sigmoid(
    points_m: ArrayLike,
    *,
    feed_m_s: float | ArrayLike,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    amplitude_m: float | ArrayLike | None = None,
    frequency_hz: float | ArrayLike | None = None,
    alpha_max: float | dict[str, float] | None = None,
) -> Trajectory: ...
def sigmoid_pair(
    *,
    velocity_m_s: ArrayLike,
    amplitude_m: ArrayLike,
    omega_rad_s: ArrayLike,
    phase_zero_s: ArrayLike,
    corner_s: float,
    duration_s: float,
    start_alpha: float,
    transition_alpha: float,
    sine_alpha: float,
    sine_offset_s: float,
    dt_s: float,
) -> Trajectory: ...
def modulated(
    points_m: ArrayLike,
    *,
    feed_m_s: float,
    amplitude_m: float,
    frequency_hz: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    interpolation: str = "exponential_sigmoid",
) -> Trajectory: ...
def spline(
    points_m: ArrayLike,
    *,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    curvature_acceleration_max_m_s2: float = ...,
) -> Trajectory: ...
def butterfly(
    *,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    feed_m_s: float = 0.004,
    curvature_acceleration_max_m_s2: float = 0.02,
    scale_m: float = 0.00185,
    turns: float = 1.0,
    center_m: tuple[float, float] = ...,
) -> Trajectory: ...
def spiral(
    *,
    pitch_m: float,
    turns: float,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    curvature_acceleration_max_m_s2: float = ...,
    center_m: tuple[float, float] = ...,
) -> Trajectory: ...
def raster(
    *,
    width_m: float,
    pitch_m: float,
    rows: int,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    start_m: tuple[float, float] = ...,
    there_and_back: bool = False,
    setting: str = "complete",
) -> Trajectory: ...
def gcode(
    text: str | bytes,
    *,
    start_m: ArrayLike,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    rapid_m_s: float | None = None,
    blend_s: float | None = None,
    block_delete: bool = False,
) -> Trajectory: ...
def tracking_index(
    trajectory: Trajectory, k_e: float = 600.0, k_a: float = 1.0
) -> tuple[float, float]: ...

@final
class PdIlc:
    def __new__(
        cls,
        kp: float,
        kd: float,
        q_filter: _Filter | None = None,
        lead: int = 1,
    ) -> PdIlc: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

@final
class ErrorFeedforwardIlc:
    def __new__(
        cls,
        gain: float,
        filter: _Filter | None = None,
        lead: int = 1,
        limit: float | None = None,
    ) -> ErrorFeedforwardIlc: ...
    @property
    def n_limited(self) -> int: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

@final
class AdjointIlc:
    def __new__(
        cls,
        model: StateSpace | _ForeignModel,
        n_samples: int,
        gain: float | None = None,
        q_filter: _Filter | None = None,
    ) -> AdjointIlc: ...
    @property
    def gain(self) -> float: ...
    @property
    def gain_limit(self) -> float: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

class _Law(Protocol):
    """Anything that learns."""

    def update(
        self,
        u: NDArray[np.float64],
        e: NDArray[np.float64],
        disturbance: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]: ...

@final
class RelevanceWeights:
    def __new__(
        cls,
        e: float = 10.0,
        er: float = 2.0,
        d: ArrayLike | None = None,
        epsilon: float = 1.0,
        rate_filter_s: float = 0.1,
        error_gain: float = 1.0,
        input_gain: float = 1.0,
    ) -> RelevanceWeights: ...
    @property
    def e(self) -> float: ...
    @property
    def er(self) -> float: ...
    @property
    def d(self) -> NDArray[np.float64]: ...
    @property
    def epsilon(self) -> float: ...
    @property
    def rate_filter_s(self) -> float: ...
    @property
    def error_gain(self) -> float: ...
    @property
    def input_gain(self) -> float: ...

@final
class RelevanceIlc:
    def __new__(
        cls,
        library: Library | None,
        core: _Law,
        weights: RelevanceWeights | tuple[float, float, ArrayLike],
        top: int | None = None,
        *,
        dt_s: float | None = None,
        cell: str | None = None,
    ) -> RelevanceIlc: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]: ...
    def expect(self, disturbance: ArrayLike) -> None: ...
    def remember(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> None: ...
    def relevant(
        self, disturbance: ArrayLike | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]: ...
    def trim(self, keep: int, disturbances: ArrayLike | None = None) -> NDArray[np.int64]: ...
    def reset(self) -> None: ...
    def __len__(self) -> int: ...

@final
class FlexibleIlc:
    def __new__(
        cls,
        library: Library | None,
        core: _Law,
        tolerance: float = 0.0,
        *,
        cell: str | None = None,
    ) -> FlexibleIlc: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]: ...
    def expect(self, disturbance: ArrayLike) -> None: ...
    def remember(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> None: ...
    def reset(self) -> None: ...
    def __len__(self) -> int: ...

@final
class ModelInverseIlc:
    def __new__(
        cls,
        model: StateSpace | _ForeignModel,
        n_samples: int,
        gain: float = 1.0,
        q_filter: _Filter | None = None,
    ) -> ModelInverseIlc: ...
    @property
    def gain(self) -> float: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

@final
class Gate:
    def __new__(
        cls,
        law: _Law,
        tolerance: float | None = None,
        measure: Literal["rms", "max"] = "rms",
        resume: float = 1.5,
        growth: float = 1.5,
        patience: int = 2,
    ) -> Gate: ...
    @property
    def law(self) -> _Law: ...
    @property
    def state(self) -> Literal["learning", "holding", "rolled_back"]: ...
    @property
    def best_error(self) -> float | None: ...
    @property
    def best_input(self) -> NDArray[np.float64] | None: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def taken_back(self) -> None: ...
    def reset(self) -> None: ...

@final
class Ladder:
    def __new__(
        cls,
        law: _Law,
        repeats: int,
        slow: float = 0.8,
        increase: float = 1.25,
        lowest: float = 0.0625,
        highest: float = 1.5,
    ) -> Ladder: ...
    @property
    def law(self) -> _Law: ...
    @property
    def gain(self) -> float: ...
    @property
    def runs(self) -> int: ...
    @property
    def repeatable_rms(self) -> float | None: ...
    @property
    def noise_rms(self) -> float: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def taken_back(self) -> None: ...
    def reset(self) -> None: ...

@final
class ThroughJacobian:
    def __new__(cls, law: _Law, jacobian: ArrayLike) -> ThroughJacobian: ...
    @property
    def law(self) -> _Law: ...
    @property
    def n_joints(self) -> int: ...
    @property
    def n_coordinates(self) -> int: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

@final
class Repeatability:
    @property
    def mean(self) -> NDArray[np.float64]: ...
    @property
    def spread(self) -> NDArray[np.float64]: ...
    @property
    def mean_rms(self) -> float: ...
    @property
    def spread_rms(self) -> float: ...
    @property
    def ratio(self) -> float: ...
    @property
    def learnable(self) -> float: ...
    @property
    def least_rms(self) -> float: ...
    @property
    def largest_rms(self) -> float: ...

def repeatability(errors: ArrayLike) -> Repeatability: ...

@final
class NormOptimalIlc:
    def __new__(
        cls,
        model: StateSpace | TimeVarying | _ForeignModel,
        n_samples: int,
        q: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
    ) -> NormOptimalIlc: ...
    @staticmethod
    def contour(
        model: StateSpace | TimeVarying | _ForeignModel,
        reference: ArrayLike,
        q: ArrayLike = 1.0,
        contour: ArrayLike = 1.0,
        along: ArrayLike = 0.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
        axes: Sequence[int] | None = None,
    ) -> NormOptimalIlc: ...
    @staticmethod
    def formation(
        models: Sequence[StateSpace | _ForeignModel],
        n_samples: int,
        tracking: ArrayLike = 1.0,
        own: ArrayLike = 1.0,
        centre: ArrayLike = 0.0,
        sigma: ArrayLike = 1.0,
        weight: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
        leaders: Sequence[int] | None = None,
        pairs: Sequence[tuple[int, int]] | None = None,
        axes: Sequence[int] | None = None,
    ) -> NormOptimalIlc: ...
    @staticmethod
    def dynamic(
        model: StateSpace | TimeVarying | _ForeignModel,
        n_samples: int,
        filter: StateSpace | _ForeignModel,
        q: ArrayLike = 1.0,
        plain: ArrayLike | None = None,
        coupling: ArrayLike | None = None,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
    ) -> NormOptimalIlc: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def q(self) -> float | NDArray[np.float64]: ...
    @property
    def s(self) -> float | NDArray[np.float64]: ...
    @property
    def r(self) -> float | NDArray[np.float64]: ...
    @property
    def rate(self) -> float: ...
    @property
    def conditioning(self) -> float: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

def contour_weights(
    reference: ArrayLike,
    q: ArrayLike = 1.0,
    contour: ArrayLike = 1.0,
    along: ArrayLike = 0.0,
    axes: Sequence[int] | None = None,
) -> NDArray[np.float64]: ...
def coupled_weights(
    coupling: ArrayLike, sigma: ArrayLike = 1.0, gamma: ArrayLike = 0.0
) -> NDArray[np.float64]: ...
def schedule(
    segments: Sequence[tuple[int, float]],
    n_samples: int,
    bandwidth_hz: float | None = None,
    dt_s: float | None = None,
) -> NDArray[np.float64]: ...
def formation_weights(
    n_agents: int,
    n_axes: int,
    n_samples: int,
    tracking: ArrayLike = 1.0,
    own: ArrayLike = 1.0,
    centre: ArrayLike = 0.0,
    sigma: ArrayLike = 1.0,
    weight: ArrayLike = 1.0,
    leaders: Sequence[int] | None = None,
    pairs: Sequence[tuple[int, int]] | None = None,
    axes: Sequence[int] | None = None,
) -> NDArray[np.float64]: ...
def formation_errors(
    e: ArrayLike,
    n_agents: int,
    pairs: Sequence[tuple[int, int]] | None = None,
    axes: Sequence[int] | None = None,
) -> NDArray[np.float64]: ...

@final
class Delta:
    def __new__(cls, base_m: float = ..., crank_m: float = ..., rod_m: float = ...) -> Delta: ...
    @property
    def base_m(self) -> float: ...
    @property
    def crank_m(self) -> float: ...
    @property
    def rod_m(self) -> float: ...
    def forward(self, theta_rad: ArrayLike) -> NDArray[np.float64]: ...
    def inverse(self, p_m: ArrayLike) -> NDArray[np.float64]: ...
    def jacobian(self, theta_rad: ArrayLike) -> NDArray[np.float64]: ...
    def in_workspace(self, p_m: ArrayLike) -> bool: ...
    def condition(self, theta_rad: ArrayLike) -> float: ...

@final
class Gantry:
    def __new__(cls, orthogonality_rad: float = 0.0) -> Gantry: ...
    @property
    def orthogonality_rad(self) -> float: ...
    def forward(self, axes_m: ArrayLike) -> NDArray[np.float64]: ...
    def inverse(self, tool_m: ArrayLike) -> NDArray[np.float64]: ...
    def jacobian(self) -> NDArray[np.float64]: ...

@final
class Line:
    def __new__(cls, from_m: ArrayLike, to_m: ArrayLike) -> Line: ...

@final
class Arc:
    def __new__(
        cls,
        from_m: ArrayLike,
        centre_m: ArrayLike,
        sweep_rad: float,
        axis: ArrayLike | None = None,
    ) -> Arc: ...

def contour_error(
    reference_m: ArrayLike | list[Line | Arc], actual_m: ArrayLike, window: int | None = None
) -> NDArray[np.float64]: ...
def coupling_gains(reference_m: ArrayLike) -> NDArray[np.float64]: ...
def projection_across(reference_m: ArrayLike) -> NDArray[np.float64]: ...

@final
class Pid:
    def __new__(
        cls,
        kp: float,
        ki_per_s: float = 0.0,
        kd_s: float = 0.0,
        *,
        dt_s: float,
        derivative: Literal["difference", "delayed", "filtered"] = "difference",
        filter_s: float = 0.01,
        output_max: float | None = None,
    ) -> Pid: ...
    def step(self, error: float) -> float: ...
    def run(self, error: ArrayLike) -> NDArray[np.float64]: ...
    def model(self) -> StateSpace: ...
    def reset(self) -> None: ...

@final
class Cascade:
    def __new__(
        cls,
        position_gain_per_s: float,
        velocity_gain_n_s_m: float,
        integral_time_s: float | None = None,
        *,
        dt_s: float,
        velocity_feedforward: float = 0.0,
        acceleration_feedforward_kg: float = 0.0,
        velocity_max_m_s: float | None = None,
        force_max_n: float | None = None,
    ) -> Cascade: ...
    def step(
        self,
        position_m: float,
        actual_m: float,
        actual_m_s: float,
        velocity_m_s: float = 0.0,
        acceleration_m_s2: float = 0.0,
        learned_n: float = 0.0,
    ) -> float: ...
    def reset(self) -> None: ...

@final
class CrossCoupled:
    def __new__(cls, controller: Pid) -> CrossCoupled: ...
    def step(
        self, error_m: ArrayLike, gains: ArrayLike, curvature_per_m: float = 0.0
    ) -> tuple[NDArray[np.float64], float]: ...
    def reset(self) -> None: ...

_Side: TypeAlias = ArrayLike | None
_Bounds: TypeAlias = tuple[_Side, _Side] | None

@final
class ConstrainedIlc:
    def __new__(
        cls,
        model: StateSpace | _ForeignModel,
        n_samples: int,
        q: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        rate: float = 0.0,
        *,
        u_bounds: _Bounds = None,
        v_bounds: _Bounds = None,
        step_bounds: _Bounds = None,
        reference: ArrayLike | None = None,
        position_bounds: _Bounds = None,
        velocity_bounds: _Bounds = None,
        acceleration_bounds: _Bounds = None,
        output_bounds: _Bounds = None,
        output_reference: ArrayLike | None = None,
    ) -> ConstrainedIlc: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def status(self) -> Literal["untried", "solved", "infeasible", "max_iterations"]: ...
    @property
    def message(self) -> str: ...
    @property
    def iterations(self) -> int: ...
    @property
    def gap(self) -> float: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

@final
class Cell:
    @staticmethod
    def load(path: str | PathLike[str], allow_divergent: bool = False) -> Cell: ...
    @property
    def name(self) -> str: ...
    @property
    def path(self) -> str: ...
    @property
    def cycle_s(self) -> float: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def n_axes(self) -> int: ...
    @property
    def axis_names(self) -> list[str]: ...
    @property
    def interfaces(self) -> list[Literal["csp", "csv"]]: ...
    @property
    def axis_units(self) -> list[Literal["m", "rad"]]: ...
    @property
    def position_gains_per_s(self) -> list[float | None]: ...
    @property
    def bus(self) -> str: ...
    @property
    def measure(self) -> Literal["encoder", "tcp"]: ...
    @property
    def law(
        self,
    ) -> Literal[
        "norm_optimal",
        "pd",
        "constrained",
        "adjoint",
        "model_inverse",
        "error_feedforward",
        "none",
    ]: ...
    @property
    def warnings(self) -> list[str]: ...
    def reference(self) -> NDArray[np.float64]: ...
    def model(self) -> StateSpace: ...
    def first_error(self) -> NDArray[np.float64]: ...

@final
class Analysis:
    @property
    def n_samples(self) -> int: ...
    @property
    def method(self) -> Literal["dense", "structured"]: ...
    @property
    def converges(self) -> bool: ...
    @property
    def monotonic(self) -> bool: ...
    @property
    def why(self) -> str: ...
    @property
    def spectral_radius(self) -> float: ...
    @property
    def spectral_radius_error(self) -> float: ...
    @property
    def monotonic_factor(self) -> float | None: ...
    @property
    def monotonic_factor_error(self) -> float | None: ...
    @property
    def transient_growth(self) -> float: ...
    @property
    def frequency_hz(self) -> NDArray[np.float64]: ...
    @property
    def contraction(self) -> NDArray[np.float64]: ...
    @property
    def critical_frequency_hz(self) -> float | None: ...
    @property
    def learnable_frequency_hz(self) -> float | None: ...
    @property
    def robust_factor(self) -> float | None: ...
    @property
    def robust_lifted(self) -> float | None: ...
    @property
    def uncertainty_allowed(self) -> float | None: ...
    @property
    def initial_error_rms(self) -> float | None: ...
    @property
    def converged_error_rms(self) -> float | None: ...
    @property
    def converged_input(self) -> NDArray[np.float64] | None: ...
    @property
    def converged_error(self) -> NDArray[np.float64] | None: ...
    @property
    def expected_rms(self) -> NDArray[np.float64]: ...
    @property
    def expected_rms_limit(self) -> float | None: ...
    @property
    def pd_factor(self) -> float | None: ...
    @property
    def pd_gain_range(self) -> tuple[float, float] | None: ...
    def to_dict(self) -> dict[str, Any]: ...

def analyze(
    law: object,
    model: StateSpace | _ForeignModel,
    n_samples: int | None = None,
    uncertainty: float | ArrayLike | None = None,
    reference: ArrayLike | None = None,
    noise_std: float | None = None,
    n_runs: int = 20,
) -> Analysis: ...
def refuse_divergent(law: object, model: StateSpace | _ForeignModel, n_samples: int) -> None: ...

@final
class Tuning:
    @property
    def q(self) -> float: ...
    @property
    def s(self) -> float: ...
    @property
    def r(self) -> float: ...
    @property
    def smoothing_hz(self) -> float | None: ...
    @property
    def steps(self) -> list[dict[str, Any]]: ...
    @property
    def analysis(self) -> Analysis: ...

def tune(
    model: StateSpace | _ForeignModel,
    n_samples: int,
    uncertainty: float | ArrayLike | None = None,
    noise_std: float | None = None,
    reference: ArrayLike | None = None,
    n_runs: int = 10,
) -> Tuning: ...

@final
class Library:
    def __new__(cls, path: str | PathLike[str]) -> Library: ...
    def list(self, cell: str | None = None) -> list[dict[str, Any]]: ...
    def load(self, id: int) -> dict[str, Any]: ...
    def recall(
        self, disturbance: ArrayLike, top: int = 30, cell: str | None = None
    ) -> builtins.list[dict[str, Any]]: ...
    def append(
        self,
        u: ArrayLike,
        e: ArrayLike,
        cycle_s: float,
        disturbance: ArrayLike | None = None,
        reference_m: ArrayLike | None = None,
        *,
        cell: str = "elsewhere",
        campaign: str = "elsewhere",
        law: str = "elsewhere",
    ) -> int: ...
    def trim(self, keep: int, cell: str | None = None) -> int: ...
    def export(self, id: int, path: str | PathLike[str]) -> None: ...

@final
class EventStream:
    def __iter__(self) -> Iterator[str]: ...
    def __next__(self) -> str: ...
    def stop(self, signal: int = ...) -> None: ...

def check_options(verb: str, arguments: list[str]) -> None: ...
def described_options(verb: str) -> str: ...
def transports() -> list[dict[str, Any]]: ...
def run_events(
    cell: Cell,
    arguments: list[str],
    verb: str = "run",
    law: object | None = None,
    disturbance: Callable[[int], ArrayLike] | None = None,
) -> EventStream: ...

# Make objects again, for copies and pickles.
def _made(cls: object, how: str | None, arguments: dict[str, Any], part: str | None) -> object: ...
def _second_order_fit(
    model: tuple[float, float, float, float, float | None],
    deviations: tuple[float, float, float, float],
    residual_rms: float,
) -> SecondOrderFit: ...
def _velocity_loop_fit(
    model: tuple[float, float, float, float, float],
    deviations: tuple[float, float, float],
    residual_rms: float,
) -> VelocityLoopFit: ...
def _rational_fit(
    model: StateSpace, delay_s: float, reflected_poles: int, residual_rms: float
) -> RationalFit: ...
def _trajectory(
    dt_s: float,
    samples: Sequence[NDArray[np.float64]],
    alphas: Sequence[Any],
    computing_s: float,
) -> Trajectory: ...
