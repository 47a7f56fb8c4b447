from collections.abc import Iterator
from os import PathLike
from typing import Any, Literal, Protocol, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "ButterworthFilter",
    "Cell",
    "EventStream",
    "LearningError",
    "Library",
    "ModelError",
    "NormOptimalIlc",
    "PdIlc",
    "SignalError",
    "StateSpace",
    "Trajectory",
    "TrajectoryError",
    "butterfly",
    "butterworth",
    "discretize",
    "exponential_sigmoid",
    "from_transfer_function",
    "gcode",
    "jerk_limited",
    "modulated",
    "raster",
    "run_events",
    "second_order",
    "spiral",
    "spline",
    "tracking_index",
    "zero_phase",
]

# Docstrings are those of the compiled classes: help(ilc_rt.StateSpace).

class _ForeignModel(Protocol):
    """A state-space object of scipy.signal or python-control."""

    @property
    def A(self) -> object: ...
    @property
    def B(self) -> object: ...
    @property
    def C(self) -> object: ...
    @property
    def D(self) -> object: ...
    @property
    def dt(self) -> object: ...

class ModelError(ValueError): ...
class SignalError(ValueError): ...
class LearningError(ValueError): ...

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

def from_transfer_function(
    num: ArrayLike, den: ArrayLike, dt_s: float | None = None
) -> StateSpace: ...
def second_order(natural_frequency_rad_s: float, damping: float) -> StateSpace: ...
def discretize(
    model: StateSpace | _ForeignModel, dt_s: float, method: Literal["zoh", "tustin"] = "zoh"
) -> StateSpace: ...

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
def zero_phase(filter: ButterworthFilter, x: ArrayLike) -> NDArray[np.float64]: ...

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
    center_m: tuple[float, float] = (0.0, 0.0),
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
    center_m: tuple[float, float] = (0.0, 0.0),
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
    start_m: tuple[float, float] = (0.0, 0.0),
    there_and_back: bool = False,
    setting: str = "complete",
) -> Trajectory: ...
def gcode(
    text: str,
    *,
    start_m: ArrayLike,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    rapid_m_s: float | None = None,
    blend_s: float | None = None,
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
        q_filter: ButterworthFilter | None = None,
        lead: int = 1,
    ) -> PdIlc: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

@final
class NormOptimalIlc:
    def __new__(
        cls,
        model: StateSpace | _ForeignModel,
        n_samples: int,
        q: float = 1.0,
        s: float = 0.0,
        r: float = 0.0,
        rate: float = 0.0,
    ) -> NormOptimalIlc: ...
    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: object = None
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...

@final
class Cell:
    @staticmethod
    def load(path: str | PathLike[str]) -> Cell: ...
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
    def bus(self) -> str: ...
    @property
    def measure(self) -> Literal["encoder", "tcp"]: ...
    @property
    def law(self) -> Literal["norm_optimal", "pd", "none"]: ...
    def reference(self) -> NDArray[np.float64]: ...

@final
class Library:
    def __new__(cls, path: str | PathLike[str]) -> Library: ...
    def list(self, cell: str | None = None) -> list[dict[str, Any]]: ...
    def load(self, id: int) -> dict[str, Any]: ...

@final
class EventStream:
    def __iter__(self) -> Iterator[str]: ...
    def __next__(self) -> str: ...
    def stop(self, signal: int = ...) -> None: ...

def run_events(
    cell: Cell,
    iterations: int,
    library: str | PathLike[str],
    bus: str | None = None,
    measure: str | None = None,
    lockstep: bool = True,
    resume: bool = False,
    law: object | None = None,
) -> EventStream: ...
