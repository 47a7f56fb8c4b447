"""Picture of runs of different campaigns, laid over each other by their references."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from ilc_rt.pictures.given import (
    Results,
    Runs,
    axes_or_new,
    base_unit,
    colours,
    largest,
    shown_runs,
    suitable_unit,
    values_of,
    with_unit,
)
from ilc_rt.pictures.themes import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["overlay", "shift_of"]

# Smallest correlation of two references that count as the same motion.
SAME_MIN = 0.7


def overlay(
    results: Results,
    what: str = "error",
    *,
    run: Runs = -1,
    axis: int = 0,
    ax: Axes | None = None,
) -> Axes:
    """Draw a signal of runs of different campaigns over a common time.

    Campaigns may wait differently before the motion, or sample at another rate: each run is shifted
    in time until the velocities of its reference and of the first one correlate best. A label says
    the shift.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn; the keys of a mapping are the labels, otherwise the laws.
    what : {"error", "input", "output"}
        Signal.
    run : int or sequence of int
        Number of the run, or of several; negative ones count from the last.
    axis : int
        Channel.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If there is no such signal, run or channel, or a reference is another motion than the first.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, pictures, simulate
    >>> motion = np.hanning(100)
    >>> first = simulate([0.0, 1.0], PdIlc(kp=0.5), motion, dt_s=0.01)
    >>> late = simulate([0.0, 1.0], PdIlc(kp=0.5), np.append(np.zeros(7), motion), dt_s=0.01)
    >>> lines = pictures.overlay({"first": first, "late": late}).lines
    >>> [line.get_label() for line in lines]
    ['first', 'late, shifted by -70 ms']
    """
    shown = [
        (name, result, record.reference_m[:, axis], values_of(record, what, axis))
        for name, result, record in shown_runs(results, run)
    ]
    _, first, reference, _ = shown[0]
    unit = suitable_unit(base_unit(first, what, axis), [largest(part[3]) for part in shown])
    shifts_s = []
    for name, result, own, _ in shown:
        shift_s, same = shift_of(reference, first.cycle_s, own, result.cycle_s)
        if same < SAME_MIN:
            message = (
                f"{name}: its reference is another motion than that of {shown[0][0]} "
                f"(correlation {same:.2f}; {SAME_MIN} is needed)"
            )
            raise ValueError(message)
        shifts_s.append(shift_s)
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        for (name, result, _, values), shift_s, colour in zip(
            shown, shifts_s, colours(), strict=False
        ):
            time_s = np.arange(len(values)) * result.cycle_s + shift_s
            told = f", shifted by {1e3 * shift_s:+.3g} ms" if abs(shift_s) > 1e-9 else ""
            axes.plot(time_s, values * unit.scale, color=colour, linewidth=1.2, label=name + told)
        axes.set_xlabel(f"time of {shown[0][0]} in s")
        axes.set_ylabel(with_unit(what, unit))
        axes.legend()
    return axes


def shift_of(
    first: Array, first_dt_s: float, second: Array, second_dt_s: float
) -> tuple[float, float]:
    """Return the time by which a reference must be shifted to lie on another, and how well it does.

    Parameters
    ----------
    first, second : ndarray of float64, shape (n_samples,)
        References.
    first_dt_s, second_dt_s : float
        Their sample times in s.

    Returns
    -------
    shift_s : float
        Time to be added to that of `second`, a multiple of the shorter sample time.
    correlation : float
        Largest correlation of the velocities, 1 for the same motion.

    Examples
    --------
    >>> import numpy as np
    >>> shift_s, same = shift_of(np.hanning(50), 0.01, np.append(np.zeros(5), np.hanning(50)), 0.01)
    >>> round(shift_s, 6), round(same, 6)
    (-0.05, 1.0)
    """
    dt_s = min(first_dt_s, second_dt_s)
    velocities = []
    for values, own_s in ((first, first_dt_s), (second, second_dt_s)):
        n = int(np.floor((len(values) - 1) * own_s / dt_s + 1e-9)) + 1
        fine = np.interp(np.arange(n) * dt_s, np.arange(len(values)) * own_s, values)
        velocities.append(np.diff(fine))
    a, b = velocities
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    if size == 0.0:
        # An axis that rests in both is the same anywhere.
        same = not a.any() and not b.any()
        return 0.0, 1.0 if same else 0.0
    n = 1 << (len(a) + len(b)).bit_length()
    products = np.fft.irfft(np.fft.rfft(a, n) * np.conj(np.fft.rfft(b, n)), n)
    lags = np.arange(-(len(b) - 1), len(a))
    found = products[lags % n]
    best = int(np.argmax(found))
    return float(lags[best] * dt_s), float(found[best] / size)
