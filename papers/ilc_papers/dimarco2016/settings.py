"""Response of a machine to a six-point sine: both settings of chapter 2 beside E/S interpolation.

Read by the other modules of this package only.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import TrajectoryError, trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ilc_rt.trajectory import Trajectory

#: The kind of program is the thesis's; its numbers, and the machine's limits, are ours.
FEED_M_S = 0.02
LENGTH_M = 0.1
AMPLITUDE_M = 0.0015
DT_S = 0.001
LIMITS = {"velocity_max_m_s": 0.5, "acceleration_max_m_s2": 10.0, "jerk_max_m_s3": 800.0}
FREQUENCIES_HZ = (2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0)

#: Names in the figures, as `trajectory.modulated` calls them.
WAYS = ("complete", "on_time", "exponential_sigmoid")

#: Fundamental of straight lines between six points of a sine, over the sine's own amplitude.
SIX_POINTS = float(np.sinc(1.0 / 6.0) ** 2)

#: Steps of the search for the frequency, coarse and fine.
COARSE, FINE = 200, 40


def residual(
    t_s: NDArray[np.float64], x_m: NDArray[np.float64], frequency_hz: float
) -> tuple[float, float]:
    """Return the residual of a motion after a line and a sine, and the sine's amplitude."""
    phase = 2.0 * np.pi * frequency_hz * t_s
    basis = np.column_stack((np.ones_like(t_s), t_s, np.sin(phase), np.cos(phase)))
    share = np.linalg.lstsq(basis, x_m, rcond=None)[0]
    return float(np.sum((x_m - basis @ share) ** 2)), float(np.hypot(share[2], share[3]))


