"""Learning from all past runs (relevance): the laws, the library that feeds them, the campaign."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import ilc_rt
from ilc_rt import (
    BadInputError,
    Campaign,
    FlexibleIlc,
    LearningError,
    Library,
    NormOptimalIlc,
    PdIlc,
    RelevanceIlc,
    RelevanceWeights,
    discretize,
    second_order,
    signal,
)

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable

    from numpy.typing import NDArray

    Ilc = Callable[..., subprocess.CompletedProcess[str]]

GANTRY = Path(__file__).resolve().parents[2] / "examples" / "01_gantry.toml"
N = 60
DT_S = 0.01
WEIGHTS = (10.0, 2.0, 0.5)
rng = np.random.default_rng(7)


def runs(
    n_runs: int, n_disturbances: int = 1
) -> list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]]:
    return [
        (rng.normal(size=N), rng.normal(size=N), rng.normal(size=n_disturbances))
        for _ in range(n_runs)
    ]


def pd_proposal(u: NDArray[Any], e: NDArray[Any], kp: float, kd: float) -> NDArray[Any]:
    ahead = np.append(e[1:], e[-1])
    before = np.append(e[:-1], e[-1])
    return np.asarray(u + kp * ahead + kd * (ahead - before))


def denominators(
    past: list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]], d: NDArray[Any]
) -> NDArray[Any]:
    """Return the sums of DiMarco Eq. (4.12) as in its listing, including EPSILON = 1."""
    sums = []
    for _, e, own in past:
        slow, rate = 0.0, np.empty(N)
        for k in range(N):
            rate[k] = (e[k] - slow) / 0.1
            slow += (1.0 - np.exp(-DT_S / 0.1)) * (e[k] - slow)
        apart = N * WEIGHTS[2] * np.sum((d - own) ** 2)
        sums.append(WEIGHTS[0] * np.sum(e**2) + WEIGHTS[1] * np.sum(rate**2) + apart + 1.0)
    return np.array(sums)


@pytest.mark.parametrize("top", [None, 4])
@pytest.mark.parametrize("n_disturbances", [1, 3])
def test_the_next_input_is_the_weighted_mean(top: int | None, n_disturbances: int) -> None:
    made = runs(12, n_disturbances)
    law = RelevanceIlc(None, PdIlc(1.284, 0.7), WEIGHTS, top, dt_s=DT_S)
    law.expect(made[0][2])
    for index in range(len(made) - 1):
        u, e, _ = made[index]
        coming = made[index + 1][2]
        found = law.update(u, e, disturbance=coming)
        past = made[: index + 1]
        sums = denominators(past, coming)
        counted = np.argsort(sums, kind="stable")[:top]
        weights = 1.0 / sums[counted]
        proposals = np.array([pd_proposal(past[j][0], past[j][1], 1.284, 0.7) for j in counted])
        expected = weights @ proposals / weights.sum()
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)
        numbers, shares = law.relevant(coming)
        np.testing.assert_array_equal(numbers, counted)
        np.testing.assert_allclose(shares, weights / weights.sum(), rtol=1e-12)
    assert len(law) == len(made) - 1


def test_a_first_run_that_was_not_announced_is_used_but_not_remembered() -> None:
    (u, e, _), (v, f, _) = runs(2)
    law = RelevanceIlc(None, PdIlc(1.0, 0.5), WEIGHTS, dt_s=DT_S)
    np.testing.assert_allclose(
        law.update(u, e, disturbance=20.0), pd_proposal(u, e, 1.0, 0.5), atol=1e-12
    )
    assert len(law) == 0
    law.update(v, f, disturbance=21.0)
    assert len(law) == 1
    law.reset()
    assert len(law) == 0


def test_any_law_can_be_the_core_and_shapes_are_kept() -> None:
    class Doubling:
        def update(
            self, u: NDArray[Any], e: NDArray[Any], disturbance: object = None
        ) -> NDArray[Any]:
            assert u.shape == e.shape == (5, 2)
            assert disturbance is None or np.shape(disturbance) == (1,)
            return 2.0 * u

        def reset(self) -> None:
            raise RuntimeError

    u = np.arange(10.0).reshape(5, 2)
    law = RelevanceIlc(None, Doubling(), (1.0, 0.0, 1.0))
    np.testing.assert_allclose(law.update(u, u), 2.0 * u, rtol=1e-15)
    np.testing.assert_allclose(law.update(u, 0.0 * u, None), 2.0 * u, rtol=1e-15)
    assert len(law) == 2
    axis = discretize(second_order(157.0, 0.5), 0.002)
    core = NormOptimalIlc(axis, N, rate=3.0)
    u, e, _ = runs(1)[0]
    law = RelevanceIlc(None, core, (1.0, 0.0, 1.0))
    np.testing.assert_array_equal(law.update(u, e), core.update(u, e))
    assert "NormOptimalIlc" in repr(law)


def test_a_core_that_fails_says_so() -> None:
    class Broken:
        def update(self, u: object, e: object, disturbance: object = None) -> object:
            message = "no idea"
            raise ValueError(message)

    law = RelevanceIlc(None, Broken(), (1.0, 0.0, 1.0))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no idea") as raised:
        law.update(np.zeros(3), np.zeros(3))
    assert raised.traceback[-1].name == "update"


def test_trimming_keeps_the_runs_most_relevant_for_a_disturbance() -> None:
    made = runs(30)
    law = RelevanceIlc(None, PdIlc(1.0, 0.0), WEIGHTS, dt_s=DT_S)
    for u, e, d in made:
        law.remember(u, e, d)
    numbers, _ = law.relevant(0.3)
    np.testing.assert_array_equal(law.trim(7, [0.3]), np.sort(numbers[:7]))
    assert len(law) == 7
    assert len(law.trim(3)) == 3
    assert len(law) == 3


def test_flexible_learning_interpolates_between_two_entries() -> None:
    law = FlexibleIlc(None, PdIlc(1.0, 0.0), tolerance=0.1)
    for d, value in [(0.0, 1.0), (10.0, 3.0), (50.0, 11.0), (10.05, 5.0)]:
        law.remember(np.full(3, value), np.zeros(3), disturbance=d)
    assert len(law) == 3
    for d, expected in [(-9.0, 1.0), (2.5, 2.0), (10.0, 5.0), (30.0, 8.0), (99.0, 11.0)]:
        again = FlexibleIlc(None, PdIlc(1.0, 0.0))
        for own, value in [(0.0, 1.0), (10.0, 5.0), (50.0, 11.0)]:
            again.remember(np.full(3, value), np.zeros(3), disturbance=own)
        found = again.update(np.zeros(3), np.zeros(3), disturbance=d)
        np.testing.assert_allclose(found, np.full(3, expected), atol=1e-12)


def bad_update(**change: Any) -> None:
    law = RelevanceIlc(None, PdIlc(1.0, 0.0), WEIGHTS, dt_s=DT_S)
    law.expect([1.0, 2.0])
    law.update(np.zeros(4), np.zeros(4), [1.0, 2.0])
    good = {"u": np.zeros(4), "e": np.zeros(4), "disturbance": [1.0, 2.0]}
    law.update(**{**good, **change})


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"u": np.zeros(3)}, "shape"),
        ({"u": np.zeros((4, 2))}, "u has shape"),
        ({"e": np.zeros(3)}, "e has shape"),
        ({"e": np.array([0.0, np.nan, 0.0, 0.0])}, "e holds nan"),
        ({"disturbance": 1.0}, "1 numbers; 2 needed"),
        ({"disturbance": [1.0, np.inf]}, "disturbance holds inf"),
        ({"disturbance": [[1.0, 2.0]]}, "disturbance has shape"),
        ({"disturbance": []}, "disturbance has shape"),
    ],
)
def test_one_wrong_thing_at_a_time_is_refused(change: dict[str, Any], match: str) -> None:
    bad_update()
    with pytest.raises(ValueError, match=re.compile(match, re.IGNORECASE)):
        bad_update(**change)


def test_wrong_laws_are_refused() -> None:
    core = PdIlc(1.0, 0.0)
    with pytest.raises(TypeError, match="core = 3"):
        RelevanceIlc(None, 3, WEIGHTS, dt_s=DT_S)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="weights = 'x'"):
        RelevanceIlc(None, core, "x", dt_s=DT_S)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="dt_s = None"):
        RelevanceIlc(None, core, WEIGHTS)
    with pytest.raises(LearningError, match="top = 0"):
        RelevanceIlc(None, core, WEIGHTS, 0, dt_s=DT_S)
    with pytest.raises(LearningError, match="dt_s = -1"):
        RelevanceIlc(None, core, WEIGHTS, dt_s=-1.0)
    with pytest.raises(LearningError, match="error = -1"):
        RelevanceWeights(error=-1.0)
    with pytest.raises(LearningError, match="rate_filter_s = 0"):
        RelevanceWeights(rate_filter_s=0.0)
    with pytest.raises(LearningError, match="tolerance = -1"):
        FlexibleIlc(None, core, -1.0)
    weights = RelevanceWeights(error=1.0, error_rate=0.0, disturbance=[1.0, 2.0], epsilon=0.5)
    np.testing.assert_array_equal(weights.disturbance, [1.0, 2.0])
    assert (weights.epsilon, weights.error_gain, weights.input_gain) == (0.5, 1.0, 1.0)


def test_a_library_feeds_a_law(tmp_path: Path) -> None:
    library = Library(tmp_path / "runs.db")
    made = runs(8)
    for u, e, d in made:
        library.append(u, e, DT_S, d, cell="motor")
    library.append(np.zeros(N), np.zeros(N), DT_S, cell="motor")
    library.append(np.zeros(N), np.zeros(N), DT_S, 0.0, cell="other")
    filled = RelevanceIlc(library, PdIlc(1.0, 0.5), WEIGHTS, 5, cell="motor")
    bare = RelevanceIlc(None, PdIlc(1.0, 0.5), WEIGHTS, 5, dt_s=DT_S)
    for u, e, d in made:
        bare.remember(u, e, d)
    u, e, _ = runs(1)[0]
    for law in (filled, bare):
        law.expect(0.1)
    np.testing.assert_array_equal(filled.update(u, e, 0.2), bare.update(u, e, 0.2))
    assert len(filled) == len(bare) == 9
    table = FlexibleIlc(library, PdIlc(1.0, 0.5), cell="motor")
    table.update(u, e, 0.2)
    assert len(table) == 8


def test_the_library_recalls_trims_and_exports(tmp_path: Path, ilc: Ilc) -> None:
    library = Library(tmp_path / "runs.db")
    for d, scale in [(20.0, 3.0), (20.0, 1.0), (80.0, 2.0), (80.0, 0.5)]:
        library.append(np.zeros(5), np.full(5, scale), 0.01, d, cell="motor")
    near = library.recall(30.0, 3)
    assert [(row["id"], row["distance"]) for row in near] == [(1, 10.0), (2, 10.0), (3, 50.0)]
    assert near[0]["disturbance"] == [20.0]
    assert near[0]["tracking_rms_m"] == pytest.approx(3.0)
    assert library.recall(30.0, 3, cell="other") == []
    with pytest.raises(ValueError, match="finite"):
        library.recall(np.nan)
    for ending in ("npz", "csv", "json"):
        library.export(1, tmp_path / f"run.{ending}")
    with np.load(tmp_path / "run.npz") as file:
        np.testing.assert_array_equal(file["disturbance"], [20.0])
        np.testing.assert_array_equal(file["error_m"], np.full((5, 1), 3.0))
    assert "# disturbance = [20.0]" in (tmp_path / "run.csv").read_text()
    assert json.loads((tmp_path / "run.json").read_text())["disturbance"] == [20.0]
    with pytest.raises(BadInputError, match="ending"):
        library.export(1, tmp_path / "run.xyz")
    assert library.trim(2, cell="other") == 0
    trimmed = ilc("library", "trim", "runs.db", "2")
    assert trimmed.stdout.startswith("2 runs deleted"), trimmed.stderr
    shown = ilc("library", "show", "runs.db", "4").stdout
    assert [line.split() for line in shown.splitlines() if line.startswith("dist")] == [
        ["disturbance", "80"]
    ]
    assert [row["id"] for row in library.list()] == [2, 4]
    with pytest.raises(ValueError, match="e has shape"):
        library.append(np.zeros(5), np.zeros(4), 0.01)
    with pytest.raises(ValueError, match="cycle_s = 0"):
        library.append(np.zeros(5), np.zeros(5), 0.0)


def campaign(folder: Path, law: Any, **options: Any) -> Campaign:
    return Campaign(GANTRY, law, folder / "runs.db", bus="loopback:", **options)


def test_a_campaign_measures_keeps_and_tells_the_disturbance(tmp_path: Path) -> None:
    told: list[Any] = []

    class Listener:
        def update(
            self, u: NDArray[Any], e: NDArray[Any], disturbance: NDArray[Any] | None = None
        ) -> NDArray[Any]:
            told.append(None if disturbance is None else disturbance.tolist())
            return u

        def expect(self, disturbance: NDArray[Any]) -> None:
            told.append(("first", disturbance.tolist()))

    asked: list[int] = []

    def thermometer(run: int) -> float:
        asked.append(run)
        return 20.0 + run

    records = list(campaign(tmp_path, Listener(), disturbance=thermometer).run(3))
    assert asked == [0, 1, 2]
    # Nothing is known about a run after the last.
    assert told == [("first", [20.0]), [21.0], [22.0], None]
    kept = [record.disturbance for record in records]
    np.testing.assert_array_equal(np.ravel(kept), [20.0, 21.0, 22.0])
    assert [row["index"] for row in Library(tmp_path / "runs.db").recall(21.9, 1)] == [2]


def test_a_resumed_campaign_weighs_what_the_whole_one_does(tmp_path: Path) -> None:
    def law(library: Library | None = None) -> RelevanceIlc:
        weights = RelevanceWeights(error=1e6, error_rate=0.0, disturbance=1e-3, epsilon=1e-3)
        core = PdIlc(0.5, 0.0, signal.butterworth(2, 4.0, 0.002), lead_samples=9)
        return RelevanceIlc(library, core, weights, dt_s=0.002)

    temperatures = [20.0, 30.0, 25.0, 21.0, 29.0]
    (tmp_path / "a").mkdir()
    whole = list(campaign(tmp_path / "a", law(), disturbance=temperatures).run(5))
    for name, make in [("b", law), ("c", lambda: law(Library(tmp_path / "c" / "runs.db")))]:
        (tmp_path / name).mkdir()
        list(campaign(tmp_path / name, law(), disturbance=temperatures).run(3))
        rest = campaign(tmp_path / name, make(), disturbance=temperatures, resume=True)
        first, *_ = list(rest.run(5))
        # The first run after the break receives exactly the input it would have received without;
        # its drives were restarted, so their measurements differ.
        np.testing.assert_array_equal(first.input, whole[3].input)
        assert isinstance(rest.law, RelevanceIlc)
        assert len(rest.law) == 5


def test_a_disturbance_that_cannot_be_used_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="at least 3 runs"):
        list(campaign(tmp_path, None, disturbance=[20.0, 21.0]).run(3))
    with pytest.raises(BadInputError, match="finite"):
        list(campaign(tmp_path, None, disturbance=[20.0, np.nan, 1.0]).run(3))

    def broken(run: int) -> float:
        message = f"no sensor in run {run}"
        raise RuntimeError(message)

    with pytest.raises(ilc_rt.CampaignError, match="no sensor in run 0"):
        list(campaign(tmp_path, None, disturbance=broken).run(3))
