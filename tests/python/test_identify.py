"""Identification: its steps against SciPy, and all of it on the real loop."""

import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy import signal as scipy_signal
from tuning_fixture import learn

from ilc_rt import Cell, ModelError, discretize, identify, second_order
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.events import StartEvent
from ilc_rt.processes import find_program
from ilc_rt.repeatable import check_repeatability, compare_runs
from ilc_rt.tuning import propose_weights

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


def noisy_pair(seed=0, n=6000):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=n)
    axis = discretize(second_order(120.0, 0.4), DT_S)
    return u, axis.simulate(u) + 0.2 * rng.normal(size=n)


@pytest.mark.parametrize(("segment", "overlap"), [(512, 256), (500, 100), (301, 0)])
def test_response_and_coherence_agree_with_scipy(segment, overlap):
    u, y = noisy_pair()
    found = identify.frequency_response(
        u, y, DT_S, segment_samples=segment, overlap_samples=overlap
    )
    options = {"fs": 1 / DT_S, "nperseg": segment, "noverlap": overlap}
    f, uy = scipy_signal.csd(u, y, **options)
    _, uu = scipy_signal.welch(u, **options)
    _, coherence = scipy_signal.coherence(u, y, **options)
    np.testing.assert_allclose(found.frequency_hz, f, rtol=1e-12)
    np.testing.assert_allclose(found.response, uy / uu, rtol=1e-9)
    np.testing.assert_allclose(found.coherence, coherence, rtol=1e-9)


def test_the_deviation_is_that_of_repeated_estimates():
    estimates, claimed = [], []
    for seed in range(60):
        found = identify.frequency_response(*noisy_pair(seed), DT_S, segment_samples=400)
        estimates.append(found.response[5:40])
        claimed.append(found.relative_deviation()[5:40])
    relative = np.array(estimates) / np.mean(estimates, axis=0)
    seen = np.sqrt(np.mean(np.std(relative.real, axis=0) ** 2))
    assert seen == pytest.approx(np.sqrt(np.mean(np.square(claimed))), rel=0.15)


@pytest.mark.parametrize("experiment", [identify.swept_sine, identify.multisine])
def test_a_function_is_identified_exactly(experiment):
    axis = discretize(second_order(2 * np.pi * 12.0, 0.5), DT_S).delayed(2)
    found = experiment(axis.simulate, dt_s=DT_S, amplitude=1e-3, from_hz=1.0, to_hz=60.0)
    assert found.model.gain == pytest.approx(1.0, rel=1e-5)
    assert found.model.natural_frequency_hz == pytest.approx(12.0, rel=1e-5)
    assert found.model.damping == pytest.approx(0.5, rel=1e-5)
    assert found.model.delay_s == pytest.approx(2 * DT_S, abs=1e-7)
    assert found.model.delay_samples == 2
    np.testing.assert_allclose(
        found.response, axis.frequency_response(2 * np.pi * found.frequency_hz)[:, 0, 0], rtol=1e-4
    )
    assert found.uncertainty[1].max() < 1e-3


def test_uncertainty_covers_a_mode_that_the_model_leaves_out():
    rigid, mode = second_order(2 * np.pi * 10.0, 0.7), second_order(2 * np.pi * 35.0, 0.1)
    axis = discretize(rigid.series(mode), DT_S)
    found = identify.multisine(axis.simulate, dt_s=DT_S, amplitude=1e-3, to_hz=45.0)
    model = found.described.response(found.frequency_hz)
    frequency_hz, bound = found.uncertainty
    assert (bound >= np.abs(found.response / model - 1.0) - 1e-12).all()
    assert frequency_hz[np.argmax(bound)] > 20.0
    assert bound.max() > 0.2
    grid = found.uncertainty_on_grid(501)
    assert grid.shape == (501,)
    assert (grid[-10:] >= 1.0).all()
    assert grid[20] == pytest.approx(np.interp(10.0, frequency_hz, bound))
    data = found.frequency_hz, found.response, 2, 4
    flexible = identify.fit_rational(*data, delay_s=DT_S / 2)
    assert flexible.residual_rms < 1e-3
    assert flexible.reflected_poles == 0
    assert (flexible.model.poles().real < 0).all()


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


