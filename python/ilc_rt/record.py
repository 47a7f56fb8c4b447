"""One run of the program: its figures, and its signals on demand."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from ilc_rt.errors import BadInputError
from ilc_rt.figures import Figures
from ilc_rt.read_only import ReadOnlyLibrary

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from ilc_rt.events import IterationEvent

FIGURES = ("id", "index", *(figure.name for figure in fields(Figures)), "digest")
SIGNALS = ("reference_m", "input", "encoder_m", "tool_m", "error_m", "contour_m")


@dataclass(frozen=True, slots=True, kw_only=True)
class IterationRecord(Figures):
    """One run: figures at once, signals from the library when asked for.

    Attributes
    ----------
    library : str
        File of the library.
    id, index : int
        Key in the library; number of the run in its campaign, from 0.
    digest : str
        SHA-256 of the arrays.

    Notes
    -----
    The other attributes are the figures of `ilc_rt.figures.Figures`.

    Examples
    --------
    >>> record = IterationRecord(library="x.db", id=1, index=0,
    ...     tracking_inf_m=2e-3, tracking_rms_m=1e-3)
    >>> record.tracking_inf_m
    0.002
    """

    library: str
    id: int
    index: int
    digest: str = ""
    _loaded: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def from_event(cls, event: IterationEvent, library: str) -> IterationRecord:
        """Return the record of an iteration event."""
        return cls(library=library, **{name: getattr(event, name) for name in FIGURES})

    @classmethod
    def from_row(cls, row: Mapping[str, Any], library: str) -> IterationRecord:
        """Return the record of one row of `Library.list`."""
        values = {name: row[name] for name in FIGURES if name in row}
        values |= {name: tuple(v) for name, v in values.items() if isinstance(v, list)}
        return cls(library=library, **values)

    def figures(self) -> dict[str, Any]:
        """Return the figures by name, in the order of the JSON file."""
        return {name: getattr(self, name) for name in FIGURES}

    @property
    def reference_m(self) -> NDArray[np.float64]:
        """Programmed position in m, shape (n_samples, n_axes)."""
        return self._signal("reference_m")

    @property
    def input(self) -> NDArray[np.float64]:
        """Learned input, shape (n_samples, n_axes), in m, m/s or N."""
        return self._signal("input")

    @property
    def encoder_m(self) -> NDArray[np.float64]:
        """Encoder positions of the drives in m, shape (n_samples, n_axes)."""
        return self._signal("encoder_m")

    @property
    def tool_m(self) -> NDArray[np.float64] | None:
        """Measured tool centre point in m, shape (n_samples, n_axes), or None."""
        return self._optional("tool_m")

    @property
    def error_m(self) -> NDArray[np.float64]:
        """Tracking error learned from in m, shape (n_samples, n_axes)."""
        return self._signal("error_m")

    @property
    def contour_m(self) -> NDArray[np.float64] | None:
        """Distance from the programmed path in m, shape (n_samples,), or None."""
        # Older libraries contain rounding errors for a path without a contour.
        return None if self.contour_inf_m is None else self._optional("contour_m")

    @property
    def disturbance(self) -> NDArray[np.float64] | None:
        """Measured disturbance before the run, shape (n_disturbances,), or None."""
        return self._optional("disturbance")

    @property
    def tool_or_encoder_m(self) -> NDArray[np.float64]:
        """Measurement of the contour: at the tool if it is measured, else at the encoders."""
        tool = self.tool_m
        return self.encoder_m if tool is None else tool

    @property
    def law_parameters(self) -> str:
        """JSON text of the law's parameters."""
        return str(self.row().get("law_parameters") or "{}")

    def row(self) -> dict[str, Any]:
        """Return everything stored in the library about this run.

        Raises
        ------
        BadInputError
            If the library or its run does not exist any more.
        """
        if not self._loaded:
            try:
                self._loaded.update(ReadOnlyLibrary(self.library).load(self.id))
            except FileNotFoundError as error:
                raise BadInputError(str(error)) from error
        return self._loaded

    def _optional(self, name: str) -> NDArray[np.float64] | None:
        value = self.row().get(name)
        if value is None:
            return None
        import numpy as np  # only here: the program `ilc` starts without it

        return np.asarray(value, dtype=np.float64)

    def _signal(self, name: str) -> NDArray[np.float64]:
        value = self._optional(name)
        if value is None:
            message = f"{self.library}: run {self.id} holds no {name}"
            raise BadInputError(message)
        return value
