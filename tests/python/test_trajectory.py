"""Trajectories: limits, derivatives, shapes, refusals."""

import numpy as np
import pytest

from ilc_rt import Cell, TrajectoryError, trajectory

LIMITS = {"velocity_max_m_s": 0.5, "acceleration_max_m_s2": 10.0, "jerk_max_m_s3": 800.0}
SQUARE = [[0.0, 0.0], [0.03, 0.0], [0.03, 0.02], [0.0, 0.02]]
GCODE = "G1 X30 F3000 (first)\nG3 X20 Y10 I-10 J0\nG4 P0.1\nG1 X0 Y0\n"

PLANS = {
    "complete": lambda dt: trajectory.jerk_limited(SQUARE, feed_m_s=0.05, dt_s=dt, **LIMITS),
    "on_time": lambda dt: trajectory.jerk_limited(
        SQUARE, feed_m_s=[0.05, 0.04, 0.1], dt_s=dt, setting="on_time", **LIMITS
    ),
    "exponential_sigmoid": lambda dt: trajectory.exponential_sigmoid(
        [[0.0, 0.0], [0.06, 0.08], [0.0, 0.0]],
        feed_m_s=[0.05, 0.08],
        dt_s=dt,
        amplitude_m=0.001,
        frequency_hz=5.0,
        **LIMITS,
    ),
    "six_point": lambda dt: trajectory.modulated(
        [0.0, 0.05], feed_m_s=0.02, amplitude_m=0.001, frequency_hz=5.0, dt_s=dt,
        interpolation="on_time", **LIMITS,
    ),
    "spline": lambda dt: trajectory.spline(SQUARE, feed_m_s=0.05, dt_s=dt, **LIMITS),
    "butterfly": lambda dt: trajectory.butterfly(
        dt_s=dt, curvature_acceleration_max_m_s2=0.02, **LIMITS
    ),
    "spiral": lambda dt: trajectory.spiral(
        pitch_m=0.004, turns=2.5, feed_m_s=0.03, dt_s=dt, **LIMITS
    ),
    "raster": lambda dt: trajectory.raster(
        width_m=0.03, pitch_m=0.005, rows=3, feed_m_s=0.05, dt_s=dt, there_and_back=True, **LIMITS
    ),
    "gcode": lambda dt: trajectory.gcode(
        GCODE, start_m=[0.0, 0.0], feed_m_s=0.05, dt_s=dt, **LIMITS
    ),
    "gcode blended": lambda dt: trajectory.gcode(
        GCODE, start_m=[0.0, 0.0], feed_m_s=0.05, dt_s=dt, blend_s=0.04, **LIMITS
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANS)
def test_every_limit_holds_and_derivatives_belong_together(name):
    dt_s = 0.001
    path = PLANS[name](dt_s)
    n = path.n_samples
    assert path.dt_s == dt_s
    assert path.t_s.shape == (n,)
    for array in (path.position_m, path.velocity_m_s, path.acceleration_m_s2, path.programmed_m):
        assert array.shape == (n, path.n_axes)
        assert np.isfinite(array).all()
    assert path.computing_s >= 0.0
    p, v, a = path.position_m, path.velocity_m_s, path.acceleration_m_s2
    assert abs(v).max() <= LIMITS["velocity_max_m_s"] * (1 + 1e-9)
    assert abs(a).max() <= LIMITS["acceleration_max_m_s2"] * (1 + 1e-9)
    for order, key in enumerate(LIMITS, 1):
        differences = np.diff(p, order, axis=0) / dt_s**order
        assert abs(differences).max() <= LIMITS[key] * (1 + 1e-9) + 1e-14 / dt_s**order
    # Central differences miss by a sixth of the next but one derivative times dt^2.
    bend = LIMITS["jerk_max_m_s3"] * dt_s**2
    np.testing.assert_allclose((p[2:] - p[:-2]) / (2 * dt_s), v[1:-1], atol=bend)
    np.testing.assert_allclose(
        (v[2:] - v[:-2]) / (2 * dt_s), a[1:-1], atol=LIMITS["jerk_max_m_s3"] * dt_s
    )
    for rest in (v[0], v[-1], a[0], a[-1]):
        np.testing.assert_allclose(rest, 0.0, atol=1e-9)


def test_the_settings_lose_frequency_or_amplitude():
    def path(way):
        return trajectory.modulated(
            [0.0, 0.1], feed_m_s=0.02, amplitude_m=0.0015, frequency_hz=12.0, dt_s=0.001,
            interpolation=way, velocity_max_m_s=0.5, acceleration_max_m_s2=5.0, jerk_max_m_s3=300.0,
        )  # fmt: skip

    complete, on_time = path("complete"), path("on_time")
    assert complete.t_s[-1] > 1.3 * 5.0
    assert on_time.t_s[-1] < 1.05 * 5.0

    def amplitude(path):
        middle = path.position_m[path.n_samples // 4 : 3 * path.n_samples // 4, 0]
        off = middle - np.polyval(np.polyfit(range(len(middle)), middle, 1), range(len(middle)))
        return 4.0 / len(off) * np.abs(np.fft.rfft(off * np.hanning(len(off)))).max()

    assert amplitude(on_time) < 0.8 * amplitude(complete)


def test_an_exponential_sigmoid_move_is_on_its_path_and_on_time():
    path = trajectory.exponential_sigmoid([0.0, 0.5], feed_m_s=0.1, dt_s=0.001, **LIMITS)
    miss = abs(path.position_m - path.programmed_m)[:, 0]
    assert miss[1000:4000].max() < 1e-12
    place = [(segment, name) for segment, name, _, _ in path.alphas]
    assert place == [(0, "start-up"), (0, "end")]
    for _, _, alpha, intervals in path.alphas:
        assert alpha == intervals[-1][1]
    linear = trajectory.jerk_limited([0.0, 0.5], feed_m_s=0.1, dt_s=0.001, **LIMITS)
    assert trajectory.tracking_index(path)[0] < trajectory.tracking_index(linear)[0]


RAMPED = {"feed_m_s": 3.0, "amplitude_m": 0.15, "frequency_hz": 2.0 / (2.0 * np.pi)}


def ramped_limits(acceleration):
    return {
        "velocity_max_m_s": 30.0,
        "acceleration_max_m_s2": acceleration,
        "jerk_max_m_s3": 1000.0 * acceleration,
    }


def printed_start(t, alpha):
    """Return position and acceleration of DiMarco Eq. (2.3), (2.5), (2.8), (2.10), corrected."""
    m, (a, w) = RAMPED["feed_m_s"], (RAMPED["amplitude_m"], 2.0)
    s, c = np.sin(w * t), np.cos(w * t)
    line, window = np.exp(-alpha * t**3), np.exp(-alpha * t**2)
    x = m * t * (1.0 - line) + a * s * (1.0 - window)
    along = line * m * (12.0 * alpha * t**2 - 9.0 * alpha**2 * t**5)
    swing = 4.0 * alpha**2 * t**2 * s - 2.0 * alpha * s - 4.0 * alpha * w * t * c - w * w * s
    return x, along - a * window * swing - a * w * w * s


@pytest.mark.parametrize("acceleration", [2.0, 5.0, 20.0, 100.0])
def test_the_largest_alpha_is_that_of_the_printed_equations(acceleration):
    path = trajectory.exponential_sigmoid(
        [0.0, 180.0], dt_s=0.002, **RAMPED, **ramped_limits(acceleration)
    )
    t = path.t_s[:5001]
    [(_, place, alpha, intervals), _] = path.alphas
    assert place == "start-up"
    x, a = printed_start(t, alpha)
    np.testing.assert_allclose(path.position_m[:5001, 0], x, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(path.acceleration_m_s2[:5001, 0], a, rtol=0.0, atol=1e-9)
    fine = np.linspace(0.0, 10.0, 20_001)

    def peak(alpha):
        return np.abs(printed_start(fine, alpha)[1]).max()

    assert peak(alpha) == pytest.approx(acceleration, rel=1e-4)
    assert all(peak(alpha * factor) > acceleration for factor in np.geomspace(1.01, 1e3, 20))
    scanned = np.geomspace(intervals[0][0], alpha, 60)
    inside = np.array([any(low <= a <= high for low, high in intervals) for a in scanned])
    holds = np.array([peak(a) <= acceleration for a in scanned])
    np.testing.assert_array_equal(inside[1:-1], holds[1:-1])


def test_ends_that_reach_into_each_other_are_planned_together():
    for acceleration in (4.0, 10.0):
        limits = ramped_limits(acceleration)
        path = trajectory.exponential_sigmoid([0.0, 30.0], dt_s=0.001, **RAMPED, **limits)
        assert path.t_s[-1] == pytest.approx(10.0)
        assert 0.999 < abs(path.acceleration_m_s2).max() / acceleration <= 1.0 + 1e-9
    with pytest.raises(TrajectoryError, match=r"start-up.*alpha 0.045.*reaches 3.31"):
        trajectory.exponential_sigmoid([0.0, 30.0], dt_s=0.001, **RAMPED, **ramped_limits(3.0))


def test_an_oscillation_beyond_the_limits_is_refused_for_itself():
    with pytest.raises(TrajectoryError, match=r"acceleration of the programmed .* reaches 0.6 m"):
        trajectory.exponential_sigmoid([0.0, 300.0], dt_s=0.01, **RAMPED, **ramped_limits(0.59))


def test_no_alpha_is_above_the_one_wanted():
    def alphas(alpha_max):
        path = trajectory.exponential_sigmoid(
            [0.0, 0.2, 0.0], feed_m_s=0.1, dt_s=0.001, alpha_max=alpha_max, **LIMITS
        )
        return {place: alpha for _, place, alpha, _ in path.alphas}

    free = alphas(None)
    assert alphas(25.0) == pytest.approx({"start-up": 25.0, "transition": 25.0, "end": 25.0})
    assert alphas({"transition": 25.0}) == pytest.approx(free | {"transition": 25.0})
    assert alphas(1e12) == free
    with pytest.raises(TrajectoryError, match=r"end: alpha_max 1: must be at least 5\.625"):
        alphas({"end": 1.0})
    with pytest.raises(TrajectoryError, match="alpha_max NaN"):
        alphas(float("nan"))
    with pytest.raises(ValueError, match='"start"; "start-up"'):
        alphas({"start": 1.0})
    with pytest.raises(TypeError, match=r"alpha_max = \[1.0\]; a number, or a dict"):
        alphas([1.0])


PAIR = {
    "velocity_m_s": [10.0, -5.0],
    "amplitude_m": [2.0, 1.0],
    "omega_rad_s": [10.0, 20.0],
    "phase_zero_s": [0.0, 6.01],
    "corner_s": 6.0,
    "duration_s": 14.0,
    "start_alpha": 5.0,
    "transition_alpha": 2.0,
    "sine_alpha": 3.0,
    "sine_offset_s": 1.0,
    "dt_s": 0.01,
}


def test_a_sigmoid_pair_is_its_equation():
    path = trajectory.sigmoid_pair(**PAIR)
    t, c = path.t_s, path.t_s - 6.0
    first = 10.0 * t + 2.0 * np.sin(10.0 * t) / (1.0 + np.exp(3.0 * (c + 1.0)))
    second = 60.0 - 5.0 * c + np.sin(20.0 * (c - 0.01)) / (1.0 + np.exp(-3.0 * (c - 1.0)))
    joined = first * 0.5 / (0.5 + np.exp(2.0 * c)) + second * 2.0 / (2.0 + np.exp(-2.0 * c))
    expected = joined * (1.0 - np.exp(-5.0 * t**2))
    np.testing.assert_allclose(path.position_m[:, 0], expected, rtol=0.0, atol=1e-12)
    slope = (path.position_m[2:] - path.position_m[:-2]) / 0.02
    np.testing.assert_allclose(slope, path.velocity_m_s[1:-1], atol=0.4)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"velocity_m_s": [1.0]}, r"velocity_m_s has shape \(1,\); \(2,\) is needed"),
        ({"velocity_m_s": [1.0, 0.0]}, "velocity_m_s = 0: allowed a finite number other than 0"),
        ({"amplitude_m": [1.0, np.nan]}, "amplitude_m holds NaN"),
        ({"start_alpha": 0.0}, "start_alpha = 0: allowed a finite number above 0"),
        ({"sine_offset_s": float("inf")}, "sine_offset_s = inf: allowed a finite number"),
        ({"dt_s": 0.0}, "sample time 0 s"),
    ],
)
def test_a_pair_that_cannot_be_is_refused(change, match):
    with pytest.raises(ValueError, match=match):
        trajectory.sigmoid_pair(**{**PAIR, **change})