def test_wrong_arguments_are_named_one_at_a_time():
    def axis(u):
        return u

    good = {"dt_s": DT_S, "amplitude": 1.0}
    with pytest.raises(ValueError, match="--periods"):
        identify.multisine(axis, periods=1, **good)
    with pytest.raises(ValueError, match="dt_s and amplitude"):
        identify.multisine(axis)
    with pytest.raises(ValueError, match="for a cell only"):
        identify.multisine(axis, axis="x", **good)
    with pytest.raises(ValueError, match="spacing"):
        identify.swept_sine(axis, spacing="square", **good)
    with pytest.raises(ValueError, match="returned shape"):
        identify.multisine(lambda u: u[1:], **good)
    with pytest.raises(ModelError, match="to_hz = 300"):
        identify.multisine(axis, to_hz=300.0, **good)
    f, h = np.linspace(1.0, 10.0, 20), np.ones(20, dtype=complex)
    with pytest.raises(ValueError, match="response has 19"):
        identify.fit_second_order(f, h[1:])
    with pytest.raises(ValueError, match="coherence holds 2"):
        identify.fit_second_order(f, h, coherence=np.full(20, 2.0))
    with pytest.raises(ModelError, match="frequency_hz = 0"):
        identify.fit_second_order(f - 1.0, h)
    with pytest.raises(ValueError, match="response holds NaN"):
        identify.fit_second_order(f, h * np.nan)
    with pytest.raises(ModelError, match="n_zeros = 3"):
        identify.fit_rational(f, h, 3, 2)
    with pytest.raises(ValueError, match="exclude each other"):
        identify.frequency_response(f, f, 1.0, period_samples=8, segment_samples=8)
    with pytest.raises(ModelError, match="output holds 19"):
        identify.frequency_response(f, f[1:], 1.0, period_samples=10)
    with pytest.raises(ValueError, match="waveform = 'noise'"):
        identify.excitation("noise", 1.0, 1.0, 10.0, 8.0, 2, DT_S)
    with pytest.raises(ValueError, match="n_averages"):
        identify.FrequencyResponse(f, h, n_averages=0.5)


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


def test_repeatability_splits_known_parts():
    rng = np.random.default_rng(3)
    lag = np.sin(np.linspace(0, 20, 2000))[:, None] * [3e-3, 1e-4]
    runs = lag + 1e-4 * rng.normal(size=(8, 2000, 2))
    found = compare_runs(runs, ("x", "y"))
    x, y = found.axes
    assert x.repeatable_rms_m == pytest.approx(np.sqrt(np.mean(lag[:, 0] ** 2)), rel=0.01)
    assert x.non_repeatable_rms_m == pytest.approx(1e-4, rel=0.02)
    assert (x.verdict, y.verdict) == ("yes", "no")
    assert y.ratio == pytest.approx(np.sqrt(0.5), rel=0.06)
    assert found.applicable
    noise = compare_runs(1e-4 * rng.normal(size=(8, 2000, 1)))
    assert not noise.applicable
    for bad in (runs[:1], runs[0], runs[:, :0]):
        with pytest.raises(ValueError, match="errors has shape"):
            compare_runs(bad)
    with pytest.raises(ValueError, match="not finite"):
        compare_runs(runs * np.nan)
    with pytest.raises(ValueError, match="axis_names"):
        compare_runs(runs, ("x",))


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


TRUTH = {"x": (15.0, 1.0), "y": (15.0, 0.6)}


