"""Common features of all verbs: versions, targets, numbers, completion."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from typer.main import get_command

import ilc_rt
from ilc_rt import processes
from ilc_rt.cli import VERBS, application

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Ilc = Callable[..., subprocess.CompletedProcess[str]]

HUGE = ["99999999999", "4294967296", "18446744073709551616", "1" + 30 * "0"]


def test_every_program_tells_its_version(ilc: Ilc, tmp_path: Path) -> None:
    told = ilc("--version").stdout.split()
    assert told == ["ilc", ilc_rt.__version__]
    module = subprocess.run([sys.executable, "-m", "ilc_rt", "--version"], cwd=tmp_path, text=True,
                            capture_output=True, check=True)  # fmt: skip
    assert module.stdout.split() == told
    for name in ("ilc-rt", "ilc-sim"):
        program = processes.find_program(name)
        done = subprocess.run([program, "--version"], text=True, capture_output=True, check=True)
        assert done.stdout.split() == [name, ilc_rt.__version__]


@pytest.mark.parametrize(
    "words", [["--version"], ["library", "list", "none.db"], ["plot", "none.db"],
              ["run", "none.toml"]],
)  # fmt: skip
def test_the_program_starts_without_numerics(words: list[str], tmp_path: Path) -> None:
    code = (
        "import sys; from ilc_rt.cli import main; main(sys.argv[1:]);"
        "print([name for name in ('numpy', 'scipy', 'matplotlib', 'zenoh') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, *words], cwd=tmp_path, text=True,
                          capture_output=True, check=True)  # fmt: skip
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_help_of_the_program_is_that_of_its_verbs() -> None:
    """Without their modules, of which none is imported for it."""
    complete: Any = get_command(application())
    assert sorted(complete.commands) == sorted(VERBS)
    for name, summary in VERBS.items():
        first, *_ = complete.commands[name].help.split("\n\n")
        assert " ".join(first.split()) == summary
    code = (
        "import sys; from ilc_rt.cli import main; main(['--help']);"
        "late = ('ilc_rt.commands', 'rich', 'numpy');"
        "print([name for name in sys.modules if name.startswith(late)])"
    )
    done = subprocess.run([sys.executable, "-c", code], text=True, capture_output=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert all(name in done.stdout for name in VERBS)


@pytest.mark.parametrize("words", [[], ["library"], ["bridge"]])
def test_without_a_verb_the_help_is_shown(ilc: Ilc, words: list[str]) -> None:
    told = ilc(*words)
    assert (told.returncode, told.stdout) == (2, "")
    assert told.stderr.startswith("Usage: ilc")
    assert len(told.stderr.splitlines()) > 5


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_both_programs(tmp_path: Path, shell: str) -> None:
    environment = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    done = subprocess.run([sys.executable, "-m", "ilc_rt", "--show-completion", shell], text=True,
                          capture_output=True, check=True, env=environment)  # fmt: skip
    assert "_ILC_COMPLETE" in done.stdout
    program = processes.find_program("ilc-rt")
    script = subprocess.run([program, "completions", shell], text=True, capture_output=True,
                            check=True).stdout  # fmt: skip
    assert "no-telemetry" in script
    if shell == "bash":
        (tmp_path / "script").write_text(script)
        # The completion function that the script names; then a verb, and an option of a verb.
        ask = (
            "source ./script; f=$(complete -p ilc-rt | grep -o '[^ ]*ilc__rt'); "
            'COMP_WORDS=(ilc-rt ru); COMP_CWORD=1; $f ilc-rt ru ilc-rt; echo "${COMPREPLY[@]}"; '
            "COMP_WORDS=(ilc-rt run --no-t); COMP_CWORD=2; $f ilc-rt --no-t run; "
            'echo "${COMPREPLY[@]}"'
        )
        bash = shutil.which("bash")
        assert bash is not None
        found = subprocess.run([bash, "-c", ask], cwd=tmp_path, text=True, capture_output=True,
                               check=True)  # fmt: skip
        assert found.stdout.split() == ["run", "--no-telemetry"], found.stderr


def test_a_tab_completes_verbs_of_ilc() -> None:
    environment = {**os.environ, "_ILC_COMPLETE": "complete_bash", "COMP_WORDS": "ilc libr",
                   "COMP_CWORD": "1"}  # fmt: skip
    done = subprocess.run([sys.executable, "-m", "ilc_rt"], text=True, capture_output=True,
                          check=False, env=environment)  # fmt: skip
    assert done.stdout.split() == ["library"]


@pytest.mark.parametrize("number", HUGE)
@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "CELL", "--bus", "loopback:", "--iterations"],
        ["demo", "--bus", "loopback:", "-n"],
        ["repeatability", "CELL", "--bus", "loopback:", "--runs"],
        ["tune", "CELL", "--runs"],
        ["identify", "CELL", "--axis", "x", "--bus", "loopback:", "--periods"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_number_out_of_range_is_one_line_and_exit_2(
    ilc: Ilc, gantry: Path, arguments: list[str], number: str
) -> None:
    done = ilc(*(str(gantry) if word == "CELL" else word for word in arguments), number)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert re.search(r"\d{5,}", done.stderr), "the limit is named"
    assert "Error" not in done.stderr


def test_a_library_is_asked_for_any_number(ilc: Ilc, finished: Any) -> None:
    for number in HUGE:
        assert ilc("library", "show", finished.library, number).returncode == 2
    assert ilc("library", "trim", finished.library, "1" + 30 * "0").returncode == 2
    assert ilc("library", "trim", finished.library, "-1").returncode == 2


def only_json(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    assert done.returncode == 0, done.stderr
    data: dict[str, Any] = json.loads(done.stdout)
    assert done.stdout.startswith("{")
    assert done.stdout.endswith("}\n")
    return data


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (["run", "CELL", "--bus", "loopback:", "-n", "2"], "iterations"),
        (["demo", "--bus", "loopback:", "-n", "2"], "iterations"),
        (["repeatability", "CELL", "--bus", "loopback:", "--runs", "2"], "axes"),
        (["tune", "CELL"], "cell"),
        (["identify", "CELL", "--axis", "x", "--bus", "loopback:"], "coherence"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else value,
)
def test_figures_stand_alone_on_standard_output(
    ilc: Ilc, gantry: Path, tmp_path: Path, arguments: list[str], key: str
) -> None:
    """Everything else goes to standard error, and no file named ``-`` is created."""
    words = [str(gantry) if word == "CELL" else word for word in arguments]
    done = ilc(*words, "--json", "-")
    # An axis may have no model: the figures are still printed.
    if done.returncode == 1:
        done.returncode = 0
    assert key in only_json(done)
    assert done.stderr
    assert not (tmp_path / "-").exists()


def test_the_controller_prints_figures_alone_as_well(tmp_path: Path) -> None:
    program = processes.find_program("ilc-rt")
    done = subprocess.run([program, "latency", "--seconds", "1", "--json", "-"], cwd=tmp_path,
                          text=True, capture_output=True, check=False)  # fmt: skip
    assert "wake_late_us" in only_json(done)
    assert "woke late" in done.stderr
    refused = subprocess.run([program, "run", "c.toml", "--events", "--json", "-"], cwd=tmp_path,
                             text=True, capture_output=True, check=False)  # fmt: skip
    assert refused.returncode == 2
    assert "--events" in refused.stderr


@pytest.mark.parametrize(
    ("target", "said"),
    [
        (["--json", "no/folder/f.json"], "--json no/folder/f.json: cannot be written"),
        (["--json", "."], "--json .: cannot be written"),
        (["--report", "no/folder/r.html"], "--report no/folder/r.html: cannot be written"),
        (["--report", "no/folder"], "no such folder"),
        (["--report", "file"], "is a file; a folder or a .html file is needed"),
    ],
    ids=lambda value: value[1] if isinstance(value, list) else "",
)
@pytest.mark.parametrize("verb", ["run", "demo"])
def test_targets_are_looked_at_before_anything_moves(
    ilc: Ilc, gantry: Path, tmp_path: Path, verb: str, target: list[str], said: str
) -> None:
    """No run is made, and nothing is left behind."""
    (tmp_path / "file").write_text("")
    cell = [str(gantry)] if verb == "run" else []
    done = ilc(verb, *cell, "--bus", "loopback:", "-n", "1", *target)
    assert done.returncode == 2
    assert done.stdout == ""
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_new_folder_is_told(ilc: Ilc, gantry: Path, tmp_path: Path) -> None:
    """Once, when it is created."""
    words = ["run", str(gantry), "--bus", "loopback:", "-n", "1", "--report", "pictures"]
    first, second = ilc(*words), ilc(*words)
    assert "folder:  pictures is new" in first.stdout
    assert (tmp_path / "pictures" / "ilc-report.html").exists()
    assert "is new" not in second.stdout


def test_a_reader_who_has_gone_is_no_news(finished: Any, tmp_path: Path) -> None:
    """As with `head`: nothing on standard error."""
    for words in (["library", "list", finished.library], ["library", "show", finished.library, "1"],
                  ["--help"]):  # fmt: skip
        process = subprocess.Popen(
            [sys.executable, "-m", "ilc_rt", *words],
            cwd=tmp_path, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        said = process.stderr.read()
        process.wait(60)
        assert said == "", words
        process.stderr.close()


def test_text_of_a_command_line_is_seen(ilc: Ilc) -> None:
    done = ilc("run", "\x1b[2J.toml")
    assert done.returncode == 2
    assert "\x1b" not in done.stderr
    assert re.search(r"\\x1b\[2J", done.stderr)
