"""Plans of moves without samples: `MovePlan`."""

import numpy as np
import pytest

from ilc_rt import TrajectoryError, trajectory

LIMITS = {"velocity_max_m_s": 0.5, "acceleration_max_m_s2": 10.0, "jerk_max_m_s3": 800.0}
SQUARE = [[0.0, 0.0], [0.03, 0.0], [0.03, 0.02], [0.0, 0.02]]


@pytest.mark.parametrize("setting", ["complete", "on_time"])
def test_it_is_the_motion_of_the_sampled_moves(setting):
    feeds = [0.05, 0.04, 0.1]
    plan = trajectory.MovePlan(SQUARE, feed_m_s=feeds, setting=setting, **LIMITS)
    path = trajectory.jerk_limited(SQUARE, feed_m_s=feeds, setting=setting, dt_s=0.001, **LIMITS)
    position_m, velocity_m_s, acceleration_m_s2 = plan.at(path.t_s)
    np.testing.assert_array_equal(position_m, path.position_m)
    np.testing.assert_array_equal(velocity_m_s, path.velocity_m_s)
    np.testing.assert_array_equal(acceleration_m_s2, path.acceleration_m_s2)
    assert (plan.n_moves, plan.n_axes) == (3, 2)
    assert path.t_s[-2] < plan.duration_s <= path.t_s[-1]
    assert plan.nominal_s == pytest.approx(0.03 / 0.05 + 0.02 / 0.04 + 0.03 / 0.1)
    assert plan.starts_s.shape == (3,)
    assert plan.starts_s[0] == 0.0
    if setting == "on_time":
        np.testing.assert_allclose(plan.starts_s, [0.0, 0.6, 1.1], rtol=1e-12)
    else:
        np.testing.assert_array_equal(plan.at(plan.starts_s)[0], SQUARE[:3])


def test_one_time_gives_a_value_per_axis_and_ends_are_held():
    plan = trajectory.MovePlan(SQUARE, feed_m_s=0.05, **LIMITS)
    for t_s, point_m in [(-1.0, SQUARE[0]), (0, SQUARE[0]), (100.0, SQUARE[-1])]:
        position_m, velocity_m_s, acceleration_m_s2 = plan.at(t_s)
        np.testing.assert_array_equal(position_m, point_m)
        np.testing.assert_array_equal(velocity_m_s, [0.0, 0.0])
        np.testing.assert_array_equal(acceleration_m_s2, [0.0, 0.0])
    assert [table.shape for table in plan.at([])] == [(0, 2)] * 3


def test_a_start_in_motion_is_taken_up_within_the_limits():
    plan = trajectory.MovePlan(
        [[0.0, 0.0], [0.2, 0.05]], feed_m_s=0.3, start_velocity_m_s=[0.25, -0.4], **LIMITS
    )
    position_m, velocity_m_s, acceleration_m_s2 = plan.at(0.0)
    np.testing.assert_array_equal(position_m, [0.0, 0.0])
    np.testing.assert_array_equal(velocity_m_s, [0.25, -0.4])
    np.testing.assert_array_equal(acceleration_m_s2, [0.0, 0.0])
    t_s = np.linspace(0.0, plan.duration_s, 20_001)
    p, v, a = plan.at(t_s)
    dt_s = t_s[1]
    assert abs(v).max() <= 0.5 * (1 + 1e-9)
    assert abs(a).max() <= 10.0 * (1 + 1e-9)
    assert abs(np.diff(p, axis=0)).max() <= 0.5 * dt_s * (1 + 1e-9)
    assert abs(np.diff(v, axis=0)).max() <= 10.0 * dt_s * (1 + 1e-9)
    assert abs(np.diff(a, axis=0)).max() <= 800.0 * dt_s * (1 + 1e-6)
    np.testing.assert_allclose(p[-1], [0.2, 0.05], atol=1e-14)
    np.testing.assert_allclose(v[-1], 0.0, atol=1e-12)


def test_a_number_is_the_start_velocity_of_all_axes():
    both = [
        trajectory.MovePlan([[0.0, 0.0], [0.1, 0.2]], feed_m_s=0.3, start_velocity_m_s=v, **LIMITS)
        for v in (0.1, [0.1, 0.1])
    ]
    assert both[0].duration_s == both[1].duration_s
    faster = [
        trajectory.MovePlan([0.0, 0.3], feed_m_s=0.3, start_velocity_m_s=v, **LIMITS).duration_s
        for v in (-0.1, 0.0, 0.1, 0.3)
    ]
    assert faster == sorted(faster, reverse=True)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"start_velocity_m_s": [0.1, 0.6]}, TrajectoryError, r"axis 2: start velocity 0\.6 m/s"),
        ({"start_velocity_m_s": [0.1]}, ValueError, "start_velocity_m_s has 1 entries"),
        ({"start_velocity_m_s": [0.1, np.nan]}, ValueError, "start_velocity_m_s holds NaN"),
        ({"start_velocity_m_s": np.inf}, TrajectoryError, "start velocity inf"),
        ({"feed_m_s": 0.0}, TrajectoryError, "feed 0 m/s"),
        ({"feed_m_s": [0.1, 0.1]}, ValueError, "feed_m_s has 2 entries"),
        ({"points_m": [[0.0, 0.0]]}, TrajectoryError, "0 segments"),
        ({"points_m": [[0.0, 0.0], [0.0, 0.0]]}, TrajectoryError, "segment 1"),
        ({"setting": "soon"}, ValueError, "'complete' or 'on_time' is needed"),
        ({"jerk_max_m_s3": -1.0}, TrajectoryError, "jerk limit -1"),
    ],
)  # fmt: skip
def test_one_wrong_thing_at_a_time(change, error, match):
    right = {"points_m": SQUARE, "feed_m_s": 0.05, **LIMITS}
    trajectory.MovePlan(**right)
    with pytest.raises(error, match=match):
        trajectory.MovePlan(**(right | change))


def test_times_that_are_none_are_refused():
    plan = trajectory.MovePlan(SQUARE, feed_m_s=0.05, **LIMITS)
    with pytest.raises(ValueError, match=r"t_s has shape \(1, 1\)"):
        plan.at([[0.0]])
    with pytest.raises(ValueError, match=r"t_s holds NaN at \[1\]"):
        plan.at([0.0, np.nan])
    with pytest.raises(TypeError, match="t_s"):
        plan.at("now")


def test_a_long_program_is_planned_and_evaluated():
    random = np.random.default_rng(7)
    points_m = random.uniform(-0.05, 0.05, (2001, 3))
    for setting in ("complete", "on_time"):
        plan = trajectory.MovePlan(points_m, feed_m_s=0.3, setting=setting, **LIMITS)
        assert plan.n_moves == 2000
        t_s = np.linspace(0.0, plan.duration_s, 50_000)
        position_m, velocity_m_s, acceleration_m_s2 = plan.at(t_s)
        assert abs(velocity_m_s).max() <= 0.5 * (1 + 1e-9)
        assert abs(acceleration_m_s2).max() <= 10.0 * (1 + 1e-9)
        steps_m = abs(np.diff(position_m, axis=0)).max()
        assert steps_m <= 0.5 * t_s[1] * (1 + 1e-9) + 1e-12
