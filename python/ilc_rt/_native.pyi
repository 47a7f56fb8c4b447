import builtins
from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from typing import Any, Literal, Protocol, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Self, disjoint_base

__all__ = [
    "TUNING_RUNS_MAX",
    "Arc",
    "Cascade",
    "Cell",
    "ContourError",
    "CrossCoupled",
    "Delta",
    "EventStream",
    "Filter",
    "Gantry",
    "KinematicsError",
    "Law",
    "LearningError",
    "Library",
    "Line",
    "ModelError",
    "Pid",
    "SignalError",
    "StateSpace",
    "TimeVarying",
    "TrajectoryError",
    "__version__",
    "_made",
    "_made_of_kind",
    "analyze",
    "butterfly",
    "check_options",
    "check_relevance_weights",
    "check_response",
    "contour_error",
    "contour_weights",
    "coupled_weights",
    "coupling_gains",
    "described_options",
    "discretize",
    "evaluate_experiment",
    "excitation",
    "exponential_sigmoid",
    "fit_rational",
    "fit_second_order",
    "fit_velocity_loop",
    "formation_errors",
    "formation_weights",
    "frequency_response",
    "from_transfer_function",
    "gcode",
    "identify_axis",
    "instantaneous_frequency",
    "jerk_limited",
    "modulated",
    "projection_across",
    "raster",
    "refuse_divergent",
    "relative_deviation",
    "repeatability",
    "run_events",
    "schedule",
    "second_order",
    "second_order_model",
    "second_order_response",
    "sigmoid_pair",
    "single_experiment",
    "spiral",
    "spline",
    "tracking_index",
    "transports",
    "tune",
    "uncertainty",
    "velocity_loop_response",
    "zero_phase",
]

__version__: str
TUNING_RUNS_MAX: int

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
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
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

class TrajectoryError(ValueError): ...

def coupling_gains(reference_m: ArrayLike) -> NDArray[np.float64]: ...
def projection_across(reference_m: ArrayLike) -> NDArray[np.float64]: ...

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

@disjoint_base
class Library:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401
    def list(self, cell: str | None) -> list[dict[str, Any]]: ...
    def load(self, id: int) -> dict[str, Any]: ...
    def recall(
        self, disturbance: ArrayLike, top: int, cell: str | None
    ) -> builtins.list[dict[str, Any]]: ...
    def _append(self, **keywords: Any) -> int: ...  # noqa: ANN401
    def trim(self, keep: int, cell: str | None) -> int: ...

@final
class EventStream:
    def __iter__(self) -> Iterator[str]: ...
    def __next__(self) -> str: ...
    def raised(self) -> BaseException | None: ...
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
# What the typed classes and functions of the package stand on: arguments by name, checked here.
@disjoint_base
class Law:
    def __new__(cls, kind: str, /, **arguments: Any) -> Self: ...  # noqa: ANN401
    @property
    def parameters(self) -> dict[str, Any]: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]: ...
    def expect(self, disturbance: ArrayLike) -> None: ...
    def taken_back(self) -> None: ...
    def reset(self) -> None: ...
    def _figure(self, name: str) -> Any: ...  # noqa: ANN401
    def _remember(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> None: ...
    def _relevant(self, disturbance: ArrayLike | None) -> tuple[list[int], list[float]]: ...
    def _trim(self, keep: int, disturbances: ArrayLike | None) -> list[int]: ...

@disjoint_base
class Filter:
    def __new__(cls, kind: str, /, **arguments: Any) -> Self: ...  # noqa: ANN401
    def zero_phase(self, x: ArrayLike) -> NDArray[np.float64]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def _forward(self, x: ArrayLike) -> NDArray[np.float64]: ...
    def _sos(self) -> NDArray[np.float64]: ...
    def _figures(self) -> dict[str, Any]: ...

def zero_phase(filter: Filter | ArrayLike, x: ArrayLike) -> NDArray[np.float64]: ...
def instantaneous_frequency(**keywords: Any) -> NDArray[np.float64]: ...  # noqa: ANN401
def check_relevance_weights(weights: object) -> None: ...
def contour_weights(**keywords: Any) -> NDArray[np.float64]: ...  # noqa: ANN401
def coupled_weights(**keywords: Any) -> NDArray[np.float64]: ...  # noqa: ANN401
def formation_weights(**keywords: Any) -> NDArray[np.float64]: ...  # noqa: ANN401
def formation_errors(**keywords: Any) -> NDArray[np.float64]: ...  # noqa: ANN401
def schedule(**keywords: Any) -> NDArray[np.float64]: ...  # noqa: ANN401
def analyze(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def refuse_divergent(**keywords: Any) -> None: ...  # noqa: ANN401
def tune(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def repeatability(errors: ArrayLike) -> dict[str, Any]: ...
def from_transfer_function(**keywords: Any) -> StateSpace: ...  # noqa: ANN401
def second_order(**keywords: Any) -> StateSpace: ...  # noqa: ANN401
def discretize(**keywords: Any) -> StateSpace: ...  # noqa: ANN401
def check_response(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def relative_deviation(**keywords: Any) -> NDArray[np.float64]: ...  # noqa: ANN401
def frequency_response(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def fit_second_order(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def fit_velocity_loop(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def fit_rational(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def uncertainty(**keywords: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...  # noqa: ANN401
def excitation(**keywords: Any) -> tuple[NDArray[np.float64], int, int]: ...  # noqa: ANN401
def second_order_response(
    frequency_hz: ArrayLike,
    /,
    **model: Any,  # noqa: ANN401
) -> NDArray[np.complex128]: ...
def velocity_loop_response(
    frequency_hz: ArrayLike,
    /,
    **model: Any,  # noqa: ANN401
) -> NDArray[np.complex128]: ...
def second_order_model(**model: Any) -> StateSpace: ...  # noqa: ANN401
def _made_of_kind(cls: type, native: str, kind: str, arguments: dict[str, Any], /) -> object: ...
def _made(cls: object, how: str | None, arguments: dict[str, Any]) -> object: ...

@disjoint_base
class Pid:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401
    def step(self, error: float) -> float: ...
    def run(self, error: ArrayLike) -> NDArray[np.float64]: ...
    def model(self) -> StateSpace: ...
    def reset(self) -> None: ...

@disjoint_base
class Cascade:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401
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

@disjoint_base
class CrossCoupled:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401
    def step(
        self, error_m: ArrayLike, gains: ArrayLike, curvature_per_m: float = 0.0
    ) -> tuple[NDArray[np.float64], float]: ...
    def reset(self) -> None: ...

@disjoint_base
class Delta:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401
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

@disjoint_base
class Gantry:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401
    @property
    def orthogonality_rad(self) -> float: ...
    def forward(self, axes_m: ArrayLike) -> NDArray[np.float64]: ...
    def inverse(self, tool_m: ArrayLike) -> NDArray[np.float64]: ...
    def jacobian(self) -> NDArray[np.float64]: ...

def jerk_limited(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def exponential_sigmoid(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def modulated(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def sigmoid_pair(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def spline(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def butterfly(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def spiral(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def raster(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def gcode(**keywords: Any) -> dict[str, Any]: ...  # noqa: ANN401
def tracking_index(**keywords: Any) -> tuple[float, float]: ...  # noqa: ANN401
def contour_error(
    reference_m: ArrayLike | Sequence[Line | Arc], actual_m: ArrayLike, window: int | None = None
) -> NDArray[np.float64]: ...

@disjoint_base
class Line:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401

@disjoint_base
class Arc:
    def __new__(cls, **keywords: Any) -> Self: ...  # noqa: ANN401
