"""Border of all laws of the package: names, numbers, arrays, exceptions, borrowing."""

from __future__ import annotations

import copy
import inspect
import pickle
import threading
import traceback
from pathlib import Path

import numpy as np
import pytest

from ilc_rt import (
    AdjointIlc,
    Campaign,
    CampaignError,
    ConstrainedIlc,
    ErrorFeedforwardIlc,
    Gate,
    Ladder,
    LearningError,
    ModelInverseIlc,
    NormOptimalIlc,
    PdIlc,
    RelevanceIlc,
    RelevanceWeights,
    ThroughJacobian,
    analyze,
    discretize,
    second_order,
    signal,
)
from ilc_rt.analysis import refuse_divergent
from ilc_rt.laws import Law

N = 60
AXIS = discretize(second_order(94.0, 0.7), 0.002)
RNG = np.random.default_rng(17)
U, E = RNG.normal(size=(2, N))
HUGE = 10**400

LAWS = {
    "pd": lambda: PdIlc(0.4, 0.1, signal.butterworth(2, 40.0, 0.002), 2),
    "feedforward": lambda: ErrorFeedforwardIlc(0.4, None, 3, 0.5),
    "adjoint": lambda: AdjointIlc(AXIS, N),
    "inverse": lambda: ModelInverseIlc(AXIS, N, 0.5),
    "optimal": lambda: NormOptimalIlc(AXIS, N, r=0.1),
    "constrained": lambda: ConstrainedIlc(AXIS, N, r=0.1, input_max=0.4),
    "gate": lambda: Gate(PdIlc(0.4, 0.0), 0.1),
    "ladder": lambda: Ladder(PdIlc(0.4, 0.0), 1),
    "jacobian": lambda: ThroughJacobian(PdIlc(0.4, 0.0), [[2.0]]),
    "relevance": lambda: RelevanceIlc(None, PdIlc(0.4, 0.0), (1.0, 0.0, 1.0)),
}


class Broken:
    """A law that raises, from a function of its own."""

    def update(self, u, e, disturbance=None):
        """Raise KeyError."""
        return self.look_up("gain")

    def look_up(self, name):
        """Raise KeyError."""
        return {}[name]


@pytest.mark.parametrize(
    ("call", "old", "new"),
    [
        (PdIlc, "lead", "lead_samples"),
        (ErrorFeedforwardIlc, "gain", "gain_per_s"),
        (ErrorFeedforwardIlc, "lead", "lead_samples"),
        (ErrorFeedforwardIlc, "limit", "input_max"),
        (lambda **given: ConstrainedIlc(AXIS, N, **given), "u_bounds", "input_max"),
        (lambda **given: ConstrainedIlc(AXIS, N, **given), "v_bounds", "change_max"),
        (lambda **given: ConstrainedIlc(AXIS, N, **given), "step_bounds", "step_max"),
        (RelevanceWeights, "e", "error"),
        (RelevanceWeights, "er", "error_rate"),
        (RelevanceWeights, "d", "disturbance"),
    ],
)
def test_an_argument_that_was_renamed_is_refused_with_its_new_name(call, old, new):
    with pytest.raises(TypeError, match=f"^{old}: is called {new} now$"):
        call(**{old: 1.0})


@pytest.mark.parametrize("kind", LAWS)
def test_every_law_derives_from_the_one_and_documents_its_parameters(kind):
    law = LAWS[kind]()
    assert isinstance(law, Law)
    text = inspect.getdoc(type(law))
    for name in inspect.signature(type(law)).parameters:
        assert f"{name} :" in text or f"{name}, " in text or f", {name} :" in text, name
    for section in ("Parameters", "Raises", "References", "Examples"):
        assert f"\n{section}\n----" in text
    assert "n_samples, n_inputs" in inspect.getdoc(law.update)


@pytest.mark.parametrize("kind", LAWS)
def test_any_array_of_numbers_gives_the_same_update(kind):
    u, e = U.astype(np.float32), E.astype(np.float32)
    expected = LAWS[kind]().update(u.astype(float), e.astype(float))
    apart = np.zeros((N, 3))
    apart[:, 1] = e
    bytes_of_e = np.frombuffer(b"x" + e.astype(float).tobytes(), np.uint8)[1:]
    for given_u, given_e in [
        (u, e),
        (u.tolist(), e.tolist()),
        (u.astype(">f8"), e.astype(">f8")),
        (u.astype(float)[::-1][::-1], apart[:, 1]),
        (u.astype(float), bytes_of_e.view(float)),
    ]:
        np.testing.assert_array_equal(LAWS[kind]().update(given_u, given_e), expected)
    np.testing.assert_array_equal(LAWS[kind]().update(u[:, None], e[:, None])[:, 0], expected)


