"""Learning on many plants at once: as `simulate` on each, bit by bit, on any number of threads."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

from ilc_rt import (
    BasisFunctions,
    ConstrainedIlc,
    FlexibleIlc,
    Gate,
    HigherOrderIlc,
    Ladder,
    LearningError,
    Library,
    ModelFreeIlc,
    ModelInverseIlc,
    NormOptimalIlc,
    PdIlc,
    RelevanceIlc,
    RelevanceWeights,
    StateSpace,
    discretize,
    latin_hypercube,
    second_order,
    simulate,
    simulate_many,
    sweep,
)

DT_S = 0.002
N = 203
REFERENCE = 0.01 * np.hanning(N)
MODEL = discretize(second_order(94.0, 0.7), DT_S)
RANGES = {"natural_rad_s": (50.0, 160.0, "log"), "damping": (0.3, 1.2)}
CASES = latin_hypercube(RANGES, 21, seed=3)


def plant(natural_rad_s: float, damping: float) -> StateSpace:
    return discretize(second_order(natural_rad_s, damping), DT_S)


def mismatched() -> list[StateSpace]:
    """Return plants of different orders that differ from the model."""
    plants = [plant(**case) for case in CASES]
    plants[4] = plants[4].delayed(2)
    plants[9] = plants[9].series(discretize(second_order(900.0, 0.2), DT_S))
    plants[10] = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[0.8]], DT_S)
    plants[17] = plants[17].delayed(9)
    return plants


def loop(model: StateSpace, law, reference, trials: int, noise) -> tuple[list, list]:
    """Return inputs and errors by a loop over dense lifted matrices."""
    lifted = model.lifted(len(reference))
    u = np.zeros(reference.size) if model.n_inputs == model.n_outputs else None
    inputs, errors = [], []
    law.reset()
    for trial in range(trials):
        y = (lifted @ u).reshape(reference.shape) + noise[trial]
        inputs.append(u.reshape(reference.shape))
        errors.append(reference - y)
        u = law.update(inputs[-1], errors[-1]).reshape(-1)
    return inputs, errors


@pytest.mark.parametrize(
    "law",
    [
        PdIlc(kp=0.5, kd=0.2),
        NormOptimalIlc(MODEL, N, r=0.1),
        NormOptimalIlc(MODEL, N, q=np.linspace(1.0, 2.0, N), r=0.1),
        Gate(PdIlc(kp=0.4), tolerance=1e-5),
    ],
    ids=["pd", "norm-optimal", "varying weights", "gate"],
)
def test_a_dense_loop_in_numpy_gives_the_same(law) -> None:
    plants = mismatched()
    found = simulate_many(plants, law, REFERENCE, trials=5, noise_std=1e-5, seed=8, keep="all")
    for number in (0, 4, 9, 10, 17, 20):
        noise = [
            1e-5
            * np.random.default_rng(
                np.random.SeedSequence(found.seeds[number], spawn_key=(trial, 0))
            ).standard_normal(N)
            for trial in range(5)
        ]
        inputs, errors = loop(plants[number], law, REFERENCE, 5, noise)
        scale = 1e-11 * np.abs(errors).max()
        np.testing.assert_allclose(found.error[number], errors, atol=scale, rtol=0)
        np.testing.assert_allclose(
            found.input[number], inputs, atol=1e-10 * np.abs(inputs).max(), rtol=0
        )
        rms = np.sqrt(np.mean(np.square(errors), axis=1))
        np.testing.assert_allclose(found.rms[number], rms, rtol=1e-9)
        np.testing.assert_allclose(found.inf[number], np.abs(errors).max(axis=1), rtol=1e-9)


LAWS = {
    "none": None,
    "higher order": HigherOrderIlc(PdIlc(kp=0.5)),
    "pd": PdIlc(kp=0.5, kd=0.2, q_filter=None),
    "norm-optimal": NormOptimalIlc(MODEL, N, r=0.1),
    "rate": NormOptimalIlc(MODEL, N, rate=0.1),
    "constrained": ConstrainedIlc(MODEL, N, r=0.1, input_max=0.011, step_max=3e-4),
    "inverse": ModelInverseIlc(MODEL, N, gain=0.5),
    "gate": Gate(NormOptimalIlc(MODEL, N, r=0.1), tolerance=1e-5),
    "ladder": Ladder(PdIlc(kp=0.5), repeats=2),
    "model-free": ModelFreeIlc(),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("noise_std", [0.0, 1e-5])
def test_every_plant_is_that_of_simulate_bit_by_bit(name: str, noise_std: float) -> None:
    plants, law = mismatched(), LAWS[name]
    ramp = 1e-4 * np.arange(N) / N
    options = {
        "trials": 6,
        "noise_std": noise_std,
        "output_disturbance": lambda trial: trial * ramp,
    }
    found = simulate_many(plants, law, REFERENCE, **options, seed=2, keep="all", threads=2)
    assert found.error.shape == (21, 6, N)
    compared = 0
    for number, own in enumerate(plants):
        seed = found.seeds[number] if noise_std else 0
        try:
            alone = simulate(own, law, REFERENCE, **options, seed=seed)
        except (LearningError, ValueError):
            assert found.diverged[number]
            continue
        compared += 1
        np.testing.assert_array_equal(found.error[number], alone.error[:, :, 0])
        np.testing.assert_array_equal(found.input[number], alone.input[:, :, 0])
        figures = alone.figures()
        np.testing.assert_array_equal(found.rms[number], figures["tracking_rms_m"])
        np.testing.assert_array_equal(found.inf[number], figures["tracking_inf_m"])
    assert compared > 15


@pytest.mark.parametrize("n_samples", [1, 8, 127, 130, 1300, 9001])
@pytest.mark.parametrize("channels", [1, 2, 9])
def test_the_figures_of_any_length_are_those_of_simulate(n_samples: int, channels: int) -> None:
    own = plant(80.0, 0.5)
    for _ in range(channels - 1):
        own = own.append(plant(110.0, 0.4))
    reference = np.random.default_rng(channels).normal(size=(n_samples, channels))
    found = simulate_many([own] * 3, PdIlc(kp=0.3), reference, trials=3, noise_std=0.1)
    alone = simulate(own, PdIlc(kp=0.3), reference, trials=3, noise_std=0.1, seed=found.seeds[1])
    np.testing.assert_array_equal(found.rms[1], alone.figures()["tracking_rms_m"])
    np.testing.assert_array_equal(found.inf[1], alone.figures()["tracking_inf_m"])


def test_coupled_axes() -> None:
    rng = np.random.default_rng(5)
    two = plant(94.0, 0.7).append(plant(120.0, 0.6))
    mixed = [two.series(_gain(np.eye(2) + 0.1 * rng.normal(size=(2, 2)))) for _ in range(11)]
    turn = np.linspace(0.0, 2.0 * np.pi, N)
    circle = 0.02 * np.column_stack([np.cos(turn) - 1.0, np.sin(turn)])
    law = NormOptimalIlc(two, N, r=0.05)
    found = simulate_many(mixed, law, circle, trials=5, noise_std=1e-6, keep="signals")
    assert found.last_error.shape == found.last_input.shape == (11, N, 2)
    assert (found.rms[:, -1] < 0.1 * found.rms[:, 0]).all()
    for number, own in enumerate(mixed):
        alone = simulate(own, law, circle, trials=5, noise_std=1e-6, seed=found.seeds[number])
        np.testing.assert_array_equal(found.last_error[number], alone.error[-1])
        np.testing.assert_array_equal(found.last_input[number], alone.input[-1])
        np.testing.assert_array_equal(found.rms[number], alone.figures()["tracking_rms_m"])
    noise = np.zeros((5, N, 2))
    inputs, errors = loop(mixed[3], law, circle, 5, noise)
    clean = simulate_many(mixed, law, circle, trials=5, keep="all")
    np.testing.assert_allclose(clean.error[3], errors, atol=1e-13)
    np.testing.assert_allclose(clean.input[3], inputs, atol=1e-13)


def _gain(matrix) -> StateSpace:
    return StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), matrix, DT_S)


def test_any_number_of_threads_gives_the_same_bits() -> None:
    plants = mismatched() * 3
    law = Gate(NormOptimalIlc(MODEL, N, r=0.1), tolerance=1e-5)
    options = {"trials": 8, "noise_std": 1e-5, "keep": "all"}
    one = simulate_many(plants, law, REFERENCE, threads=1, **options)
    for threads in (2, 3, 8, 100, None):
        many = simulate_many(plants, law, REFERENCE, threads=threads, **options)
        assert many.digest == one.digest
        np.testing.assert_array_equal(many.input, one.input)
        np.testing.assert_array_equal(many.error, one.error)
    assert simulate_many(plants, law, REFERENCE, **options, seed=1).digest != one.digest
    # The same plant has other noise elsewhere in the list.
    assert one.rms[0, 0] != one.rms[21, 0]


def test_each_plant_may_have_a_law_of_its_own() -> None:
    plants = mismatched()
    shared = PdIlc(kp=0.5)
    laws = [NormOptimalIlc(own, N, r=0.1) for own in plants]
    laws[1] = laws[7] = shared
    found = simulate_many(plants, laws, REFERENCE, trials=4)
    for number, own in enumerate(plants):
        alone = simulate(own, laws[number], REFERENCE, trials=4)
        np.testing.assert_array_equal(found.rms[number], alone.figures()["tracking_rms_m"])
    # A law of the plant itself learns more than one of another plant.
    common = simulate_many(plants, NormOptimalIlc(MODEL, N, r=0.1), REFERENCE, trials=4)
    assert found.rms[2, -1] < common.rms[2, -1]


def test_a_plant_that_diverges_is_infinite_and_its_neighbours_learn_on() -> None:
    plants = [MODEL] * 9
    plants[3] = -4000.0 * MODEL
    plants[6] = StateSpace([[1e9]], [[1.0]], [[1.0]], [[0.0]], DT_S)
    found = simulate_many(plants, PdIlc(kp=0.5), REFERENCE, trials=200, keep="signals")
    assert found.diverged.tolist() == [number in (3, 6) for number in range(9)]
    good = simulate_many([MODEL], PdIlc(kp=0.5), REFERENCE, trials=200)
    for number in (0, 2, 4, 5, 7, 8):
        np.testing.assert_array_equal(found.rms[number], good.rms[0])
    first = int(np.argmax(~np.isfinite(found.rms[3])))
    assert first > 10
    assert np.isfinite(found.rms[3, :first]).all()
    assert np.isinf(found.rms[3, first:]).all()
    assert np.isinf(found.inf[3, first:]).all()
    assert np.isinf(found.last_error[3]).all()
    assert np.isinf(found.last_input[3]).all()
    last = f"{good.rms[0, -1]:.4g}"
    assert repr(found) == f"ManyResult(9 plants, 200 trials: last RMS {last} to {last}, 2 diverged)"


def test_the_law_gets_the_measured_disturbance() -> None:
    weights = RelevanceWeights(error=1.0, error_rate=0.0, disturbance=[1.0], epsilon=1e-9)
    told = [20.0, 25.0, 20.5, 25.5, 21.0]
    for law in (
        RelevanceIlc(None, PdIlc(kp=0.5), weights),
        FlexibleIlc(None, PdIlc(kp=0.5), tolerance=0.1),
        Gate(RelevanceIlc(None, PdIlc(kp=0.5), weights), tolerance=0.0),
    ):
        plants = [MODEL, plant(80.0, 0.5), plant(120.0, 0.9)]
        found = simulate_many(plants, law, REFERENCE, trials=5, disturbance=told, threads=1)
        for number, own in enumerate(plants):
            alone = simulate(own, law, REFERENCE, trials=5, disturbance=np.reshape(told, (5, 1)))
            np.testing.assert_array_equal(found.rms[number], alone.figures()["tracking_rms_m"])
    with pytest.raises(ValueError, match=r"disturbance has shape \(4,\)"):
        simulate_many(plants, law, REFERENCE, trials=5, disturbance=told[:4])


def learned(natural_rad_s: float, damping: float, seed: int) -> np.ndarray:
    law = NormOptimalIlc(MODEL, N, r=0.1)
    result = simulate(
        plant(natural_rad_s, damping), law, REFERENCE, trials=4, noise_std=1e-6, seed=seed
    )
    return result.figures()["tracking_rms_m"]


def test_a_sweep_of_the_same_seed_gives_the_same_bits() -> None:
    slow = sweep(learned, CASES, seed=11)
    fast = simulate_many(
        [plant(**case) for case in CASES], NormOptimalIlc(MODEL, N, r=0.1), REFERENCE,
        trials=4, noise_std=1e-6, seed=11,
    )  # fmt: skip
    np.testing.assert_array_equal(fast.rms, np.array(slow.values))


def test_only_what_is_asked_for_is_kept() -> None:
    plants, law = mismatched(), PdIlc(kp=0.5)
    everything = simulate_many(plants, law, REFERENCE, trials=3, keep="all")
    for keep, names in (
        ("figures", set()), ("errors", {"last_error"}), ("signals", {"last_error", "last_input"}),
    ):  # fmt: skip
        found = simulate_many(plants, law, REFERENCE, trials=3, keep=keep)
        kept = {
            name
            for name in ("last_error", "last_input", "error", "input")
            if getattr(found, name) is not None
        }
        assert kept == names
        assert found.digest == everything.digest
        for name in names:
            np.testing.assert_array_equal(getattr(found, name), getattr(everything, name))
    np.testing.assert_array_equal(everything.error[:, -1], everything.last_error)
    assert everything.seeds is None
    assert len(everything) == 21


def test_laws_in_python_are_refused_with_the_way(tmp_path) -> None:
    class Own:
        def update(self, u, e, disturbance=None):
            return u + 0.5 * e

    class Derived(PdIlc):
        def update(self, u, e, disturbance=None):
            return u + 0.5 * e

    for law, words in (
        (Own(), "law is a Own, which is written in Python.*ilc_rt.sweep"),
        (Derived(kp=0.5), "law is a Derived, which is written in Python"),
        (Gate(Own(), tolerance=1e-5), "law.law is a Own"),
        (BasisFunctions(MODEL, REFERENCE, ["velocity"]), "law is a BasisFunctions"),
        ([PdIlc(kp=0.5), Own()], r"law\[1\] is a Own"),
        (
            FlexibleIlc(Library(tmp_path / "runs.db"), PdIlc(kp=0.5), tolerance=0.1),
            "learns from a library",
        ),
        (7, "law = 7: a law of ilc_rt"),
    ):
        with pytest.raises(TypeError, match=words):
            simulate_many([MODEL, MODEL], law, REFERENCE)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"plants": []}, ValueError, "at least one"),
        ({"plants": [MODEL, lambda u: u]}, TypeError, r"plants\[1\] is a function.*sweep"),
        ({"plants": [second_order(94.0, 0.7)]}, ValueError, r"plants\[0\] is in continuous time"),
        ({"plants": [MODEL, MODEL.append(MODEL)]}, LearningError, "plant 1 has 2 inputs and 2"),
        ({"law": [PdIlc(kp=0.5)]}, ValueError, "1 laws; one, or 2"),
        ({"law": NormOptimalIlc(MODEL, 7)}, LearningError, "plant 0, trial 0.*7 samples"),
        ({"reference": np.ones((N, 2))}, ValueError, r"reference has shape \(203, 2\); \(203, 1\)"),
        ({"reference": [np.nan]}, ValueError, "reference"),
        ({"reference": [1e150]}, ValueError, "reference holds 1e.150"),
        ({"trials": 0}, ValueError, "trials = 0"),
        ({"trials": True}, ValueError, "trials = True"),
        ({"threads": 0}, ValueError, "threads = 0"),
        ({"seed": -1}, ValueError, "seed = -1"),
        ({"noise_std": -1.0}, ValueError, "noise_std = -1"),
        ({"noise_std": np.nan}, ValueError, "noise_std = nan"),
        ({"keep": "some"}, ValueError, "keep = 'some'; one of 'figures'"),
        (
            {"keep": "all", "trials": 50_000, "plants": [MODEL] * 60},
            ValueError,
            "at most 1000000000",
        ),
        ({"initial_input": np.ones(3)}, ValueError, r"initial_input has shape \(3,\)"),
        ({"output_disturbance": np.ones(3)}, ValueError, r"output_disturbance has shape \(3,\)"),
    ],
)
def test_what_does_not_fit_is_named(arguments, error, words) -> None:
    given = {"plants": [MODEL, MODEL], "law": PdIlc(kp=0.5), "reference": REFERENCE} | arguments
    with pytest.raises(error, match=words):
        simulate_many(**given)


def test_ctrl_c_ends_it_and_other_threads_run_meanwhile() -> None:
    """A run of hours is cancelled; until then another thread of Python counts."""
    counted = []
    over = threading.Event()

    def count() -> None:
        while not over.is_set() and len(counted) < 100:
            counted.append(time.monotonic())
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGINT)

    other = threading.Thread(target=count)
    other.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            simulate_many([MODEL] * 64, PdIlc(kp=0.1), np.ones(20_000), trials=50_000, threads=2)
        assert len(counted) == 100
    finally:
        over.set()
        other.join()
