"""The controller brings up and drives a slave that shares no line with this project."""

from __future__ import annotations

import json
import subprocess
from typing import TYPE_CHECKING

import can
import canopen
import pytest
from interop_fixture import data_sheet, disconnect, find_sim
from local_drive_fixture import LocalDrive
from ports_fixture import GROUP, free_port

if TYPE_CHECKING:
    from pathlib import Path

START_COUNTS = 40_000
END_COUNTS = 50_000
CELL = """
[cell]
name = "independent"
cycle_us = 4000
[bus]
address = "udp:{group}:{port}"
[[axis]]
name = "x"
node = 5
interface = "csp"
counts_per_m = 1e6
[axis.limits]
position_min_m = -0.02
position_max_m = 0.10
velocity_max_m_s = 0.5
acceleration_max_m_s2 = 8.0
jerk_max_m_s3 = 1000.0
following_error_max_m = 0.01
[axis.model]
natural_frequency_hz = 80.0
damping = 1.0
[program]
start_m = [0.04]
feed_m_s = 0.1
[[program.segment]]
to_m = [0.05]
[learning]
measure = "encoder"
"""


@pytest.mark.parametrize(
    "quirks",
    ["", "lacks_following_error_time = true\nlacks_emergencies = true"],
    ids=["whole", "short"],
)
def test_a_python_slave_is_brought_up_and_follows(tmp_path: Path, quirks: str) -> None:
    port = free_port()
    cell = tmp_path / "cell.toml"
    text = CELL.format(group=GROUP, port=port)
    cell.write_text(text)
    described = tmp_path / "described.toml"
    table = f"[axis.simulation.quirks]\n{quirks}\n[program]"
    described.write_text(text.replace("[program]", table))
    eds = data_sheet(tmp_path / "slave.eds", described, node=5)
    bus = can.Bus(interface="udp_multicast", channel=GROUP, port=port, hop_limit=0)
    network = canopen.Network(bus=bus)
    network.connect()
    try:
        drive = LocalDrive(network, eds, 5, START_COUNTS)
        run = subprocess.run(
            [find_sim().with_name("ilc-rt"), "run", cell, "--lockstep", "--iterations", "2",
             "--library", tmp_path / "library.db", "--json", tmp_path / "run.json",
             "--no-telemetry"],
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
    finally:
        disconnect(network)
    assert run.returncode == 0, run.stderr
    first, second = json.loads((tmp_path / "run.json").read_text())["iterations"]
    assert first["missing_samples"] == second["missing_samples"] == 0
    # The slave is one cycle late: 0.4 mm at 0.1 m/s, of which learning leaves little.
    assert first["tracking_inf_m"] == pytest.approx(4e-4, abs=5e-6)
    assert second["tracking_inf_m"] < 0.5 * first["tracking_inf_m"]
    assert max(drive.places) == pytest.approx(END_COUNTS, abs=450)
    # It was reset before anything was configured, started once, and not left enabled.
    assert drive.nmt[0] in (0x81, 0x82)
    assert 1 in drive.nmt
    assert not drive.is_enabled
