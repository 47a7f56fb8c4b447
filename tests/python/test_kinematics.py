"""Mechanisms against SciPy, and their refusals."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from ilc_rt import kinematics
from ilc_rt.kinematics import Delta, Gantry, KinematicsError


def knees(delta: Delta, theta_rad: np.ndarray) -> np.ndarray:
    azimuth = np.radians([0.0, 120.0, 240.0])
    radius = delta.base_m + delta.crank_m * np.cos(theta_rad)
    return np.stack(
        [radius * np.cos(azimuth), radius * np.sin(azimuth), delta.crank_m * np.sin(theta_rad)],
        axis=-1,
    )


def test_forward_is_where_a_root_finder_closes_the_rods() -> None:
    delta = Delta()
    random = np.random.default_rng(1)
    for theta_rad in random.uniform(0.2, 1.4, size=(50, 3)):

        def gaps(p_m: np.ndarray, theta_rad: np.ndarray = theta_rad) -> np.ndarray:
            rods_m = np.linalg.norm(p_m - knees(delta, theta_rad), axis=1)
            return np.asarray(rods_m - delta.rod_m)

        found = fsolve(gaps, [0.0, 0.0, 0.25], xtol=1e-13)
        np.testing.assert_allclose(delta.forward(theta_rad), found, atol=1e-11)


def test_round_trip_over_the_workspace_is_below_1e_9() -> None:
    delta = Delta()
    grid = np.linspace(-0.04, 0.04, 17)
    x, y, z = np.meshgrid(grid, grid, np.linspace(0.12, 0.18, 13), indexing="ij")
    poses = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    theta_rad = delta.inverse(poses)
    assert theta_rad.shape == poses.shape
    np.testing.assert_allclose(delta.forward(theta_rad), poses, rtol=0.0, atol=1e-9)


def test_jacobian_is_the_derivative() -> None:
    delta = Delta()
    theta_rad = np.random.default_rng(2).uniform(0.3, 1.2, size=(40, 3))
    jacobian = delta.jacobian(theta_rad)
    assert jacobian.shape == (40, 3, 3)
    step = 1e-6
    for joint in range(3):
        moved = np.eye(3)[joint] * step
        slope = (delta.forward(theta_rad + moved) - delta.forward(theta_rad - moved)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, :, joint], slope, atol=1e-8)
    assert delta.condition(theta_rad[0]) >= 1.0
    assert delta.in_workspace(delta.forward(theta_rad[0]))


def test_an_unreachable_pose_is_named_with_its_sample() -> None:
    delta = Delta()
    good = delta.forward([0.5, 0.6, 0.7])
    with pytest.raises(
        KinematicsError, match=r"sample 1: pose \(0\.000000, 0\.000000, 0\.900000\)"
    ):
        delta.inverse(np.stack([good, [0.0, 0.0, 0.9]]))
    assert not delta.in_workspace([0.0, 0.0, 0.9])
    assert issubclass(KinematicsError, ValueError)


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: Delta(base_m=-1.0), "base_m"),
        (lambda: Delta(crank_m=0.0), "crank_m"),
        (lambda: Delta(rod_m=float("nan")), "rod_m"),
        (lambda: Delta().forward([0.0, 0.0]), "theta_rad"),
        (lambda: Delta().forward(np.zeros((4, 2))), "theta_rad"),
        (lambda: Delta().inverse([0.0, np.nan, 0.0]), "p_m"),
        (lambda: Delta().condition(np.full((2, 3), 0.5)), "theta_rad"),
        (lambda: Gantry(float("inf")), "orthogonality_rad"),
        (lambda: Gantry().forward([1.0, 2.0, 3.0]), "axes_m"),
        (lambda: Gantry().inverse(np.zeros((3, 3))), "tool_m"),
    ],
)
def test_one_wrong_thing_at_a_time(call: object, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        call()  # type: ignore[operator]


def test_gantry_round_trip_and_names() -> None:
    gantry = Gantry(2.5e-3)
    axes_m = np.random.default_rng(3).normal(size=(20, 2))
    tool_m = gantry.forward(axes_m)
    np.testing.assert_allclose(tool_m, axes_m @ gantry.jacobian().T, atol=1e-15)
    np.testing.assert_allclose(gantry.inverse(tool_m), axes_m, atol=1e-15)
    assert set(kinematics.__all__) == {"Delta", "Gantry", "KinematicsError"}
