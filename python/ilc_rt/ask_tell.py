"""An experiment by ask and tell: the law here, the plant anywhere.

`ilc_rt.simulation` is built on it; a user calls it from the program that runs the plant.
"""

from __future__ import annotations

import json
import time
import uuid
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import LearningError
from ilc_rt.errors import BadInputError, PlantError
from ilc_rt.library import Library
from ilc_rt.trial_record import record_of
from ilc_rt.trial_result import TrialResult

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import AnyLaw
    from ilc_rt.record import IterationRecord

    Array = NDArray[np.float64]

# Largest error whose square sums still are numbers.
LARGEST = 1e140


class Experiment:
    """Learn on a plant that another program runs: ask for the input, tell the output.

    Parameters
    ----------
    law : Law, object or None
        A law of this package or any object with ``update(u, e, disturbance=None)``; None repeats
        the first input. A law with a method ``reset()`` is reset.
    reference : array_like, shape (n_samples,) or (n_samples, n_outputs)
        Reference of the output.
    library : path or None
        Library file that every run is stored in at once; None keeps them in memory.
    name : str
        Name of the experiment, in place of a cell's.
    campaign : str or None
        Identifier of its series of runs; None for a new one, or the newest one with `resume`.
    resume : bool
        Continue the series that the library has, if it has one; otherwise begin.
    dt_s : float
        Sample time in s.
    unit : str
        Unit of the output: ``"m"``, ``"rad"`` or any other one.
    n_inputs : int or None
        Number of inputs; None for that of `initial_input` or of the reference.
    initial_input : array_like or None, shape (n_samples,) or (n_samples, n_inputs)
        Input of the first run; None for zero.

    Raises
    ------
    BadInputError
        If the library has no such series of this reference, or its inputs are not those of this
        law.
    ValueError, TypeError
        If an argument has the wrong shape or is not finite, or the law is not a law.

    Notes
    -----
    On resuming, all stored runs pass through the law again, which then has the state of an
    uninterrupted experiment, bit for bit; the law must be deterministic. The controller's rollback
    belongs to a `Campaign`; here a `Gate` decides.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import Experiment, PdIlc
    >>> experiment = Experiment(PdIlc(kp=1.0, lead_samples=0), np.ones(3))
    >>> for _ in range(3):
    ...     u = experiment.ask()
    ...     record = experiment.tell(0.5 * u)
    >>> record.index, record.tracking_inf_m
    (2, 0.25)
    """

    def __init__(
        self,
        law: AnyLaw | None,
        reference: ArrayLike,
        *,
        library: str | PathLike[str] | None = None,
        name: str = "experiment",
        campaign: str | None = None,
        resume: bool = False,
        dt_s: float = 1.0,
        unit: str = "m",
        n_inputs: int | None = None,
        initial_input: ArrayLike | None = None,
    ) -> None:
        if law is not None and not callable(getattr(law, "update", None)):
            message = f"law = {law!r}: an object with update(u, e, disturbance=None), or None"
            raise TypeError(message)
        if not (isinstance(dt_s, (int, float)) and np.isfinite(dt_s) and dt_s > 0):
            message = f"dt_s = {dt_s}: a sample time must be finite and above 0"
            raise ValueError(message)
        for key, text in (("name", name), ("unit", unit)):
            if not isinstance(text, str):
                message = f"{key} = {text!r}: a text is needed"
                raise TypeError(message)
        self.law = law
        self._reference = finite("reference", reference)
        self._is_flat = self._reference.ndim == 1
        self._r = self._reference.reshape(len(self._reference), -1)
        self._u = self._first_input(initial_input, n_inputs)
        self._library = None if library is None else Library(library)
        path = "" if library is None else str(library)
        self._asked = False
        self._pending: IterationRecord | None = None
        self._disturbance: Array | None = None
        self._update_ms = 0.0
        reset = getattr(law, "reset", None)
        if callable(reset):
            reset()
        n_inputs_found = 1 if self._u.ndim == 1 else self._u.shape[1]
        n_outputs = self._r.shape[1]
        self.result = TrialResult(
            library=path,
            cell=name,
            campaign=campaign or uuid.uuid4().hex[:16],
            law="none" if law is None else type(law).__name__,
            measure="encoder",
            n_samples=len(self._r),
            n_axes=n_outputs,
            cycle_s=float(dt_s),
            axis_names=tuple(f"axis {axis + 1}" for axis in range(n_outputs)),
            input_units=(unit,) * max(n_outputs, n_inputs_found),
        )
        if self._library is not None and n_inputs_found != n_outputs:
            message = (
                f"library: a run with {n_inputs_found} inputs and {n_outputs} outputs cannot be "
                "stored; their numbers must be equal"
            )
            raise ValueError(message)
        if self._library is not None and resume:
            self._resume(campaign)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the reference and of every output."""
        return self._reference.shape

    @property
    def trial(self) -> int:
        """Number of the run that is to be made next, or is being made, from 0."""
        return len(self.result.records)

    def ask(self, disturbance: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the input of the next run.

        Parameters
        ----------
        disturbance : float, array_like or None, shape (n_disturbances,)
            Measured disturbance of this run, for the law and the library.

        Returns
        -------
        ndarray of float64, shape (n_samples,) or (n_samples, n_inputs)
            The same until `tell` is called.

        Raises
        ------
        LearningError
            If the law returns an input of the wrong shape, or one that is not finite.
        """
        if not self._asked:
            measured = (
                None if disturbance is None else np.atleast_1d(finite("disturbance", disturbance))
            )
            if self._pending is not None:
                self._u, self._update_ms = self._learn(self._pending, measured)
                self._pending = None
            elif measured is not None:
                self._announce(measured)
            self._disturbance = measured
            self._asked = True
        return self._u.copy()

    def tell(self, y: ArrayLike) -> IterationRecord:
        """Record the output of the run that was asked for.

        Parameters
        ----------
        y : array_like, same shape as the reference
            Measured output.

        Returns
        -------
        IterationRecord
            The run, which is in the library when this returns.

        Raises
        ------
        PlantError
            If a value is NaN or infinite, naming trial and sample; the experiment stays as it was,
            so that the run can be made again.
        ValueError
            If the shape differs, the error is above 1e140, or no input was asked for.
        """
        if not self._asked:
            message = f"trial {self.trial}: tell needs an ask before it"
            raise ValueError(message)
        e = (self._reference - self._measured(y)).reshape(self._r.shape)
        if max(float(np.abs(e).max()), float(np.abs(self._r).max())) > LARGEST:
            message = f"trial {self.trial}: the error is above {LARGEST:g}: its figures overflow"
            raise ValueError(message)
        u = self._u.reshape(len(self._u), -1)
        stored: dict[str, Any] = {}
        if self._library is not None:
            # The library first: if it fails, the experiment is as before.
            key = self._library.append(
                u, e, self.result.cycle_s, self._disturbance, self._r,
                cell=self.result.cell, campaign=self.result.campaign, law=self.result.law,
            )  # fmt: skip
            stored = {"id": key, "library": self.result.library}
        self._note(u, e, **stored)
        return self.result.records[-1]

    def _note(self, u: Array, e: Array, **stored: Any) -> None:  # noqa: ANN401
        record = record_of(
            self.trial, u, e, self._r, self._disturbance, unit=self.result.axis_unit(0),
            update_ms=self._update_ms, law_parameters=_described(self.law), **stored,
        )  # fmt: skip
        self.result.records.append(record)
        self._pending, self._asked = (None if self.law is None else record), False

    def _measured(self, y: ArrayLike) -> Array:
        values = like(y, self._reference.shape)
        if values.shape != self._reference.shape:
            message = (
                f"trial {self.trial}: the output has shape {values.shape}; "
                f"{self._reference.shape} is needed, that of the reference"
            )
            raise ValueError(message)
        if values.dtype.kind not in "iuf":
            message = f"trial {self.trial}: the output has dtype {values.dtype}; numbers are needed"
            raise TypeError(message)
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            sample, channel = int(bad[0][0]), int(bad[0][1]) if values.ndim > 1 else 0
            found = float(values[tuple(bad[0])])
            message = (
                f"trial {self.trial}, sample {sample}, output {channel}: the plant returned "
                f"{found}; only finite numbers are allowed"
            )
            raise PlantError(message, trial=self.trial, sample=sample, channel=channel, value=found)
        return values.astype(np.float64)

    def _learn(self, record: IterationRecord, coming: Array | None) -> tuple[Array, float]:
        """Return the input for a coming disturbance, and the computing time in ms."""
        assert self.law is not None
        begun = time.perf_counter()
        u, e = record.input, record.error_m
        if self._is_flat:
            e = e[:, 0]
        if self._u.ndim == 1:
            u = u[:, 0]
        learned = np.asarray(self.law.update(u.copy(), e.copy(), coming))
        update_ms = 1e3 * (time.perf_counter() - begun)
        if learned.shape != u.shape or learned.dtype.kind not in "iuf":
            message = (
                f"trial {self.trial}: the law returned an input of shape {learned.shape} and dtype "
                f"{learned.dtype}; {u.shape} is needed"
            )
            raise LearningError(message)
        if not np.isfinite(learned).all():
            sample = int(np.argwhere(~np.isfinite(learned))[0][0])
            message = (
                f"trial {self.trial}, sample {sample}: the law returned "
                f"{learned[sample]}, which is not finite"
            )
            raise LearningError(message)
        return learned.astype(np.float64), update_ms

    def _announce(self, disturbance: Array) -> None:
        expect = getattr(self.law, "expect", None)
        if callable(expect):
            expect(disturbance)

    def _first_input(self, initial_input: ArrayLike | None, n_inputs: int | None) -> Array:
        n_samples, n_outputs = self._r.shape
        if initial_input is None:
            channels = n_outputs if n_inputs is None else n_inputs
            is_flat = self._is_flat and channels == 1
            return np.zeros(n_samples if is_flat else (n_samples, channels))
        u = finite("initial_input", initial_input)
        if len(u) != n_samples or (n_inputs is not None and u.size != n_samples * n_inputs):
            wanted = "n_inputs" if n_inputs is None else n_inputs
            message = f"initial_input has shape {u.shape}; ({n_samples}, {wanted}) is needed"
            raise ValueError(message)
        return u

    def _resume(self, campaign: str | None) -> None:
        assert self._library is not None
        place = self.result.library
        rows = self._library.list(self.result.cell)
        series = [row["campaign"] for row in rows if campaign in {None, row["campaign"]}]
        if not series:
            return
        self.result.campaign, own_s = str(series[-1]), self.result.cycle_s
        own = [row for row in rows if row["campaign"] == series[-1]]
        for row in sorted(own, key=lambda row: int(row["index"])):
            run = self._library.load(int(row["id"]))
            told = f"{place}: run {row['index']} of campaign {self.result.campaign}"
            if not np.array_equal(run["reference_m"], self._r):
                message = f"{told} has another reference"
                raise BadInputError(message)
            if float(run["cycle_s"]) != own_s:
                message = (
                    f"{told} has a sample time of {run['cycle_s']} s, not {self.result.cycle_s}"
                )
                raise BadInputError(message)
            u = self.ask(run["disturbance"]).reshape(len(self._r), -1)
            if not np.array_equal(run["input"], u):
                largest = float(np.abs(run["input"] - u).max())
                message = (
                    f"{told} has another input, by up to {largest:.3g}: it was made with another "
                    "law, other parameters or another first input"
                )
                raise BadInputError(message)
            self._note(u, run["error_m"], id=int(row["id"]), library=place)