def test_the_index_is_the_integral_of_its_definition():
    path = PLANS["exponential_sigmoid"](0.001)
    tracking, acceleration = trajectory.tracking_index(path, k_e=600.0, k_a=2.0)
    squares = ((path.programmed_m - path.position_m) ** 2).sum(axis=1)
    assert tracking == pytest.approx(600.0 * np.trapezoid(squares, dx=0.001), rel=1e-9)
    squares = (path.acceleration_m_s2**2).sum(axis=1)
    assert acceleration == pytest.approx(2.0 * np.trapezoid(squares, dx=0.001), rel=1e-9)


def test_the_butterfly_is_the_curve_of_its_equation():
    path = trajectory.butterfly(
        dt_s=0.002, curvature_acceleration_max_m_s2=0.02, turns=1.0, **LIMITS
    )
    t = np.linspace(0.0, 2.0 * np.pi, 200_001)
    r = 0.00185 * (np.exp(np.cos(t)) - 2 * np.cos(4 * t) - np.sin(t / 12) ** 5)
    curve = np.column_stack((r * np.sin(t), r * np.cos(t)))
    for point in path.position_m[::400]:
        assert np.hypot(*(curve - point).T).min() < 1e-6
    np.testing.assert_allclose(path.position_m[0], curve[0], atol=1e-15)
    np.testing.assert_allclose(path.position_m[-1], curve[-1], atol=1e-9)
    assert np.hypot(*path.velocity_m_s.T).max() <= 0.004 * (1 + 1e-9)