@pytest.mark.parametrize("measure", ["encoder", "tcp"])
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("cell", ["01_gantry", "02_parallel", "04_gcode"])
def test_every_axis_of_the_examples_gets_a_model_near_the_truth(cell, axis, measure):
    path = f"examples/{cell}.toml"
    told = []
    found = identify.multisine(path, axis=axis, measure=measure, bus="loopback:", tell=told.append)
    assert found.doubt is None
    assert told
    frequency_hz, damping = TRUTH[axis]
    bandwidth_hz, described = 2.0 * damping * frequency_hz, found.described
    if measure == "encoder":
        assert described.delay_samples <= 2
        if cell == "02_parallel":
            assert described.bandwidth_hz == pytest.approx(bandwidth_hz, rel=0.15)
        else:
            assert described.natural_frequency_hz == pytest.approx(frequency_hz, rel=0.1)
            assert described.damping == pytest.approx(damping, rel=0.25)
        return
    # The tool measures the axis, a cycle later, and the mode at 20 Hz.
    low_hz = np.arange(1.0, 10.0, 0.5)
    s = 2j * np.pi * low_hz
    w0, w1 = 2 * np.pi * frequency_hz, 2 * np.pi * 20.0
    true = w0**2 / (s**2 + 2 * damping * w0 * s + w0**2)
    true *= (0.2 * w1 * s + w1**2) / (s**2 + 0.2 * w1 * s + w1**2)
    dt_s = found.dt_s
    true *= np.exp(-s * 1.5 * dt_s)
    gain = 1.0 if cell != "02_parallel" else w0 / (2 * damping)
    seen = np.ravel(described.response(low_hz)) * gain
    assert np.sqrt(np.mean(np.abs(seen / true - 1.0) ** 2)) < 0.25


@pytest.mark.parametrize("cell", ["01_gantry", "02_parallel"])
def test_an_axis_that_stands_still_is_doubted_in_one_line(cell, ilc, tmp_path):
    text = Path(f"examples/{cell}.toml").read_text(encoding="utf-8")
    text = text.replace("static_n = 25.0", "static_n = 2000.0")
    text = text.replace("position_start_m = 0.02", "position_start_m = 0.0")
    (tmp_path / "stuck.toml").write_text(text, encoding="utf-8")
    done = ilc(
        "identify", "stuck.toml", "--axis", "y", "--bus", "loopback:", "--measure", "encoder",
        "--period-s", "5", "--periods", "2", "--json", "y.json",
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("\n") == 1
    assert "no model for axis y: the output does not answer at any frequency" in done.stderr
    assert "natural frequency" not in done.stdout
    figures = json.loads((tmp_path / "y.json").read_text())
    assert figures["doubt"]
    assert figures["axis_model"] is None


def test_a_function_that_does_nothing_is_doubted():
    found = identify.multisine(lambda u: 0.0 * u, dt_s=DT_S, amplitude=1e-3)
    assert "does not answer" in found.doubt


def test_the_former_name_of_a_keyword_is_refused_with_the_new_one():
    with pytest.raises(ValueError, match="now period_s"):
        identify.swept_sine(lambda u: u, dt_s=DT_S, amplitude=1.0, duration_s=5.0)


def test_what_was_identified_is_tuned_and_learns(tmp_path):
    text = Path("examples/01_gantry.toml").read_text(encoding="utf-8")
    parts = re.split(r"(?=\[\[axis\]\])|(?=\[tcp_encoder\])", text)
    for index, axis in enumerate(("x", "y"), start=1):
        found = identify.multisine("examples/01_gantry.toml", axis=axis, bus="loopback:")
        section = found.section()
        parts[index] = re.sub(
            r"\[axis\.model\].*\n(?:.+\n)*\n", lambda _, new=section: new + "\n", parts[index]
        )
    path = tmp_path / "measured.toml"
    path.write_text("".join(parts), encoding="utf-8")
    assert propose_weights(path).write(path)
    contour, _ = learn(path, tmp_path / "runs.db")
    assert contour[-1] < 0.15 * contour[0]


def test_a_band_that_ends_too_low_is_widened(bench):
    # The cell states 5 Hz, the axis has 12 Hz.
    told = []
    found = identify.multisine(bench, axis="x", periods=2, tell=told.append)
    assert found.described.natural_frequency_hz == pytest.approx(12.0, rel=0.05)
    assert found.experiment.to_hz > 12.0