def finite(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return an argument as an array of finite numbers with one or two axes.

    Raises
    ------
    ValueError, TypeError
        If it has another shape or dtype, no samples, or a number that is not finite.

    Examples
    --------
    >>> finite("reference", [1, 2])
    array([1., 2.])
    """
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        message = f"{name} has dtype {array.dtype}; numbers are needed"
        raise TypeError(message)
    if array.ndim > 2 or array.size == 0:
        message = (
            f"{name} has shape {array.shape}; (n,) or (n, n_channels) with n above 0 is needed"
        )
        raise ValueError(message)
    if not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        message = f"{name}{list(place)} = {array[place]}; only finite numbers are allowed"
        raise ValueError(message)
    return np.atleast_1d(array.astype(np.float64))


def like(y: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the output of one channel with or without a channel axis, as the reference has it.

    Examples
    --------
    >>> like([1.0, 2.0], (2, 1)).shape, like([[1.0], [2.0]], (2,)).shape, like([1.0], (2,)).shape
    ((2, 1), (2,), (1,))
    """
    array = np.asarray(y)
    if shape[0] > 0 and array.shape in {shape[:1], (shape[0], 1)} and np.prod(shape) == shape[0]:
        return array.reshape(shape)
    return array


def _described(law: object) -> str:
    shown = repr(law)
    # An address differs from process to process.
    return "{}" if law is None or " at 0x" in shown else json.dumps({"repr": shown[:4000]})
