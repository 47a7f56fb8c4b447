"""`Law.update(out=…)`: the next input in an array of the caller, and what may share memory."""

from __future__ import annotations

import numpy as np
import pytest
from test_law_border import AXIS, LAWS, E, N, U

from ilc_rt import ConstrainedIlc, LearningError, NormOptimalIlc, PdIlc

# Longer than what is read in place: the law works on copies.
LONG = 3000
RNG = np.random.default_rng(3)
LONG_U, LONG_E = RNG.normal(size=(2, LONG))


@pytest.mark.parametrize("kind", LAWS)
def test_every_law_writes_into_the_given_array_what_it_returns_otherwise(kind):
    expected = LAWS[kind]().update(U, E)
    out = np.full(N, np.nan)
    assert LAWS[kind]().update(U, E, out=out) is out
    np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize("kind", LAWS)
def test_the_input_may_be_replaced_in_place(kind):
    law, again = LAWS[kind](), LAWS[kind]()
    u, expected = U.copy(), U
    for _ in range(3):
        expected = again.update(expected, E)
        assert law.update(u, E, out=u) is u
        np.testing.assert_array_equal(u, expected)


def test_long_runs_of_several_channels_too_and_in_turn_with_new_arrays():
    axes = AXIS.append(AXIS)
    u, e = LONG_U.reshape(-1, 2).copy(), LONG_E.reshape(-1, 2)
    law = NormOptimalIlc(axes, LONG // 2, r=0.1)
    first, given = law.update(u, e), u.copy()
    out = np.empty_like(u)
    for _ in range(2):
        np.testing.assert_array_equal(law.update(u, e, out=out), first)
        np.testing.assert_array_equal(law.update(u, e), first)
    np.testing.assert_array_equal(u, given)
    np.testing.assert_array_equal(law.update(u, e, out=u), first)


@pytest.mark.parametrize(("u", "e"), [(U, E), (LONG_U, LONG_E)], ids=["short", "long"])
def test_memory_that_is_shared_in_part_is_refused_with_its_name(u, e):
    n = len(u)
    law = NormOptimalIlc(AXIS, n, r=0.1)
    room = np.zeros(2 * n)
    room[:n] = u
    with pytest.raises(ValueError, match=r"^out shares memory with u"):
        law.update(room[:n], e, out=room[1 : n + 1])
    own = e.copy()
    with pytest.raises(ValueError, match=r"^out shares memory with e"):
        law.update(u, own, out=own)
    np.testing.assert_array_equal(own, e)
    # Neighbours in memory, and one array for both signals, share nothing that is written.
    expected = law.update(u, u)
    np.testing.assert_array_equal(law.update(room[:n], room[:n], out=room[n:]), expected)
    with pytest.raises(ValueError, match=r"^out shares memory with e"):
        law.update(room[:n], room[:n], out=room[:n])


@pytest.mark.parametrize(
    ("out", "error", "line"),
    [
        (np.zeros(N - 1), ValueError, r"out has shape \(59,\); \(60,\), as of u, is needed"),
        (np.zeros((N, 1)), ValueError, r"out has shape \(60, 1\); \(60,\), as of u, is needed"),
        (np.zeros(N, np.float32), TypeError, "out is a ndarray of dtype float32; an ndarray of"),
        ([0.0] * N, TypeError, "out is a list; an ndarray of float64 is needed"),
        (np.zeros(2 * N)[::2], ValueError, "out is a view with gaps, in another order or"),
        (np.frombuffer(bytes(8 * N)), ValueError, "out is a view with gaps, .* or read-only"),
    ],
    ids=["short", "wide", "float32", "list", "gaps", "read-only"],
)
def test_what_cannot_be_written_is_refused(out, error, line):
    for law in (NormOptimalIlc(AXIS, N, r=0.1), PdIlc(0.4, 0.0)):
        with pytest.raises(error, match=f"^{line}"):
            law.update(U, E, out=out)
        assert law.update(U, E).shape == (N,)


def test_a_refused_update_leaves_the_input_alone():
    law = ConstrainedIlc(AXIS, N, r=0.1, input_max=0.4)
    u = U.copy()
    with pytest.raises(ValueError, match="e holds NaN at"):
        law.update(u, np.where(np.arange(N) == 5, np.nan, E), out=u)
    np.testing.assert_array_equal(u, U)


def test_an_exception_of_the_law_gives_the_input_back():
    """Finite signals whose update overflows."""
    for n in (N, LONG):
        law = NormOptimalIlc(AXIS, n, r=1e-9)
        u = np.linspace(0.0, 1.0, n)
        given = u.copy()
        with pytest.raises(LearningError):
            law.update(u, np.full(n, 1e308), out=u)
        np.testing.assert_array_equal(u, given)