def test_a_spline_passes_its_points():
    from scipy.interpolate import CubicSpline

    points = np.array(SQUARE)
    path = trajectory.spline(points, feed_m_s=0.05, dt_s=0.001, **LIMITS)
    knots = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T) ** 0.5)))
    curve = CubicSpline(knots, points, bc_type="natural")(np.linspace(0.0, knots[-1], 100_001))
    for point in path.position_m[::50]:
        assert np.hypot(*(curve - point).T).min() < 2e-6


def test_a_part_program_runs_in_a_cell(gantry):
    cell = Cell.load(gantry.with_name("04_gcode.toml"))
    reference = cell.reference()
    np.testing.assert_allclose(reference[-1], 0.0, atol=1e-12)
    assert reference.max() > 0.079


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"feed_m_s": 0.0}, "feed 0 m/s"),
        ({"feed_m_s": float("nan")}, "feed NaN"),
        ({"dt_s": 0.0}, "sample time 0 s"),
        ({"dt_s": float("inf")}, "sample time inf s"),
        ({"velocity_max_m_s": -1.0}, "axis 1: velocity limit -1"),
        ({"jerk_max_m_s3": [800.0, 0.0]}, "axis 2: jerk limit 0"),
        ({"acceleration_max_m_s2": [1.0]}, "acceleration_max_m_s2 has 1 entries"),
        ({"setting": "soon"}, "setting = 'soon'"),
        ({"points_m": [[0.0, 0.0], [0.0, 0.0]]}, "ends where it starts"),
        ({"points_m": [[0.0, 0.0], [np.nan, 0.0]]}, "points_m holds NaN"),
        ({"points_m": np.zeros((2, 13)) + np.arange(2)[:, None]}, "13 axes: allowed 1 to 12"),
        ({"points_m": [[0.0, 0.0]]}, "0 segments"),
    ],
)
def test_one_wrong_thing_at_a_time(change, match):
    arguments = {"points_m": SQUARE[:2], "feed_m_s": 0.05, "dt_s": 0.001, **LIMITS, **change}
    with pytest.raises(ValueError, match=match):
        trajectory.jerk_limited(arguments.pop("points_m"), **arguments)


