"""Ask and tell: the same runs as a simulation, kept in a library, resumed after any end."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ilc_rt import (
    BadInputError,
    CampaignResult,
    Experiment,
    Gate,
    Ladder,
    Library,
    NormOptimalIlc,
    PdIlc,
    PlantError,
    discretize,
    second_order,
    simulate,
)

if TYPE_CHECKING:
    from pathlib import Path

N = 120
AXIS = discretize(second_order(94.0, 0.7), 0.002)
REFERENCE = 0.01 * np.hanning(N)


def law():
    return Gate(Ladder(NormOptimalIlc(AXIS, N, r=0.3), repeats=2), tolerance=1e-7)


def tell(experiment: Experiment, runs: int) -> None:
    for _ in range(runs):
        experiment.tell(AXIS.simulate(experiment.ask()))


def test_ask_and_tell_make_the_runs_of_a_simulation() -> None:
    experiment = Experiment(law(), REFERENCE, dt_s=0.002)
    tell(experiment, 6)
    expected = simulate(AXIS, law(), REFERENCE, trials=6)
    assert experiment.result.digest == expected.digest
    assert experiment.trial == 6


def test_the_input_stays_until_it_is_told() -> None:
    experiment = Experiment(PdIlc(kp=0.5), REFERENCE)
    tell(experiment, 2)
    first = experiment.ask()
    first[:] = 7.0
    np.testing.assert_array_equal(experiment.ask(), experiment.ask())
    assert np.abs(experiment.ask()).max() < 1.0


def test_a_bad_output_leaves_the_experiment_usable() -> None:
    experiment = Experiment(PdIlc(kp=0.5), REFERENCE)
    tell(experiment, 2)
    y = AXIS.simulate(experiment.ask())
    spoiled = np.where(np.arange(N) == 30, np.nan, y)
    with pytest.raises(PlantError, match="trial 2, sample 30"):
        experiment.tell(spoiled)
    for wrong, words in ((y[:-1], r"shape \(119,\)"), (y.astype(complex), "dtype complex")):
        with pytest.raises((ValueError, TypeError), match=words):
            experiment.tell(wrong)
    assert experiment.trial == 2
    experiment.tell(y)
    expected = simulate(AXIS, PdIlc(kp=0.5), REFERENCE, trials=3)
    assert experiment.result.digest == expected.digest


def test_tell_needs_an_ask() -> None:
    with pytest.raises(ValueError, match="trial 0: tell needs an ask"):
        Experiment(None, REFERENCE).tell(REFERENCE)


@pytest.mark.parametrize("ends_after", [1, 2, 3, 5])
def test_a_resumed_experiment_goes_on_bit_for_bit(tmp_path: Path, ends_after: int) -> None:
    library = tmp_path / "runs.db"
    first = Experiment(law(), REFERENCE, dt_s=0.002, library=library, name="bench")
    tell(first, ends_after)
    first.ask()
    del first
    again = Experiment(law(), REFERENCE, dt_s=0.002, library=library, name="bench", resume=True)
    assert again.trial == ends_after
    tell(again, 6 - ends_after)
    expected = simulate(AXIS, law(), REFERENCE, trials=6)
    assert again.result.digest == expected.digest
    rows = Library(library).list("bench")
    assert [row["index"] for row in rows] == list(range(6))
    stored = CampaignResult.from_library(library)
    assert [r.tracking_rms_m for r in stored.records] == pytest.approx(
        [r.tracking_rms_m for r in expected.records]
    )


def test_a_process_that_is_killed_loses_no_told_run(tmp_path: Path) -> None:
    script = tmp_path / "bench.py"
    script.write_text(
        "import os, signal, sys\nimport numpy as np\n"
        "from ilc_rt import Experiment, PdIlc, discretize, second_order\n"
        "axis = discretize(second_order(94.0, 0.7), 0.002)\n"
        "experiment = Experiment(PdIlc(kp=0.5), 0.01 * np.hanning(120), dt_s=0.002,\n"
        "                        library='runs.db', resume=True)\n"
        "while experiment.trial < 6:\n"
        "    u = experiment.ask()\n"
        "    if experiment.trial == int(sys.argv[1]):\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    experiment.tell(axis.simulate(u))\n"
        "print(experiment.result.digest)\n"
    )
    said = ""
    for ends_at in ("2", "5", "-1"):
        done = subprocess.run(
            [sys.executable, str(script), ends_at], cwd=tmp_path, capture_output=True, text=True,
            timeout=100, check=False,
        )  # fmt: skip
        assert done.returncode == (0 if ends_at == "-1" else -9), done.stderr
        said = done.stdout.strip()
    assert said == simulate(AXIS, PdIlc(kp=0.5), REFERENCE, trials=6).digest


def test_a_simulation_is_resumed_with_its_noise(tmp_path: Path) -> None:
    library, keywords = tmp_path / "runs.db", {"noise_std": 1e-5, "seed": 4}
    simulate(AXIS, law(), REFERENCE, trials=3, library=library, **keywords)
    resumed = simulate(AXIS, law(), REFERENCE, trials=7, library=library, resume=True, **keywords)
    assert resumed.digest == simulate(AXIS, law(), REFERENCE, trials=7, **keywords).digest


def test_another_law_reference_or_cycle_is_not_resumed(tmp_path: Path) -> None:
    library = tmp_path / "runs.db"
    tell(Experiment(PdIlc(kp=0.5), REFERENCE, library=library), 3)
    for changed, words in (
        ((PdIlc(kp=0.4), REFERENCE, 1.0), "run 1 of campaign .* has another input"),
        ((PdIlc(kp=0.5), 2 * REFERENCE, 1.0), "run 0 .* another reference"),
        ((PdIlc(kp=0.5), REFERENCE, 0.1), "run 0 .* sample time of 1.0 s, not 0.1"),
    ):
        with pytest.raises(BadInputError, match=words):
            Experiment(changed[0], changed[1], dt_s=changed[2], library=library, resume=True)
    # Without resume a new series begins.
    assert Experiment(PdIlc(kp=0.4), REFERENCE, library=library).trial == 0


def test_the_disturbance_reaches_law_and_library(tmp_path: Path) -> None:
    seen = []

    class Law:
        def expect(self, disturbance):
            seen.append(("expect", float(disturbance[0])))

        def update(self, u, e, disturbance=None):
            seen.append(("update", float(disturbance[0])))
            return u + 0.5 * e

    experiment = Experiment(Law(), REFERENCE, library=tmp_path / "runs.db")
    for warmth in (20.0, 21.0, 22.0):
        experiment.tell(AXIS.simulate(experiment.ask(warmth)))
    assert seen == [
        ("expect", 20.0), ("update", 21.0), ("update", 22.0),
    ]  # fmt: skip
    found = Library(tmp_path / "runs.db").recall(21.9)
    assert found[0]["index"] == 2


@pytest.mark.parametrize("wrong", [{"unit": np.zeros(3)}, {"unit": 7}, {"name": 10_000_000_000}])
def test_a_name_or_a_unit_that_is_no_text_is_refused(wrong: dict[str, object]) -> None:
    (key,) = wrong
    with pytest.raises(TypeError, match=rf"^{key} = .*: a text is needed"):
        Experiment(PdIlc(kp=0.5), np.zeros(5), dt_s=0.01, **wrong)
