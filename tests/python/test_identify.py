"""Identification on the real loop: a cell without friction, with noise on its encoders."""

import json
import subprocess
from pathlib import Path

import pytest

from ilc_rt import Cell, identify
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.events import StartEvent
from ilc_rt.processes import find_program
from ilc_rt.repeatable import check_repeatability

DT_S = 0.002

CELL = """
[cell]
name = "bench"
cycle_us = 1000

[bus]
address = "loopback:"

[[axis]]
name = "x"
node = 1
interface = "csp"
counts_per_m = 1e8

[axis.limits]
position_min_m = -0.05
position_max_m = 0.05
velocity_max_m_s = 0.5
acceleration_max_m_s2 = 20.0
jerk_max_m_s3 = 5000.0
following_error_max_m = 0.01

[axis.model]
natural_frequency_hz = 5.0
damping = 1.0

[axis.simulation]
mass_kg = 20.0
natural_frequency_hz = 12.0
damping = 0.5
integral_time_s = 1000.0
force_max_n = 20000.0

[[axis]]
name = "y"
node = 2
interface = "csv"
counts_per_m = 1e8

[axis.limits]
position_min_m = -0.05
position_max_m = 0.05
velocity_max_m_s = 0.5
acceleration_max_m_s2 = 20.0
jerk_max_m_s3 = 5000.0
following_error_max_m = 0.01

[axis.position_loop]
gain_per_s = 40.0

[axis.model]
velocity_bandwidth_hz = 10.0

[axis.simulation]
mass_kg = 20.0
natural_frequency_hz = 15.0
damping = 1.0
integral_time_s = 1000.0
force_max_n = 20000.0

[simulation]
encoder_noise_m = 2e-7
step_us = 125

[program]
start_m = [0.0, 0.0]
feed_m_s = 0.1
corner = "blend"

[[program.segment]]
to_m = [0.02, 0.0]

[[program.segment]]
to_m = [0.02, 0.02]

[learning]
law = "norm_optimal"
measure = "encoder"
input_max_m = 0.005

[learning.norm_optimal]
rate = 3.0
"""


@pytest.fixture
def bench(tmp_path):
    """Return a cell without friction, with noise on its encoders."""
    path = tmp_path / "bench.toml"
    path.write_text(CELL)
    return path


@pytest.mark.parametrize("experiment", [identify.swept_sine, identify.multisine])
def test_a_simulated_axis_is_identified_within_two_percent_through_the_loop(bench, experiment):
    events = []
    found = experiment(
        bench, axis="x", amplitude=1e-3, from_hz=1.0, to_hz=20.0, period_s=6.0, periods=3,
        observe=events.append,
    )  # fmt: skip
    start = next(event for event in events if isinstance(event, StartEvent))
    assert (start.mode, start.law) == ("lockstep", "excitation")
    assert found.model.gain == pytest.approx(1.0, rel=0.02)
    assert found.model.natural_frequency_hz == pytest.approx(12.0, rel=0.02)
    assert found.model.damping == pytest.approx(0.5, rel=0.02)
    assert found.described.natural_frequency_hz == pytest.approx(12.0, rel=0.05)
    # The noise is present, and its effect is known.
    assert found.coherence.max() < 1.0
    assert 1e-8 < found.model.natural_frequency_deviation_hz < 0.1
    assert f"delay_samples = {found.model.delay_samples}" in found.section()


def test_a_velocity_loop_is_identified_through_its_position_loop(bench):
    found = identify.multisine(
        bench, axis="y", from_hz=1.0, to_hz=25.0, period_s=5.0, periods=3, at_m=0.01
    )
    assert found.interface == "csv"
    assert found.model.gain == pytest.approx(1 / 40.0, rel=0.02)
    # 2 delta f0 of the simulated velocity loop: 30 Hz.
    line = next(line for line in found.section().splitlines() if "velocity_bandwidth" in line)
    assert float(line.split("=")[1]) == pytest.approx(30.0, rel=0.05)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("cell", ["10_cst", "11_csp_torque", "12_csp_velocity", "13_csv_torque"])
def test_every_cell_with_an_offset_has_a_default_that_gives_a_model(ilc, cell, axis):
    found = ilc(
        "identify", Path(f"examples/{cell}.toml").resolve(), "--axis", axis, "--bus", "loopback:"
    )
    assert found.returncode == 0, found.stdout + found.stderr
    assert "[axis." in found.stdout


@pytest.mark.parametrize(
    ("cell", "axis", "mass_kg"), [("11_csp_torque", "y", 20.0), ("13_csv_torque", "y", 20.0)]
)
def test_a_torque_shows_the_mass(cell, axis, mass_kg):
    found = identify.multisine(
        f"examples/{cell}.toml",
        axis=axis,
        measure="encoder",
        bus="loopback:",
        from_hz=3.0,
        to_hz=30.0,
    )
    assert (found.input_unit, found.doubt) == ("N", None)
    section = found.section()
    assert "[axis.force]" in section
    line = next(line for line in section.splitlines() if line.startswith("mass_kg"))
    assert float(line.split("=")[1]) == pytest.approx(mass_kg, rel=0.25)