@pytest.mark.parametrize("kind", LAWS)
def test_an_update_leaves_its_arguments_alone_and_returns_an_array_of_its_own(kind):
    u, e = U.copy(), E.copy()
    law = LAWS[kind]()
    first = law.update(u, e)
    np.testing.assert_array_equal(u, U)
    np.testing.assert_array_equal(e, E)
    kept = first.copy()
    law.update(first, e)
    np.testing.assert_array_equal(first, kept)


# A law that remembers its runs keeps the disturbances and the size of the first one.
FORGETFUL = [kind for kind in LAWS if kind != "relevance"]


@pytest.mark.parametrize("kind", FORGETFUL)
def test_every_law_takes_a_disturbance_and_forgets(kind):
    law = LAWS[kind]()
    first = law.update(U, E)
    assert law.update(U[:, None], E[:, None], [21.5]).shape == (N, 1)
    law.reset()
    np.testing.assert_array_equal(law.update(U, E), first)
    assert type(law).__name__ in repr(law)


@pytest.mark.parametrize("name", ["u", "e"])
@pytest.mark.parametrize(
    ("spoil", "error"),
    [
        (lambda x: x[:-1], ValueError),
        (lambda x: np.column_stack([x, x]), ValueError),
        (lambda x: x.reshape(1, -1, 1), ValueError),
        (lambda x: x[:0], ValueError),
        (lambda x: np.where(np.arange(x.size) == 7, np.nan, x), ValueError),
        (lambda x: np.where(np.arange(x.size) == 7, -np.inf, x), ValueError),
        (lambda x: x.astype(np.longdouble), TypeError),
        (lambda x: x.astype(np.complex128), TypeError),
        (lambda x: x.astype(object), TypeError),
        (lambda x: None, TypeError),
    ],
    ids=["short", "wide", "axes", "empty", "nan", "inf", "longdouble", "complex", "object", "none"],
)
@pytest.mark.parametrize("kind", FORGETFUL)
def test_each_bad_array_is_refused_by_name(kind, name, spoil, error):
    law = LAWS[kind]()
    arrays = {"u": U, "e": E}
    arrays[name] = spoil(arrays[name])
    # For a law without a fixed size, a consistent array makes the other one the wrong one.
    with pytest.raises(error, match=r"^[ue] (has|holds)"):
        law.update(**arrays)
    assert law.update(U, E).shape == (N,)


def test_channels_first_is_refused_with_the_shape_given_and_the_shape_wanted():
    law = NormOptimalIlc(AXIS.append(AXIS), N, r=0.1)
    with pytest.raises(ValueError, match=r"u has shape \(2, 60\); \(60, 2\) is needed"):
        law.update(np.zeros((2, N)), np.zeros((N, 2)))
    with pytest.raises(ValueError, match=r"e has shape \(2, 60\); \(60, 2\) is needed"):
        law.update(np.zeros((N, 2)), np.zeros((2, N)))
    with pytest.raises(ValueError, match=r"e has shape \(2, 60\); \(60,\) or \(60, n_channels\)"):
        PdIlc(0.4, 0.0).update(np.zeros((N, 2)), np.zeros((2, N)))


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda x: PdIlc(x, 0.0), "kp"),
        (lambda x: ErrorFeedforwardIlc(x), "gain_per_s"),
        (lambda x: ModelInverseIlc(AXIS, N, x), "gain"),
        (lambda x: NormOptimalIlc(AXIS, N, rate=x), "rate"),
        (lambda x: Gate(PdIlc(), tolerance=x), "tolerance"),
        (lambda x: Ladder(PdIlc(), slow=x), "slow"),
        (lambda x: RelevanceWeights(error=x), "error"),
        (lambda x: signal.butterworth(2, x, 0.002), "cutoff_hz"),
        (lambda x: second_order(x, 0.7), "natural_frequency_rad_s"),
        (lambda x: analyze(PdIlc(), AXIS, N, noise_std=x), "noise_std"),
    ],
)
def test_an_integer_beyond_the_largest_float_is_a_value_error(call, name):
    with pytest.raises(ValueError, match=f"{name} = .*only finite numbers are allowed"):
        call(HUGE)
    with pytest.raises(TypeError, match=f"{name} = 'x' is a str; a number is needed"):
        call("x")


