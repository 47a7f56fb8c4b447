"""Records of runs in memory, of the same type as those of the controller.

Imported by what makes runs without a controller: `ilc_rt.ask_tell`.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.deviation import path_deviation
from ilc_rt.record import IterationRecord

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Smallest range of a coordinate that counts as motion.
MOVES_M = 1e-9


def record_of(
    index: int,
    u: Array,
    e: Array,
    reference: Array,
    disturbance: Array | None = None,
    *,
    unit: str = "m",
    library: str = "",
    id: int | None = None,
    update_ms: float = 0.0,
    law_parameters: str = "{}",
) -> IterationRecord:
    """Return the record of a run that was made outside of the controller.

    Parameters
    ----------
    index : int
        Number of the run, from 0.
    u, e, reference : ndarray of float64, shape (n_samples, n_channels)
        Input, error and reference.
    disturbance : ndarray of float64 or None, shape (n_disturbances,)
        Measured disturbance.
    unit : str
        Unit of the error; only lengths (``"m"``) have a contour.
    library, id : str, int or None
        File and key, if it is stored.
    update_ms : float
        Computing time of the law for this input.
    law_parameters : str
        JSON text of the law's parameters.

    Returns
    -------
    IterationRecord
        With its signals in memory.

    Examples
    --------
    >>> one = np.ones((4, 1))
    >>> record_of(0, 0 * one, 2 * one, one).tracking_rms_m
    2.0
    """
    measured = reference - e
    contour = _contour(reference, measured) if unit == "m" else None
    signals: dict[str, Any] = {
        "reference_m": reference, "input": u, "encoder_m": measured, "tool_m": None, "error_m": e,
        "contour_m": contour, "disturbance": disturbance, "law_parameters": law_parameters,
    }  # fmt: skip
    largest = tuple(np.abs(e).max(axis=0, initial=0.0).tolist())
    rms = tuple(np.sqrt(np.mean(e * e, axis=0)).tolist())
    return IterationRecord(
        library=library,
        id=index if id is None else id,
        index=index,
        tracking_inf_m=max(largest, default=0.0),
        tracking_rms_m=float(np.sqrt(np.mean(np.sum(e * e, axis=1)))),
        contour_inf_m=None if contour is None else float(contour.max()),
        contour_rms_m=None if contour is None else float(np.sqrt(np.mean(contour * contour))),
        axes_tracking_inf_m=largest,
        axes_tracking_rms_m=rms,
        encoder_tracking_inf_m=max(largest, default=0.0),
        update_ms=update_ms,
        digest=digest_of(u, e, reference, disturbance),
        _loaded=signals,
    )


def digest_of(*signals: Array | None) -> str:
    """Return the SHA-256 of arrays: equal exactly if they are the same bit by bit.

    Examples
    --------
    >>> digest_of(np.zeros(3)) == digest_of(np.zeros(3)), digest_of(None)[:8]
    (True, '6e340b9c')
    """
    digest = hashlib.sha256()
    for signal in signals:
        if signal is None:
            digest.update(b"\0")
            continue
        digest.update(repr(signal.shape).encode())
        digest.update(np.ascontiguousarray(signal, dtype="<f8").tobytes())
    return digest.hexdigest()


def _contour(reference: Array, measured: Array) -> Array | None:
    moving = [axis for axis in range(reference.shape[1]) if np.ptp(reference[:, axis]) > MOVES_M]
    if len(moving) < 2:
        return None
    return np.asarray(np.linalg.norm(path_deviation(reference, measured), axis=1))
