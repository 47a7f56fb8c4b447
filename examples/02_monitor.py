"""Monitor a learning controller from any computer on the network.

Start this in one terminal and `ilc run examples/01_gantry.toml` in another:

    python examples/02_monitor.py [RUNS] [ENDPOINT]

It prints the error of each run as it falls, and ends after RUNS runs. With an ENDPOINT, e.g.
tcp/192.168.1.5:7447, it connects there instead of discovering the local network. A monitor cannot
command anything.
"""

import math
import sys

from ilc_rt.events import IterationEvent
from ilc_rt.monitor import Monitor

BAR_PER_DECADE = 16


def main() -> None:
    """Follow the cell `gantry` and draw its tracking error as bars."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    endpoints = sys.argv[2:]
    seen = 0
    with Monitor("gantry", connect=endpoints, scouting=not endpoints) as monitor:
        print("waiting for a run of the cell gantry", flush=True)
        for message in monitor.messages():
            if message.topic == "fault":
                print("fault:", message.payload["reason"], flush=True)
            if isinstance(message.event, IterationEvent):
                run, error_um = message.event.index, message.event.tracking_inf_m * 1e6
                length = round(BAR_PER_DECADE * math.log10(1.0 + error_um))
                print(f"run {run:3d}: {error_um:9.1f} µm {'#' * length}", flush=True)
                seen += 1
                if seen >= runs:
                    break


if __name__ == "__main__":
    main()
