"""A campaign: the same program repeatedly, each run better than the last."""

from __future__ import annotations

import signal
import warnings
from contextlib import closing
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

from ilc_rt._native import Cell, check_options
from ilc_rt.controllers import Controller, InProcessController, ProcessController
from ilc_rt.errors import EXIT_FAULT, BadInputError, CampaignError, FaultError
from ilc_rt.events import EndEvent, Event, IterationEvent, parse_event
from ilc_rt.interruption import ControlledStop
from ilc_rt.options import DEFAULT_LIBRARY, Verb, arguments, options
from ilc_rt.processes import start_simulated_drives
from ilc_rt.record import IterationRecord
from ilc_rt.result import CampaignResult
from ilc_rt.transports import Transport, transport_of

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.experiment import Experiment

DEFAULT_ITERATIONS = int(str(options("run")["iterations"].default))
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
        A learning law with ``update(u, e, disturbance=None)``; None for the cell's own law. With a
        law written in Python the controller runs inside this process; the law is called between
        runs, never in the loop.
    library : path
        Library file that every run is stored in.
    bus : str or None
        Bus address in place of the cell's; `ilc_rt.transports` lists the kinds.
    measure : {"encoder", "tcp"} or None
        Measurement to learn from, in place of the cell's.
    lockstep : bool or None
        Pace the loop by the drives' answers, without a wall clock. None means
        yes for ``loopback:``, no for every other bus.
    drives : {"auto", "simulated", "external"}
        Start simulated drives. "auto" never does so on a CAN bus, where real ones may be listening.
    resume : bool
        Resume the newest campaign of this cell, program, measurement and law.
    learning : bool
        Learn; otherwise every run is like the first.
    frozen : bool
        Run with a learned input and learn nothing: the one of `input_file`, or of the library.
    input_from : int, {"best", "last"} or None
        Run of the library that a frozen input is taken from, by its id; None for the best one.
    input_file : path or None
        File of ``ilc-rt input export`` that a frozen input is loaded from.
    parameters_from : int, {"best", "last"} or None
        Run of the library, of any program of this cell, whose parameters the law begins with, by
        its id: for laws with parameters that hold on every program; None to begin with its own.
    relearn_above : float or None
        Learn again, in a new campaign, when the error of a frozen input is above this many times
        that of the run it comes from. None never does; a `DriftEvent` tells the drift all the same.
    forever : bool
        Run until stopped, in place of a number of runs.
    keep : int, {"all", "best"} or None
        Runs that stay in the library when nothing is learned from them: all, every n-th, or the
        best; the newest always does. None is what the cell description says in ``[library]``.
    ctl : bool
        Accept commands of ``ilc-rt ctl`` on a socket of this user; `StartEvent` has its path.
    start : {"at-once", "command", "input"}
        Start each run at once, when ``ilc-rt ctl CELL start`` asks for it, which needs `ctl`, or at
        a press of the start button among the ``[[input]]`` of the cell.
    disturbance : callable, array_like of float64 or None
        Measured disturbance before each run, e.g. a temperature: stored with
        the run, and given to the law for the next run. Either one row per run,
        shape (n_runs,) or (n_runs, n_disturbances), or a function of the run's
        number (from 0) that is called while the axes return. The controller
        then runs inside this process.
    allow_divergent : bool
        Start the law even if the analysis predicts divergence. A law written in Python is not
        analysed: it always starts. For a `Gate` or a `Ladder` the inner law is analysed.
    require_rt : bool
        Refuse to move anything unless the loop's thread gets its priority, locked memory and, if
        the cell names one, its processor.
    reset_faults : bool
        Reset faults that the drives have when the program starts; otherwise they are named, and
        nothing moves.
    home : bool
        Home the axes that are not homed before anything else; otherwise they are named, and nothing
        moves.
    record : path or None
        Record every tick, all frames and events into a new file, or into a folder under a name of
        its own; ``ilc-rt replay`` repeats it. None is what the cell description says in
        ``[recording]``.
    telemetry : bool
        Publish on Zenoh; never with ``loopback:``.

    Raises
    ------
    CampaignError
        If the cell, the bus or a program is unusable.
    BadInputError
        If the law is predicted to diverge on the cell's model.

    Warns
    -----
    UserWarning
        If the cut-off of the law's low-pass is above the critical frequency, above which the law
        amplifies the error, or the error of the cell's own law will rise before it falls; not with
        `allow_divergent`.

    Notes
    -----
    The controller restores the best input when the error grows (rollback), unless the law is a
    `Gate`, which decides on its own. It notifies any other law that has a method ``taken_back()``.

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
        frozen: bool = False,
        input_from: int | str | None = None,
        input_file: str | Path | None = None,
        parameters_from: int | str | None = None,
        relearn_above: float | None = None,
        forever: bool = False,
        keep: int | str | None = None,
        ctl: bool = False,
        start: Literal["at-once", "command", "input"] = "at-once",
        disturbance: Callable[[int], ArrayLike] | ArrayLike | None = None,
        allow_divergent: bool = False,
        require_rt: bool = False,
        reset_faults: bool = False,
        home: bool = False,
        record: str | Path | None = None,
        telemetry: bool = True,
    ) -> None:
        if isinstance(cell, Cell):
            self.cell = cell
        else:
            # The cell's own law is irrelevant if another one is given.
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
        learns = learning and (not frozen or relearn_above is not None)
        if law is None and learns and not allow_divergent:
            for line in self.cell.warnings:
                warnings.warn(f"{self.cell.path}: {line}", stacklevel=2)
        self.measure = measure
        self.transport = transport_of(self.bus)
        self.lockstep = self.transport.in_process if lockstep is None else lockstep
        self.simulated = _simulated(self.transport, drives)
        self.resume = resume
        self.learning = learning
        self.require_rt = require_rt
        self.reset_faults = reset_faults
        self.home = home
        self.frozen = frozen
        self.input_from = input_from
        self.input_file = input_file
        self.parameters_from = parameters_from
        self.relearn_above = relearn_above
        self.forever = forever
        self.keep = keep
        self.ctl = ctl
        self.start = start
        self.record = record
        self.telemetry = telemetry
        # Excitation in place of the program, for an identification.
        self.experiment: Experiment | None = None
        self.disturbance = disturbance
        self.result = CampaignResult(self.library)
        self._controller: Controller | None = None
        folder = Path(self.library).absolute().parent
        if not folder.is_dir():
            message = f"{self.library}: no such folder: {folder}"
            raise BadInputError(message)

    def run(self, iterations: int | None = None) -> Iterator[IterationRecord]:
        """Run the program and yield one record per run, as it is completed.

        Parameters
        ----------
        iterations : int or None
            Runs in the whole campaign, at least 1, including those before a `resume`; the first is
            without learning. None means 10, or until stopped with `forever`.

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

    def events(self, iterations: int | None = None) -> Generator[Event, None, None]:
        """Run the program and yield every event of the controller.

        Leaving the loop early is a controlled stop of the axes before this iterator is closed.
        Parameters and errors are those of `run`.
        """
        verb, words = self._command(iterations)
        try:
            check_options(verb, words)
        except ValueError as error:
            raise BadInputError(str(error)) from error
        measure = _measure(self.disturbance, iterations)
        self.result = CampaignResult(self.library)
        with ControlledStop(self.interrupt) as stop:
            controller = self._controller = self._start(verb, words, measure)
            try:
                if stop.received is not None:
                    controller.interrupt(stop.received)
                for line in controller.lines():
                    event = parse_event(line)
                    if event is not None:
                        self.result.follow(event)
                        yield event
                if self.keep != "all" and Path(self.library).is_file():
                    self.result.forget_unkept()
                self._check_end(controller)
            finally:
                self._controller = None
                controller.close()
        stop.raise_received()

    def interrupt(self, number: int = signal.SIGINT) -> None:
        """Request a controlled stop of the running controller.

        For signal handlers and other threads; events continue until the axes are at rest.
        """
        if self._controller is not None:
            self._controller.interrupt(number)

    def _command(self, iterations: int | None) -> tuple[Verb, list[str]]:
        """Return verb and options of ``ilc-rt``."""
        values: dict[str, object] = {
            "bus": self.bus, "measure": self.measure, "lockstep": self.lockstep,
            "simulated": self.simulated, "library": self.library, "telemetry": self.telemetry,
            "require_rt": self.require_rt, "reset_faults": self.reset_faults, "home": self.home,
            "record": self.record,
        }  # fmt: skip
        if self.experiment is not None:
            return "identify", arguments("identify", values) + self.experiment.arguments()
        values |= {
            "iterations": iterations, "learning": self.learning, "resume": self.resume,
            "allow_divergent": self.allow_divergent, "frozen": self.frozen,
            "input_from": self.input_from, "input_file": self.input_file,
            "parameters_from": self.parameters_from, "relearn_above": self.relearn_above,
            "forever": self.forever, "keep": self.keep, "ctl": self.ctl, "start": self.start,
        }  # fmt: skip
        return "run", arguments("run", values)

    def _start(
        self, verb: Verb, words: list[str], measure: Callable[[int], ArrayLike] | None
    ) -> Controller:
        cell_file = str(self.cell.path)
        drives = None
        if self.simulated and not self.transport.in_process:
            drives = start_simulated_drives(cell_file, self.bus, lockstep=self.lockstep)
        if self.law is None and measure is None and not self.transport.in_process:
            return ProcessController(cell_file, words, drives, verb=verb)
        return InProcessController(
            {
                "cell": self.cell,
                "arguments": words,
                "verb": verb,
                "law": self.law,
                "disturbance": measure,
            },
            drives,
        )

    def _check_end(self, controller: Controller) -> None:
        failure = controller.failure()
        status = self.result.status
        if status == "fault" or (failure is not None and status == "running"):
            reason = self.result.reason or (failure.reason if failure else "fault")
            code = failure.exit_code if failure else EXIT_FAULT
            if self.result.reason and failure is not None and failure.drives_ended is not None:
                # The controller tells the silence of the drives, and this why they are silent.
                reason = f"{reason} (the simulated drives ended: {failure.drives_ended})"
            cause = failure.__cause__ if failure else None
            fault = self.result.fault
            if fault is not None:
                named = {field.name: getattr(fault, field.name) for field in fields(fault)}
                raise FaultError(exit_code=code, **{**named, "reason": reason}) from cause
            raise CampaignError(reason, code) from cause
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
        Accept a law even if it is predicted to diverge.

    Raises
    ------
    BadInputError
        With file, key, value and the allowed values.
    """
    try:
        return Cell.load(path, allow_divergent=allow_divergent)
    except (ValueError, OSError, RuntimeError) as error:
        raise BadInputError(" ".join(str(error).split())) from error


