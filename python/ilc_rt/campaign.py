"""A campaign: the same program again and again, each run better than the last."""

from __future__ import annotations

import signal
import warnings
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from ilc_rt._native import Cell
from ilc_rt.analysis import refuse_divergent
from ilc_rt.controllers import Controller, InProcessController, ProcessController
from ilc_rt.errors import EXIT_FAULT, BadInputError, CampaignError
from ilc_rt.events import EndEvent, Event, IterationEvent, parse_event
from ilc_rt.interruption import ControlledStop
from ilc_rt.processes import start_simulated_drives
from ilc_rt.record import IterationRecord
from ilc_rt.result import CampaignResult

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.experiment import Experiment

DEFAULT_LIBRARY = "ilc-library.db"
# Runs are counted in 32 bits.
ITERATIONS_MAX = 2**32 - 1
TRANSPORTS = ("can", "udp", "zenoh", "loopback")
Drives = Literal["auto", "simulated", "external"]


class Law(Protocol):
    """A learning law written in Python."""

    def update(
        self,
        u: NDArray[np.float64],
        e: NDArray[np.float64],
        disturbance: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the next input; all shapes are (n_samples, n_axes)."""


class Campaign:
    """Run a cell's program repeatedly and learn between the runs.

    Parameters
    ----------
    cell : path or Cell
        The cell description.
    law : object or None
        A learning law with ``update(u, e, disturbance=None)``; None for the
        law that the cell names. A law written in Python makes the controller
        run inside this process; it is called between runs, never in the loop.
    library : path
        Where the runs are kept.
    bus : str or None
        Bus address in place of the cell's: ``can:``, ``udp:``, ``zenoh:``
        or ``loopback:``.
    measure : {"encoder", "tcp"} or None
        Which measurement to learn from, in place of the cell's.
    lockstep : bool or None
        Whether drives and loop advance on each other's answer, with no wall
        clock. None means yes for ``loopback:``, no for every other bus.
    drives : {"auto", "simulated", "external"}
        Whether to start simulated drives. "auto" never does so on a CAN bus,
        where real ones may be listening.
    resume : bool
        Whether to go on from the last campaign of this cell in the library.
    learning : bool
        Whether to learn at all; if not, every run is like the first.
    disturbance : callable, array_like of float64 or None
        What is measured of each run's surroundings before it, as a temperature:
        kept with the run in the library, and given to the law for the coming
        run. Either one row a run, shape (n_runs,) or (n_runs, n_disturbances),
        or a function of the run's number (from 0) that is asked while the axes
        return. The controller then runs inside this process.
    allow_divergent : bool
        Whether to start a law of which the analysis says that it will not
        converge. A law written in Python is not analysed: it always starts.
        Of a `Gate` or a `Ladder` the law inside is analysed.

    Raises
    ------
    CampaignError
        If the cell, the bus or a program cannot be used.
    BadInputError
        If the law will not converge with the cell's model.

    Warns
    -----
    UserWarning
        If the law's low-pass begins above the frequency from which on the law
        makes the error grow, or the error of the cell's own law will rise
        before it falls; not with `allow_divergent`.

    Notes
    -----
    The controller restores the best input when the error grows, unless the law
    is a `Gate`, which does so by itself. It tells any other law that has a
    method ``taken_back()``.

    Examples
    --------
    >>> campaign = Campaign("examples/01_gantry.toml", bus="loopback:")
    >>> for record in campaign.run(3):
    ...     print(f"run {record.index}: {1e6 * record.contour_inf_m:.0f} µm")
    run 0: 5... µm
    run 1: ... µm
    run 2: ... µm
    """

    def __init__(
        self,
        cell: str | Path | Cell,
        law: Law | None = None,
        library: str | Path = DEFAULT_LIBRARY,
        *,
        bus: str | None = None,
        measure: Literal["encoder", "tcp"] | None = None,
        lockstep: bool | None = None,
        drives: Drives = "auto",
        resume: bool = False,
        learning: bool = True,
        disturbance: Callable[[int], ArrayLike] | ArrayLike | None = None,
        allow_divergent: bool = False,
    ) -> None:
        if isinstance(cell, Cell):
            self.cell = cell
        else:
            # The cell's own law does not matter if another one is given.
            self.cell = load_cell(cell, allow_divergent=allow_divergent or law is not None)
        self.allow_divergent = allow_divergent
        self.law = law
        self.library = str(library)
        self.bus = bus if bus is not None else str(self.cell.bus)
        if law is not None and not callable(getattr(law, "update", None)):
            message = f"law = {law!r}: an object with update(u, e, disturbance=None), or None"
            raise BadInputError(message)
        if law is not None and not allow_divergent:
            _refuse_divergent(law, self.cell)
        if law is None and learning and not allow_divergent:
            for line in self.cell.warnings:
                warnings.warn(f"{self.cell.path}: {line}", stacklevel=2)
        self.measure = measure
        self.transport = transport_of(self.bus)
        self.lockstep = self.transport == "loopback" if lockstep is None else lockstep
        self.simulated = _simulated(self.transport, drives)
        self.resume = resume
        self.learning = learning
        # What is run in place of the program, if an axis is to be identified.
        self.experiment: Experiment | None = None
        self.disturbance = disturbance
        self.result = CampaignResult(self.library)
        self._controller: Controller | None = None
        folder = Path(self.library).absolute().parent
        if not folder.is_dir():
            message = f"{self.library}: no such folder: {folder}"
            raise BadInputError(message)

    def run(self, iterations: int) -> Iterator[IterationRecord]:
        """Run the program and yield one record a run, as it is completed.

        Parameters
        ----------
        iterations : int
            Runs in the whole campaign, at least 1, those before a `resume`
            included; the first is without learning.

        Raises
        ------
        CampaignError
            If the controller cannot start, or stopped after a fault.
        KeyboardInterrupt
            After Ctrl-C, when the axes are at rest; a second Ctrl-C at once.
        """
        with closing(self.events(iterations)) as events:
            for event in events:
                if isinstance(event, IterationEvent):
                    yield self.result.records[-1]

    def events(self, iterations: int) -> Generator[Event, None, None]:
        """Run the program and yield every event of the controller.

        Leaving the loop early stops the axes in a controlled way before this
        iterator is closed. Parameters and errors are those of `run`.
        """
        if not 1 <= iterations <= ITERATIONS_MAX:
            allowed = "at least 1" if iterations < 1 else f"at most {ITERATIONS_MAX}"
            message = f"iterations = {iterations}: {allowed}"
            raise BadInputError(message)
        measure = _measure(self.disturbance, iterations)
        self.result = CampaignResult(self.library)
        with ControlledStop(self.interrupt) as stop:
            controller = self._controller = self._start(iterations, measure)
            try:
                if stop.received is not None:
                    controller.interrupt(stop.received)
                for line in controller.lines():
                    event = parse_event(line)
                    if event is not None:
                        self.result.follow(event)
                        yield event
                self._check_end(controller)
            finally:
                self._controller = None
                controller.close()
        stop.raise_received()

    def interrupt(self, number: int = signal.SIGINT) -> None:
        """Ask the running controller for a controlled stop.

        For signal handlers and other threads; the events go on until the
        axes are at rest.
        """
        if self._controller is not None:
            self._controller.interrupt(number)

    def _start(self, iterations: int, measure: Callable[[int], ArrayLike] | None) -> Controller:
        cell_file = str(self.cell.path)
        if self.law is None and measure is None and self.transport != "loopback":
            library = ["--library", self.library]
            if self.experiment is not None:
                verb, arguments = "identify", library + self.experiment.arguments()
            else:
                verb, arguments = "run", ["--iterations", str(iterations), *library]
                if not self.learning:
                    arguments.append("--no-learning")
            if self.measure is not None:
                arguments += ["--measure", self.measure]
            if self.resume:
                arguments.append("--resume")
            if self.allow_divergent:
                arguments.append("--allow-divergent")
            return ProcessController(
                cell_file,
                arguments,
                verb=verb,
                bus=self.bus,
                lockstep=self.lockstep,
                simulated=self.simulated,
            )
        options: dict[str, Any] = {
            "cell": self.cell,
            "iterations": iterations,
            "library": self.library,
            "bus": self.bus,
            "measure": self.measure,
            "lockstep": self.lockstep,
            "resume": self.resume,
            "law": self.law,
            "learning": self.learning,
            "experiment": self.experiment,
            "disturbance": measure,
            "simulated": self.simulated,
        }
        apart = self.simulated and self.transport != "loopback"
        drives = None
        if apart:
            drives = start_simulated_drives(cell_file, self.bus, lockstep=self.lockstep)
        return InProcessController(options, drives)

    def _check_end(self, controller: Controller) -> None:
        failure = controller.failure()
        status = self.result.status
        if status == "fault" or (failure is not None and status == "running"):
            reason = self.result.reason or (failure.reason if failure else "fault")
            code = failure.exit_code if failure else EXIT_FAULT
            if failure is not None and failure.reason not in reason:
                reason = failure.reason if reason in failure.reason else reason
            raise CampaignError(reason, code) from (failure.__cause__ if failure else None)
        if status == "running":
            message = "the controller ended without saying so"
            raise CampaignError(message)


def load_cell(path: str | Path, *, allow_divergent: bool = False) -> Cell:
    """Read and validate a cell description.

    Parameters
    ----------
    path : path
        The TOML file.
    allow_divergent : bool
        Whether its law is accepted also if it will not converge.

    Raises
    ------
    BadInputError
        With file, key, value and what is allowed.
    """
    try:
        return Cell.load(path, allow_divergent=allow_divergent)
    except (ValueError, OSError, RuntimeError) as error:
        raise BadInputError(" ".join(str(error).split())) from error


def transport_of(bus: str) -> str:
    """Return the kind of a bus address.

    Raises
    ------
    BadInputError
        If it is not one of can, udp, zenoh, loopback.

    Examples
    --------
    >>> transport_of("udp:239.74.163.2")
    'udp'
    """
    kind, colon, _ = bus.partition(":")
    if not colon or kind not in TRANSPORTS:
        message = f"bus = {bus}: allowed can:INTERFACE, udp:ADDRESS[:PORT], zenoh:KEY or loopback:"
        raise BadInputError(message)
    return kind


def _measure(
    disturbance: Callable[[int], ArrayLike] | ArrayLike | None, iterations: int
) -> Callable[[int], ArrayLike] | None:
    """Return a function that gives the disturbance of each run."""
    if disturbance is None or callable(disturbance):
        return disturbance
    rows = np.asarray(disturbance)
    if rows.ndim not in {1, 2} or rows.shape[0] < iterations:
        message = (
            f"disturbance has shape {rows.shape}; (n_runs,) or (n_runs, n_disturbances) "
            f"with at least {iterations} runs is needed"
        )
        raise BadInputError(message)
    if rows.dtype.kind not in "iuf" or not np.isfinite(rows).all():
        message = "disturbance: only finite numbers are allowed"
        raise BadInputError(message)
    table = rows.astype(np.float64)
    return lambda run: np.atleast_1d(table[run])


def _refuse_divergent(law: Law, cell: Cell) -> None:
    try:
        refuse_divergent(law, cell.model(), cell.n_samples)
    except ValueError as error:
        message = f"law = {law!r}: {' '.join(str(error).split())}"
        raise BadInputError(message) from error


def _simulated(transport: str, drives: str) -> bool:
    if drives not in {"auto", "simulated", "external"}:
        message = f"drives = {drives}: allowed auto, simulated or external"
        raise BadInputError(message)
    if transport == "loopback" and drives == "external":
        message = "drives = external: loopback: has no outside; its drives are always simulated"
        raise BadInputError(message)
    return drives == "simulated" or (drives == "auto" and transport != "can")


__all__ = ["Campaign", "CampaignError", "EndEvent", "IterationRecord", "Law", "load_cell"]