@pytest.mark.parametrize(
    "around",
    [
        Gate,
        lambda law: Ladder(law, 1),
        lambda law: ThroughJacobian(law, [[1.0]]),
        lambda law: RelevanceIlc(None, law, (1.0, 0.0, 1.0)),
        lambda law: Ladder(Gate(law), 1),
    ],
)
def test_the_exception_of_a_law_comes_out_with_its_traceback(around):
    law = around(Broken())
    for _ in range(2):
        with pytest.raises(KeyError, match="gain") as raised:
            law.update(U, E)
        frames = [frame.name for frame in traceback.extract_tb(raised.value.__traceback__)]
        assert frames[-2:] == ["update", "look_up"]


def test_the_exception_of_a_law_is_the_cause_of_the_end_of_its_campaign(tmp_path):
    cell = Path(__file__).parents[2] / "examples" / "01_gantry.toml"
    campaign = Campaign(cell, Broken(), library=tmp_path / "runs.db", bus="loopback:")
    with pytest.raises(CampaignError, match="the law Broken failed: KeyError: 'gain'") as raised:
        list(campaign.run(3))
    cause = raised.value.__cause__
    assert isinstance(cause, KeyError)
    frames = [frame.name for frame in traceback.extract_tb(cause.__traceback__)]
    assert frames[-2:] == ["update", "look_up"]


def test_a_law_that_asks_the_gate_round_it_in_an_update_is_an_error_and_no_deadlock():
    class Curious:
        def update(self, u, e, disturbance=None):
            return gate.best_input

    gate = Gate(Curious())
    with pytest.raises(RuntimeError, match="in the middle of an update"):
        gate.update(U, E)
    assert gate.state == "learning"


def test_threads_take_turns_with_one_law():
    law = Gate(PdIlc(0.4, 0.1, signal.butterworth(2, 40.0, 0.002)))
    expected = law.update(U, E)
    found = []

    def work():
        for _ in range(50):
            found.append(law.update(U, E))
            assert law.state == "learning"

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert len(found) == 200
    for update in found:
        np.testing.assert_array_equal(update, expected)


def test_a_class_of_ones_own_is_pickled_with_what_it_keeps():
    law = pickle.loads(pickle.dumps(OwnPd(2.0)))
    assert type(law) is OwnPd
    assert law.note == "own"
    np.testing.assert_array_equal(law.update(U, E), PdIlc(2.0, 0.0).update(U, E))
    assert copy.copy(law).parameters == law.parameters


class OwnPd(PdIlc):
    """A law of the package with a constructor of its own."""

    def __new__(cls, kp):
        """Take one gain."""
        return super().__new__(cls, kp, 0.0)

    def __init__(self, kp):
        self.note = "own"


@pytest.mark.parametrize(
    "around",
    [
        Gate,
        Ladder,
        lambda law: ThroughJacobian(law, [[1.0]]),
        lambda law: RelevanceIlc(None, law, (1.0, 0.0, 1.0)),
    ],
)
def test_the_analysis_asks_what_is_round_a_law_and_not_its_class(around):
    with pytest.raises(LearningError, match="will not converge"):
        refuse_divergent(around(PdIlc(5.0, 0.0)), AXIS, 200)
    refuse_divergent(around(AdjointIlc(AXIS, 200)), AXIS, 200)
    # What is round the law has seen no run of the analysis.
    law = around(PdIlc(5.0, 0.0))
    analyze(law, AXIS, 200)
    if isinstance(law, Gate):
        assert law.best_error is None


def test_filters_compare_by_what_they_do():
    first = signal.butterworth(2, 40.0, 0.002)
    assert first == signal.butterworth(2, 40.0, 0.002)
    assert hash(first) == hash(signal.butterworth(2, 40.0, 0.002))
    assert first != signal.butterworth(2, 41.0, 0.002)
    assert first != signal.gaussian(40.0, 0.002)
    assert discretize(second_order(94.0, 0.7), 0.002) == AXIS
    assert discretize(second_order(95.0, 0.7), 0.002) != AXIS
    assert RelevanceWeights() == RelevanceWeights(disturbance=0.5)
