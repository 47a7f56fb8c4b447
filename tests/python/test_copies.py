"""Pickling, copying and repr of every public class, in every module.

A new class without an example in `classes_fixture` fails the first test.
"""

import copy
import dataclasses
import importlib
import inspect
import pickle

import numpy as np
import pytest
from classes_fixture import EXAMPLES, MODULES, N, axis, both, line, updated

import ilc_rt
from ilc_rt import Campaign, Gate, Library, NormOptimalIlc, PdIlc, weights

# Not values: a connection to a file, an interface, a running controller or experiment.
OTHERS = {
    Library,
    ilc_rt.ReadOnlyLibrary,
    ilc_rt.Law,
    ilc_rt.signal.Filter,
    Campaign,
    ilc_rt.Experiment,
}


def attributes(thing):
    """Return all readable attributes of an object."""
    if dataclasses.is_dataclass(thing):
        return {field.name: getattr(thing, field.name) for field in dataclasses.fields(thing)}
    names = [
        name
        for name in dir(type(thing))
        if not name.startswith("_") and not callable(getattr(type(thing), name))
    ]
    return {name: getattr(thing, name) for name in names}


def public_classes():
    found = []
    for module in map(importlib.import_module, MODULES):
        for name in module.__all__:
            thing = getattr(module, name)
            if inspect.isclass(thing) and thing not in found:
                found.append(thing)
    return found


def ways(thing):
    """Return copies made by every method."""
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        yield pickle.loads(pickle.dumps(thing, protocol))
    yield copy.copy(thing)
    yield copy.deepcopy(thing)


def assert_same(first, second):
    if isinstance(first, np.ndarray) or np.isscalar(first):
        np.testing.assert_array_equal(first, second)
    elif isinstance(first, dict):
        assert first.keys() == second.keys()
        for key in first:
            assert_same(first[key], second[key])
    elif isinstance(first, (list, tuple)):
        assert len(first) == len(second)
        for one, other in zip(first, second, strict=True):
            assert_same(one, other)
    elif type(first).__module__.startswith("ilc_rt"):
        assert type(first) is type(second)
        assert repr(first) == repr(second)
    else:
        assert first == second


def test_every_public_class_has_an_example():
    errors = {thing for thing in public_classes() if issubclass(thing, Exception)}
    missing = set(public_classes()) - EXAMPLES.keys() - OTHERS - errors
    assert not missing, f"classes without an example of how they are copied: {missing}"


@pytest.mark.parametrize("kind", EXAMPLES, ids=lambda kind: kind.__name__)
def test_copies_are_what_they_are_copies_of(kind):
    make, does = EXAMPLES[kind]
    thing = make()
    assert type(thing) is kind
    copies = list(ways(thing))
    for other in copies:
        assert type(other) is kind
        assert other is not thing
        assert_same(attributes(thing), attributes(other))
        assert repr(other) == repr(thing)
        assert kind.__name__ in repr(thing)
        assert "\n" not in repr(thing)
    if does is not None:
        # Of an original that has been used since: a copy starts from the initial state.
        expected = does(make())
        for other in copies:
            assert_same(expected, does(other))


@pytest.mark.parametrize(
    "law",
    [
        lambda: NormOptimalIlc.contour(both(), line(), contour=30.0, r=0.01, axes=[0, 1]),
        lambda: NormOptimalIlc.formation(
            [axis(), axis()], N, tracking=0.4, r=0.01, leaders=[0], pairs=[(0, 1)]
        ),
        lambda: NormOptimalIlc.dynamic(both(), N, both(), r=0.1),
        lambda: NormOptimalIlc.dynamic(
            both(), N, input_filter=weights.high_pass(2, 40.0, 0.002, 2), input_weight=0.5
        ),
    ],
    ids=["contour", "formation", "dynamic", "filtered input"],
)
def test_laws_made_by_a_builder_are_copied_by_it(law):
    expected = updated(law(), 2)
    for other in ways(law()):
        np.testing.assert_array_equal(updated(other, 2), expected)


@pytest.mark.parametrize(
    "kind",
    [thing for thing in public_classes() if issubclass(thing, Exception)],
    ids=lambda kind: kind.__name__,
)
def test_errors_keep_their_words_and_their_fields(kind):
    raised = kind("node 2 is silent")
    for other in ways(raised):
        assert type(other) is kind
        assert str(other) == "node 2 is silent"
        assert vars(other) == vars(raised)


def test_a_copy_does_not_follow_what_its_arguments_become():
    q = np.ones(N)
    law = NormOptimalIlc(axis(), N, q=q, r=0.1)
    expected = updated(law)
    q[:] = 100.0
    np.testing.assert_array_equal(updated(copy.copy(law)), expected)


def test_what_a_law_has_learned_stays_with_it():
    gate = Gate(PdIlc(0.4, 0.0), tolerance=10.0)
    updated(gate)
    assert gate.state == "holding"
    # A copy starts from the initial state: it may go to another machine.
    assert copy.deepcopy(gate).state == "learning"


def test_a_library_is_opened_again(tmp_path):
    library = Library(tmp_path / "runs.db")
    assert copy.copy(library).list() == pickle.loads(pickle.dumps(library)).list() == []
