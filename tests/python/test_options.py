"""The options of the controller are the same in every interface, as `ilc-rt` describes them."""

from __future__ import annotations

import inspect
import re
import subprocess
from typing import TYPE_CHECKING

import pytest

from ilc_rt import Campaign, _native, identify
from ilc_rt.errors import BadInputError
from ilc_rt.options import Option, arguments, options
from ilc_rt.processes import find_program

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

#: Options with another form in Python: the argument of `run`, and `drives`.
ELSEWHERE = {"iterations", "simulated"}


def help_of(verb: str) -> str:
    return subprocess.run(
        [find_program("ilc-rt"), verb, "--help"],
        capture_output=True, text=True, check=True, timeout=60,
    ).stdout  # fmt: skip


def test_a_campaign_has_every_option_with_its_default():
    parameters = inspect.signature(Campaign).parameters
    for name, option in options("run").items():
        if name in ELSEWHERE:
            continue
        default = parameters[name].default
        # By default, Python paces by answers on loopback only.
        assert option.words(default) == [], name
        assert f"    {name} : " in (Campaign.__doc__ or ""), name


def test_an_identification_has_every_option_with_its_default():
    parameters = inspect.signature(identify.multisine).parameters
    for name, option in options("identify").items():
        if name in ELSEWHERE | {"waveform", "library"} or option.kind == "renamed":
            continue
        assert option.words(parameters[name].default) == [], name


@pytest.mark.parametrize("verb", ["run", "identify"])
def test_both_programs_have_the_same_names_and_say_the_same(verb, ilc):
    ours, theirs = ilc(verb, "--help").stdout, help_of(verb)
    for option in options(verb).values():
        if option.kind == "renamed":
            assert not re.search(rf"{option.flags[0]}\b(?!-)", ours + theirs), option.name
            continue
        assert option.flags[0] in theirs
        assert option.help.rstrip(".") in " ".join(theirs.split())
        if option.name != "simulated":
            assert option.flags[0] in ours, option.name


def test_words_are_those_that_the_controller_parses():
    given = {
        "iterations": 3, "bus": "udp:239.74.163.9", "learning": False, "resume": True,
        "library": "-odd.db", "telemetry": True, "measure": None,
    }  # fmt: skip
    words = arguments("run", given)
    assert "--library=-odd.db" in words
    assert "--no-telemetry" not in words
    _native.check_options("run", words)
    _native.check_options("identify", arguments("identify", {"amplitude": -1e-5, "at_m": -0.5}))
    with pytest.raises(ValueError, match="verb = 'walk'"):
        _native.check_options("walk", [])
    with pytest.raises(ValueError, match="verb = 'walk'"):
        _native.described_options("walk")


def test_a_number_that_is_the_default_is_no_word_however_it_is_written():
    pause = Option("pause_s", ("--pause-s",), "", "number", "0", (), None)
    assert pause.words(0) == pause.words(0.0) == []
    assert pause.words(0.5) == ["--pause-s", "0.5"]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda cell: Campaign(cell).events(0), "--iterations <N>': allowed 1 to 4294967295"),
        (lambda cell: Campaign(cell).events(2**32), "allowed 1 to 4294967295"),
        (lambda cell: Campaign(cell).events(2.5), "invalid value '2.5'"),
        (lambda cell: Campaign(cell, measure="nose").events(1), "possible values: encoder, tcp"),
    ],
)
def test_a_value_out_of_range_is_refused_before_anything_starts(
    make: Callable[[Path], object], says: str, gantry: Path, tmp_path: Path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInputError) as refusal:
        next(make(gantry))
    assert says in refusal.value.reason
    assert not list(tmp_path.iterdir())
