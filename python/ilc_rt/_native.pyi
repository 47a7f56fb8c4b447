from collections.abc import Iterator, Sequence
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
    "TimeVarying",
    "butterworth",
    "contour_weights",
    "coupled_weights",
    "discretize",
    "formation_errors",
    "formation_weights",
    "from_transfer_function",
    "run_events",
    "schedule",
    "second_order",
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