def _measure(
    disturbance: Callable[[int], ArrayLike] | ArrayLike | None, iterations: int | None
) -> Callable[[int], ArrayLike] | None:
    """Return a function that returns the disturbance of each run."""
    if disturbance is None or callable(disturbance):
        return disturbance
    import numpy as np  # only here: `ilc run` needs no arrays

    rows = np.asarray(disturbance)
    iterations = DEFAULT_ITERATIONS if iterations is None else iterations
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
    from ilc_rt.analysis import refuse_divergent

    try:
        refuse_divergent(law, cell.model(), cell.n_samples)
    except ValueError as error:
        message = f"law = {law!r}: {' '.join(str(error).split())}"
        raise BadInputError(message) from error


def _simulated(transport: Transport, drives: str) -> bool:
    if drives not in {"auto", "simulated", "external"}:
        message = f"drives = {drives}: allowed auto, simulated or external"
        raise BadInputError(message)
    if transport.in_process and drives == "external":
        message = (
            f"drives = external: {transport.name}: has no outside; its drives are always simulated"
        )
        raise BadInputError(message)
    return drives == "simulated" or (drives == "auto" and not transport.has_bits)


__all__ = ["Campaign", "CampaignError", "EndEvent", "IterationRecord", "Law", "load_cell"]
