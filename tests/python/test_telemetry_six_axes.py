"""Telemetry of six axes at 1 kHz: all of it arrives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from processes_fixture import PATIENT, Bench
from telemetry_fixture import Watcher, endpoint, start, telemetry

from ilc_rt import ReadOnlyLibrary

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.xdist_group("six axes")

RUNS = 2
SIX = """\
[cell]
name = "gantry"
cycle_us = 1000

[bus]
address = "loopback:"
{axes}
[program]
start_m = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
feed_m_s = 0.1
corner = "exact_stop"

[[program.segment]]
to_m = [0.05, 0.04, 0.03, 0.02, 0.01, 0.05]

[learning]
law = "pd"
measure = "encoder"
input_max_m = 0.005

[learning.pd]
kp = 0.5
kd = 0.0
"""
AXIS = """
[[axis]]
name = "a{node}"
node = {node}
interface = "csp"
counts_per_m = 1e8

[axis.limits]
position_min_m = -0.02
position_max_m = 0.10
velocity_max_m_s = 0.5
acceleration_max_m_s2 = 8.0
jerk_max_m_s3 = 1000.0
following_error_max_m = 0.05

[axis.model]
natural_frequency_hz = 15.0
damping = 1.0
delay_samples = 3

[axis.simulation]
mass_kg = {node}.0
natural_frequency_hz = 15.0
damping = 1.0
"""


def test_no_sample_of_six_axes_at_1_khz_is_lost_on_one_host(tmp_path: Path) -> None:
    """Every cycle from the first to the last of every run, as it is in the library."""
    with Bench(tmp_path) as bench:
        ours = endpoint()
        axes = "".join(AXIS.format(node=node) for node in range(1, 7))
        cell = bench.folder / "six.toml"
        cell.write_text(SIX.format(axes=axes) + PATIENT + telemetry(connect=[ours]))
        watcher = Watcher(listen=[ours])
        try:
            bench.drives(cell)
            controller = start(bench, cell, "--simulated-drives", runs=RUNS)
            assert controller.end() == 0, controller.errors
            watcher.wait_for_tokens("alive", "gone")
            batches = watcher.heard["servo"]
        finally:
            watcher.session.close()
        library = ReadOnlyLibrary(bench.library)
        runs = [library.load(run["id"]) for run in library]
    firsts = [batch["first_sync"] for batch in batches]
    assert firsts == list(range(0, 50 * len(batches), 50))
    assert {len(row) for batch in batches for row in batch["encoder_m"]} == {6}
    assert len(runs) == RUNS
    heard = {
        tuple(place): row
        for batch in batches
        for place, row in zip(batch["iteration_and_sample"], batch["encoder_m"], strict=True)
        if place is not None
    }
    assert len(heard) == sum(len(run["encoder_m"]) for run in runs)
    for number, run in enumerate(runs):
        rows = [heard[number, k] for k in range(len(run["encoder_m"]))]
        np.testing.assert_array_equal(np.array(rows, dtype=float), run["encoder_m"])