def test_a_velocity_offset_shows_the_position_loop_of_the_drive():
    found = identify.multisine(
        "examples/12_csp_velocity.toml", axis="y", measure="encoder", bus="loopback:"
    )
    assert (found.input_unit, found.doubt) == ("m/s", None)
    line = next(line for line in found.section().splitlines() if "natural_frequency" in line)
    assert float(line.split("=")[1]) == pytest.approx(15.0, rel=0.15)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"amplitude": 0.006, "to_hz": 2.0}, "learning.input_max_m = 0.006"),
        ({"amplitude": 0.002, "to_hz": 40.0}, "limits.acceleration_max_m_s2"),
        ({"amplitude": 1e-3, "at_m": 0.0499}, "way to the end of the axis"),
        ({"amplitude": 1e-3, "from_hz": 0.01}, "5 cycles"),
        ({"amplitude": 1e-3, "to_hz": 480.0}, "to_hz"),
        ({"amplitude": -1.0}, "amplitude = -1"),
        ({"axis": "z"}, "has x, y"),
        ({"axis": None}, "has x, y"),
    ],
)
def test_nothing_moves_beyond_a_limit(bench, options, said):
    events = []
    with pytest.raises(CampaignError, match=said) as refusal:
        identify.multisine(bench, **{"axis": "x", "observe": events.append, **options})
    assert refusal.value.exit_code == 2
    assert events == []


def test_a_refusal_names_the_amplitude_that_would_do(bench):
    options = {"axis": "x", "to_hz": 30.0, "period_s": 5.0, "periods": 2}
    with pytest.raises(CampaignError) as refusal:
        identify.multisine(bench, amplitude=4.9e-3, **options)
    most = float(str(refusal.value).split("an amplitude of ")[1].split()[0])
    assert 0 < most < 4.9e-3
    found = identify.multisine(bench, amplitude=0.99 * most, **options)
    assert found.experiment.amplitude == pytest.approx(0.99 * most)
    assert found.u.max() <= most
    half = identify.multisine(bench, **options)
    assert half.experiment.amplitude == pytest.approx(most / 2, rel=1e-3)


def test_the_command_writes_figures_picture_and_section(ilc, bench, tmp_path):
    done = ilc(
        "identify", bench, "--axis", "x", "--waveform", "sweep", "--amplitude", "0.001",
        "--to-hz", "20", "--period-s", "5", "--periods", "2",
        "--json", "x.json", "--report", "pictures",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "[axis.model]\nnatural_frequency_hz = 1" in done.stdout
    figures = json.loads((tmp_path / "x.json").read_text())
    assert figures["model"]["natural_frequency_hz"] == pytest.approx(12.0, rel=0.02)
    assert len(figures["coherence"]) == len(figures["uncertainty"]["bound"]) == 96
    assert (tmp_path / "pictures" / "identify-x.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("--method", "--waveform"),
        ("--duration-s", "--period-s"),
        ("--amplitude-m", "--amplitude"),
        ("--amplitude-m-s", "--amplitude"),
    ],
)
def test_an_option_of_an_older_version_is_refused_with_its_new_name(ilc, bench, old, new):
    by_rust = subprocess.run(
        [find_program("ilc-rt"), "identify", bench, "--axis", "x", old, "5"],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    for done in (ilc("identify", bench, "--axis", "x", old, "5"), by_rust):
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert f"this option is now {new}" in done.stderr, done.stderr


def test_an_axis_that_sticks_gets_no_model(ilc, bench, tmp_path):
    friction = "mass_kg = 20.0\ncoulomb_n = 60.0\nstatic_n = 90.0"
    bench.write_text(CELL.replace("mass_kg = 20.0", friction))
    done = ilc(
        "identify", bench, "--axis", "x", "--amplitude", "0.00002", "--to-hz", "20",
        "--period-s", "5", "--periods", "2", "--json", "x.json",
    )  # fmt: skip
    assert done.returncode == 1
    assert "no model for axis x" in done.stderr
    assert "[axis.model]" not in done.stdout
    assert json.loads((tmp_path / "x.json").read_text())["doubt"]


def test_what_was_identified_can_be_pasted_back(bench):
    found = identify.multisine(bench, axis="x", from_hz=1.0, to_hz=20.0, period_s=5.0, periods=2)
    old = "[axis.model]\nnatural_frequency_hz = 5.0\ndamping = 1.0\n"
    assert old in CELL
    bench.write_text(CELL.replace(old, found.section()))
    assert Cell.load(bench).interfaces == ["csp", "csv"]


def test_repeatability_of_a_cell(bench, ilc, tmp_path):
    found = check_repeatability(bench, runs=3)
    assert [axis.axis for axis in found.axes] == ["x", "y"]
    # Without learning, all runs are equal up to the encoders' noise.
    assert found.axes[0].non_repeatable_rms_m < 1e-6
    assert found.axes[0].repeatable_rms_m > 1e-4
    assert found.applicable
    done = ilc("repeatability", bench, "--runs", "2", "--json", "r.json")
    assert done.returncode == 0, done.stderr
    figures = json.loads((tmp_path / "r.json").read_text())
    assert [axis["verdict"] for axis in figures["axes"]] == ["yes", "yes"]
    with pytest.raises(BadInputError, match="runs = 1"):
        check_repeatability(bench, runs=1)


def test_a_band_that_ends_too_low_is_widened(bench):
    # The cell states 5 Hz, the axis has 12 Hz.
    told = []
    found = identify.multisine(bench, axis="x", periods=2, tell=told.append)
    assert found.described.natural_frequency_hz == pytest.approx(12.0, rel=0.05)
    assert found.experiment.to_hz > 12.0
