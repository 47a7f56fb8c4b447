"""Contour geometry against NumPy, over whole paths and exact pieces."""

import numpy as np
import pytest

from ilc_rt.trajectory import (
    Arc,
    ContourError,
    Line,
    contour_error,
    coupling_gains,
    projection_across,
)


def brute_force(reference_m: np.ndarray, actual_m: np.ndarray) -> np.ndarray:
    start, step = reference_m[:-1], np.diff(reference_m, axis=0)
    length = np.maximum((step**2).sum(axis=1), 1e-300)
    best = []
    for point in actual_m:
        share = np.clip(((point - start) * step).sum(axis=1) / length, 0.0, 1.0)
        best.append(np.linalg.norm(start + share[:, None] * step - point, axis=1).min())
    return np.array(best)


@pytest.mark.parametrize("n_axes", [2, 3])
def test_the_whole_path_is_searched(n_axes: int) -> None:
    random = np.random.default_rng(n_axes)
    reference_m = np.cumsum(random.normal(size=(700, n_axes)), axis=0) * 1e-3
    actual_m = reference_m[random.permutation(700)] + random.normal(size=(700, n_axes)) * 1e-3
    np.testing.assert_allclose(
        contour_error(reference_m, actual_m), brute_force(reference_m, actual_m), atol=1e-15
    )


def test_a_window_as_wide_as_the_run_agrees_with_the_whole_path() -> None:
    angle = np.linspace(0.0, 6.0, 400)
    reference_m = np.stack([np.cos(angle), np.sin(2 * angle)], axis=1)
    actual_m = reference_m + 1e-2 * np.random.default_rng(4).normal(size=reference_m.shape)
    np.testing.assert_allclose(
        contour_error(reference_m, actual_m, window=400),
        contour_error(reference_m, actual_m),
        atol=1e-14,
    )


def test_exact_pieces_have_no_chord() -> None:
    angle = np.linspace(0.0, np.pi / 2, 50)
    circle_m = 0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    arc = Arc([0.05, 0.0], [0.0, 0.0], np.pi / 2)
    np.testing.assert_allclose(contour_error([arc], 1.02 * circle_m), 1e-3, atol=1e-16)
    both = [Line([0.05, -1.0], [0.05, 0.0]), arc]
    assert contour_error(both, [[0.06, -0.5]])[0] == pytest.approx(0.01, abs=1e-16)
    helix = Arc([0.0, 1.0, 0.0], [0.0, 0.0, 0.0], -np.pi, axis=[1.0, 0.0, 0.0])
    assert contour_error([helix], [[0.3, 0.0, 1.0]])[0] > 0.3


def test_coupling_gains_are_perpendicular_to_the_path() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 400)
    reference_m = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    gains = coupling_gains(reference_m)
    np.testing.assert_allclose(gains[1:-1], -reference_m[1:-1], atol=1e-12)
    blocks = projection_across(reference_m)
    np.testing.assert_allclose(blocks, gains[:, :, None] * gains[:, None, :], atol=1e-12)
    line_m = np.linspace(0.0, 1.0, 9)[:, None] * np.array([[1.0, 2.0, 2.0]])
    across = projection_across(line_m)
    np.testing.assert_allclose(across @ np.array([1.0, 2.0, 2.0]), 0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: contour_error(np.zeros(4), np.zeros((4, 2))), "reference_m"),
        (lambda: contour_error(np.zeros((4, 2)), np.zeros((4, 3))), "actual_m"),
        (lambda: contour_error(np.zeros((4, 4)), np.zeros((4, 4))), "reference_m"),
        (lambda: contour_error(np.zeros((4, 2)), np.full((4, 2), np.nan)), "actual_m"),
        (lambda: contour_error([], np.zeros((4, 2))), "reference_m"),
        (lambda: contour_error([Line([0, 0], [1, 0])], np.zeros((4, 2)), 5), "window"),
        (lambda: Arc([1.0, 0.0], [1.0, 0.0], 1.0), "radius"),
        (lambda: Arc([1.0, 0.0], [0.0, 0.0], 7.0), "sweep"),
        (lambda: Line([1.0], [0.0, 0.0]), "from_m"),
        (lambda: coupling_gains(np.zeros((4, 3))), "reference_m"),
        (lambda: projection_across(np.zeros((4, 4))), "reference_m"),
    ],
)
def test_one_wrong_thing_at_a_time(call: object, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        call()  # type: ignore[operator]
    assert issubclass(ContourError, ValueError)
