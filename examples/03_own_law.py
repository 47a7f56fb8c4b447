"""A custom learning law, run by the real controller.

A law is any object with `update(u, e, disturbance=None)`. It is called between the runs, never
inside the servo loop, so it may take its time and use anything in Python. Run it with

    python examples/03_own_law.py [RUNS]
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ilc_rt import Campaign

HERE = Path(__file__).parent


class ShiftedErrorLaw:
    """Add a share of the smoothed error, shifted to slightly earlier samples (look-ahead).

    Parameters
    ----------
    gain : float
        Share of the error that is added in one run.
    lead_samples : int
        By how many samples the input is ahead of the error it corrects.
    window_samples : int
        Width of the symmetric window that keeps noise and vibration out.
    """

    def __init__(self, gain: float, lead_samples: int, window_samples: int) -> None:
        self.gain = gain
        self.lead_samples = lead_samples
        self.window = np.hanning(window_samples + 2)[1:-1]
        self.window /= self.window.sum()

    def update(
        self,
        u: NDArray[np.float64],
        e: NDArray[np.float64],
        disturbance: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the next input; all shapes are (n_samples, n_axes), in m."""
        del disturbance  # this law ignores disturbances
        ahead = np.concatenate((e[self.lead_samples :], np.zeros_like(e[: self.lead_samples])))
        wanted = u + self.gain * ahead
        return np.column_stack([np.convolve(axis, self.window, "same") for axis in wanted.T])


def main() -> None:
    """Run a campaign with the law above and print the falling error."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    law = ShiftedErrorLaw(gain=0.5, lead_samples=12, window_samples=21)
    campaign = Campaign(HERE / "01_gantry.toml", law=law, bus="loopback:", library="03_own_law.db")
    for record in campaign.run(runs):
        print(f"run {record.index}: RMS tracking error {record.tracking_rms_m * 1e6:8.1f} µm")
    print(campaign.result.sentence())


if __name__ == "__main__":
    main()
