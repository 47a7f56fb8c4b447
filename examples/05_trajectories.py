"""The same feed with a superimposed oscillation, three ways, and a butterfly.

A modulated tool path breaks chips by an oscillation along the feed. A machine that completes every
move loses frequency, one that starts the next on time loses amplitude; exponential/sigmoid (E/S)
interpolation loses neither. Run it with

    python examples/05_trajectories.py

It prints one line per trajectory and leaves a picture in the current folder.
"""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ilc_rt import trajectory

DT_S = 0.001
LIMITS = {"velocity_max_m_s": 0.5, "acceleration_max_m_s2": 10.0, "jerk_max_m_s3": 800.0}
WAYS = {
    "exponential_sigmoid": "E/S interpolation",
    "complete": "six-point sine, every move completed",
    "on_time": "six-point sine, next move on time",
}


def main() -> None:
    """Plan the trajectories, print their figures, and save the picture."""
    figure = Figure(figsize=(11, 5), layout="constrained")
    FigureCanvasAgg(figure)
    over_time, plane = figure.subplots(1, 2)
    print("trajectory                             lasts     tracking J   planned in")
    for way, title in WAYS.items():
        path = trajectory.modulated(
            [0.0, 0.06], feed_m_s=0.02, amplitude_m=0.0015, frequency_hz=8.0, dt_s=DT_S,
            interpolation=way, **LIMITS,
        )  # fmt: skip
        tracking, _ = trajectory.tracking_index(path, k_e=600.0, k_a=0.0)
        print(f"{title:38s}{path.t_s[-1]:6.2f} s{tracking:14.3e}{path.computing_s * 1e3:10.1f} ms")
        over_time.plot(path.t_s[:1000], path.position_m[:1000, 0] * 1e3, label=title)
    over_time.set(xlabel="time (s)", ylabel="position (mm)", title="Modulated tool path, 8 Hz")
    over_time.legend(fontsize="small")

    contour = trajectory.butterfly(dt_s=0.002, curvature_acceleration_max_m_s2=0.02, **LIMITS)
    speed_m_s = np.hypot(*contour.velocity_m_s.T)
    print(f"{'butterfly':38s}{contour.t_s[-1]:6.2f} s{'':14s}{contour.computing_s * 1e3:10.1f} ms")
    points = plane.scatter(*(contour.position_m.T * 1e3), c=speed_m_s * 1e3, s=2)
    figure.colorbar(points, ax=plane, label="speed (mm/s)")
    plane.set(xlabel="x (mm)", ylabel="y (mm)", title="Butterfly, speed limited by curvature")
    plane.set_aspect("equal")
    figure.savefig("05_trajectories.png", dpi=150)
    print("picture: 05_trajectories.png")


if __name__ == "__main__":
    main()
