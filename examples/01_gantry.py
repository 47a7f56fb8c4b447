"""A two-axis gantry learns its contour, run from Python.

The cell description beside this file defines the machine; the drives are simulated inside this
process, in lock-step, so the figures are the same on every computer. Run it with

    python examples/01_gantry.py [RUNS]

It prints one line per run and leaves a picture and a library of the runs in the current folder.
"""

import sys
from pathlib import Path

from ilc_rt import Campaign, plots

HERE = Path(__file__).parent


def main() -> None:
    """Run the campaign and save the picture of the contour."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    campaign = Campaign(HERE / "01_gantry.toml", bus="loopback:", library="01_gantry.db")

    print("run  max tracking  RMS tracking  max contour   (micrometres)")
    for record in campaign.run(runs):
        print(
            f"{record.index:3d}"
            f"{record.tracking_inf_m * 1e6:14.1f}"
            f"{record.tracking_rms_m * 1e6:14.1f}"
            f"{record.contour_inf_m * 1e6:13.1f}"
        )

    print(campaign.result.sentence())
    figure = plots.contour(campaign.result)
    if figure is not None:
        figure.savefig("01_gantry.png", dpi=150)
        print("picture: 01_gantry.png, library: 01_gantry.db")


if __name__ == "__main__":
    main()