def oscillation(path: Trajectory, frequency_hz: float) -> tuple[float, float]:
    """Return frequency and amplitude of the oscillation in the middle half of a path.

    The sine with the smallest residual, in addition to a line; searched from a fifth of the
    programmed frequency to slightly above it.
    """
    middle = slice(path.n_samples // 4, 3 * path.n_samples // 4)
    t_s, x_m = path.t_s[middle], path.position_m[middle, 0]
    grid = np.linspace(0.2, 1.2, COARSE) * frequency_hz
    best = int(np.argmin([residual(t_s, x_m, float(f))[0] for f in grid]))
    low, high = float(grid[max(best - 1, 0)]), float(grid[min(best + 1, COARSE - 1)])
    golden = (math.sqrt(5.0) - 1.0) / 2.0
    for _ in range(FINE):
        left, right = high - golden * (high - low), low + golden * (high - low)
        if residual(t_s, x_m, left)[0] < residual(t_s, x_m, right)[0]:
            high = right
        else:
            low = left
    found_hz = float(0.5 * (low + high))
    return found_hz, residual(t_s, x_m, found_hz)[1]


def planned(way: str, frequency_hz: float) -> Trajectory:
    """Plan the program in one of the `WAYS`."""
    return trajectory.modulated(
        [0.0, LENGTH_M],
        feed_m_s=FEED_M_S,
        amplitude_m=AMPLITUDE_M,
        frequency_hz=frequency_hz,
        dt_s=DT_S,
        interpolation=way,
        **LIMITS,
    )


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return frequency and amplitude ratios over the programmed frequency, and two motions.

    A refused program has no ratio (None), and its reason in `refused`.
    """
    tell("the six-point sine in both machine settings")
    frequencies = FREQUENCIES_HZ[3::4] if reduced else FREQUENCIES_HZ
    found: Figures = {"frequency_hz": list(frequencies), "refused": {}}
    for way in WAYS:
        ratios: list[tuple[float | None, float | None]] = []
        for frequency_hz in frequencies:
            try:
                path = planned(way, frequency_hz)
            except TrajectoryError as refusal:
                found["refused"][f"{frequency_hz:g} Hz"] = str(refusal)
                ratios.append((None, None))
                continue
            found_hz, amplitude_m = oscillation(path, frequency_hz)
            ratios.append((found_hz / frequency_hz, amplitude_m / AMPLITUDE_M))
        found[way] = {
            "frequency_ratio": [ratio for ratio, _ in ratios],
            "amplitude_ratio": [ratio for _, ratio in ratios],
        }
    shown = slice(0, int(0.6 / DT_S), 2)
    motions = {way: planned(way, 8.0) for way in WAYS}
    found["motion"] = {
        "t_s": motions["complete"].t_s[shown].tolist(),
        "programmed_m": motions["exponential_sigmoid"].programmed_m[shown, 0].tolist(),
        **{way: path.position_m[shown, 0].tolist() for way, path in motions.items()},
    }
    found["limits"] = dict(LIMITS)
    return {"settings": found}


def claims(figures: Figures) -> list[Claim]:
    """Return the statements of chapter 2 on the two settings."""
    found = figures["interpolation"]["settings"]
    at = found["frequency_hz"].index(8.0)

    def ratio(way: str, name: str) -> float:
        return float(found[way][f"{name}_ratio"][at])

    inputs = "8 Hz, 1.5 mm, 20 mm/s, 10 m/s², 800 m/s³: ours, the thesis prints none"
    points = f"six points alone leave {SIX_POINTS:.3f} of the amplitude"
    return [
        Claim(
            "frequency kept when every move is completed",
            ratio("complete", "frequency"),
            source="chapter 2",
            holds=ratio("complete", "frequency") < 0.8,
            remark=f"falls; {inputs}",
        ),
        Claim(
            "frequency kept when the next move starts on time",
            ratio("on_time", "frequency"),
            source="chapter 2",
            holds=abs(ratio("on_time", "frequency") - 1.0) < 1e-3,
            remark=inputs,
        ),
        Claim(
            "amplitude kept when the next move starts on time",
            ratio("on_time", "amplitude"),
            source="chapter 2",
            holds=ratio("on_time", "amplitude") < SIX_POINTS,
            remark=f"falls; {points}",
        ),
        Claim(
            "frequency and amplitude kept by E/S, the smaller of the two",
            min(
                ratio("exponential_sigmoid", "frequency"), ratio("exponential_sigmoid", "amplitude")
            ),
            source="section 2.2",
            holds=all(
                abs(ratio("exponential_sigmoid", name) - 1.0) < 1e-3
                for name in ("frequency", "amplitude")
            ),
            remark="above the machine's limits it is refused, where the others lose without a word",
        ),
    ]


LABELS = {
    "complete": "linear, every move completed",
    "on_time": "linear, next move on time",
    "exponential_sigmoid": "E/S",
}


def draw_ratios(figures: Figures, figure: Figure) -> None:
    """Draw frequency and amplitude over the programmed frequency."""
    found = figures["interpolation"]["settings"]
    for axes, name in zip(
        figure.subplots(1, 2, sharex=True), ("frequency", "amplitude"), strict=True
    ):
        for way in WAYS:
            pairs = zip(found["frequency_hz"], found[way][f"{name}_ratio"], strict=True)
            kept = [(f, ratio) for f, ratio in pairs if ratio is not None]
            axes.plot(*zip(*kept, strict=True), marker="o", label=LABELS[way])
        axes.set(xlabel="programmed frequency (Hz)", ylabel=f"{name}, reached over programmed")
        axes.set_ylim(0.0, 1.1)
    axes.axhline(SIX_POINTS, color="0.7", linestyle=":", label="six points alone")
    axes.legend(fontsize="small")


def draw_motion(figures: Figures, figure: Figure) -> None:
    """Draw the first periods of the program in every way."""
    motion = figures["interpolation"]["settings"]["motion"]
    axes = figure.subplots()
    t_s = motion["t_s"]
    axes.plot(t_s, [1e3 * x for x in motion["programmed_m"]], color="0.7", label="programmed")
    for way in WAYS:
        axes.plot(t_s, [1e3 * x for x in motion[way]], linewidth=1.0, label=LABELS[way])
    axes.set(xlabel="time (s)", ylabel="position (mm)", title="Six-point sine, 8 Hz")
    axes.legend(fontsize="small")


PICTURES = (
    Picture(
        "settings-motion",
        "A ramped oscillation as programmed and as interpolated: completing every move delays it, "
        "starting on time flattens it (as Fig. 2.2 and 2.8 to 2.11)",
        draw_motion,
    ),
    Picture(
        "settings-ratios",
        "Frequency and amplitude kept by the two machine settings and by E/S interpolation, which "
        "is refused above the machine's limits (chapter 2)",
        draw_ratios,
    ),
)