def test_what_no_alpha_holds_is_refused_with_the_limit():
    limits = LIMITS | {"velocity_max_m_s": 0.1}
    with pytest.raises(TrajectoryError, match=r"no alpha holds every limit.*velocity"):
        trajectory.exponential_sigmoid([0.0, 0.5], feed_m_s=0.09, dt_s=0.001, **limits)


def test_a_part_program_is_refused_with_its_line():
    with pytest.raises(TrajectoryError, match="line 2: G33: allowed G0 G1"):
        trajectory.gcode("G1 X1\nG33 X2", start_m=[0.0], feed_m_s=0.05, dt_s=0.001, **LIMITS)


FAST = {"velocity_max_m_s": 0.5, "acceleration_max_m_s2": 8.0, "jerk_max_m_s3": 1000.0}


@pytest.mark.parametrize(
    ("text", "start_m", "centre_m", "length_m"),
    [
        ("G3 X9.999 Y-0.001 I-10 J0 F1200", [0.01, 0.0], (0.0, 0.0), 0.06283),
        ("G3 X10.001 Y-0.1 I-10 J0", [0.01, 0.0], (0.0, 0.0), 0.06273),
        ("G2 X0.001 Y-0.001 I5 J0", [0.0, 0.0], (0.005, 0.0), 0.03141),
    ],
)
def test_an_arc_keeps_its_centre_however_near_its_ends_are(text, start_m, centre_m, length_m):
    path = trajectory.gcode(text, start_m=start_m, feed_m_s=0.05, dt_s=0.002, **FAST)
    radius = np.hypot(*(path.position_m - centre_m).T)
    assert abs(radius - radius[0]).max() <= 2e-6
    length = np.hypot(*np.diff(path.position_m, axis=0).T).sum()
    assert length == pytest.approx(length_m, abs=1e-5)


TURNING = {
    "one axis": [0.0, 0.05, 0.02],
    "one line": [[0.0, 0.0], [0.05, 0.0], [0.02, 0.0], [0.08, 0.0]],
    "almost one line": [[0.0, 0.0], [0.05, 1e-6], [0.02, 0.0], [0.08, 0.0]],
    "by symmetry": [0.0, 0.05, 0.0],
    "three axes": [[0.0, 0.0, 0.0], [0.05, 0.05, 0.1], [0.02, 0.02, 0.04]],
}


@pytest.mark.parametrize("points", TURNING)
@pytest.mark.parametrize("dt_s", [1e-3, 1e-2])
def test_a_spline_that_turns_back_holds_every_limit(points, dt_s):
    limits = {"velocity_max_m_s": 0.2, "acceleration_max_m_s2": 2.0, "jerk_max_m_s3": 50.0}
    path = trajectory.spline(TURNING[points], feed_m_s=0.1, dt_s=dt_s, **limits)
    p = path.position_m
    p = np.concatenate((p[:1], p[:1], p, p[-1:], p[-1:], p[-1:]))
    for order, key in enumerate(limits, 1):
        differences = np.diff(p, order, axis=0) / dt_s**order
        assert abs(differences).max() <= limits[key] * (1 + 1e-9) + 1e-14 / dt_s**order
    for points_m in np.atleast_2d(np.array(TURNING[points]).T).T:
        assert abs(path.position_m - points_m).max(axis=1).min() < 2e-4
    assert path.t_s[-1] < 4.0


def test_a_part_program_may_be_bytes_in_any_encoding_and_leave_blocks_out():
    def end(text, **more):
        path = trajectory.gcode(text, start_m=[0.0], feed_m_s=0.05, dt_s=0.001, **FAST, **more)
        return path.position_m[-1].item()

    text = b"G20. (sp\xe4t)\nG1 X 1 F60\n/X2\n"
    assert end(text) == pytest.approx(0.0508)
    assert end(text, block_delete=True) == pytest.approx(0.0254)
    assert end("%\nG1 X10 F600\n%\nG1 X50") == pytest.approx(0.01)
    with pytest.raises(TrajectoryError, match=r"line 1: \(oops: a comment ends with \)"):
        end("G1 X5 (oops\nX7")
    with pytest.raises(TypeError):
        end(5)


GOOD = {
    "dt_s": 0.001,
    "position_m": np.zeros((5, 2)),
    "velocity_m_s": np.zeros((5, 2)),
    "acceleration_m_s2": np.zeros((5, 2)),
    "programmed_m": np.zeros((5, 2)),
    "alphas": [],
    "computing_s": 0.0,
}


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"dt_s": 0.0}, r"dt_s = 0\.0; a finite number above 0"),
        ({"dt_s": -0.001}, r"dt_s = -0\.001; a finite number above 0"),
        ({"dt_s": np.nan}, "dt_s = nan"),
        ({"dt_s": np.inf}, "dt_s = inf"),
        ({"dt_s": None}, "dt_s = None"),
        ({"computing_s": -1.0}, r"computing_s = -1\.0; a finite number of at least 0"),
        ({"computing_s": np.nan}, "computing_s = nan"),
        ({"alphas": None}, "alphas = None; a list"),
        ({"position_m": np.zeros((4, 2))}, r"shape \(n_samples, n_axes\)"),
        ({"velocity_m_s": np.zeros(5)}, "velocity_m_s: an array of float64"),
        ({"programmed_m": np.zeros((5, 2), dtype=int)}, "programmed_m: an array of float64"),
        ({"acceleration_m_s2": np.full((5, 2), np.nan)}, "acceleration_m_s2 has a value that is"),
    ],
)
def test_a_sampled_motion_that_cannot_be_is_refused(change, match):
    assert trajectory.Trajectory(**GOOD).t_s[-1] == pytest.approx(0.004)
    with pytest.raises(TrajectoryError, match=match):
        trajectory.Trajectory(**(GOOD | change))


@pytest.mark.parametrize("dt_s", [0.0, -0.001, np.nan, np.inf])
@pytest.mark.parametrize("name", PLANS)
def test_no_planner_takes_a_sample_time_that_cannot_be(name, dt_s):
    with pytest.raises(ValueError, match=r"dt_s|sample time|cycle"):
        PLANS[name](dt_s)
