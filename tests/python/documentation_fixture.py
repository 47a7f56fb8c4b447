"""Collects the runnable parts of the documents: command lines, and blocks of Python.

A fenced block of ``sh`` or ``python`` is meant to run. One that cannot run gives the reason on the
line before it, in a comment that GitHub does not show::

    <!-- not run: the reason -->
"""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from processes_fixture import program
from typer.main import get_command

from ilc_rt.cli import application

if TYPE_CHECKING:
    import click

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("docs/theory/*.md")])

#: Its lines need each other: test_first_machine follows it as a whole.
PAGE_OF_ITS_OWN = ROOT / "docs" / "first-machine.md"

#: Languages of a fence; all but the first two are for reading only.
LANGUAGES = ("sh", "python", "text", "toml", "json")
NOT_RUN = re.compile(r"<!-- not run: (.+) -->$")
PROGRAMS = ("ilc", "ilc-rt", "ilc-sim", "make", "python", "pip", "cargo")


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes
    ----------
    document : pathlib.Path
        Where it stands.
    line : int
        Number of its first line.
    language : str
        What the fence says.
    text : str
        What stands between the fences.
    excuse : str
        Why it is not run; empty if it is.
    """

    document: Path
    line: int
    language: str
    text: str
    excuse: str


@dataclass(frozen=True)
class Command:
    """A command line in the documents or a help text.

    Attributes
    ----------
    where : str
        Document and line, or the help that has it.
    text : str
        The line, without the remark after it.
    """

    where: str
    text: str


def blocks(document: Path) -> list[Block]:
    """Return the fenced blocks of a document."""
    found = []
    lines = document.read_text(encoding="utf-8").splitlines()
    start, language, excuse = None, "", ""
    for number, line in enumerate(lines):
        fence = re.match(r"\s*```(\S*)", line)
        if fence is None:
            continue
        if start is None:
            start, language = number + 1, fence.group(1)
            said = NOT_RUN.match(lines[number - 1].strip()) if number else None
            excuse = said.group(1) if said else ""
        else:
            text = "\n".join(lines[start:number])
            found.append(Block(document, start + 1, language, text, excuse))
            start = None
    return found


def outside_of_blocks(document: Path) -> list[tuple[int, str]]:
    """Return the numbered lines of a document outside fenced blocks."""
    kept = []
    inside = False
    for number, line in enumerate(document.read_text(encoding="utf-8").splitlines(), 1):
        if re.match(r"\s*```", line):
            inside = not inside
        elif not inside:
            kept.append((number, line))
    return kept


def commands_of_blocks() -> list[Command]:
    """Return every line of every block of ``sh``."""
    found = []
    for document in DOCUMENTS:
        for block in blocks(document):
            if block.language != "sh" or block.excuse or document == PAGE_OF_ITS_OWN:
                continue
            for number, line in enumerate(block.text.splitlines(), block.line):
                text = re.sub(r"\s+#.*", "", line).strip()
                if text:
                    found.append(Command(f"{document.relative_to(ROOT)}:{number}", text))
    return found


def launcher(name: str) -> list[str]:
    """Return the command that starts one of the three programs."""
    if name == "ilc":
        return [sys.executable, "-m", "ilc_rt.cli"]
    return [str(program(name))]


@cache
def program_tree() -> click.Command:
    """Return `ilc` with all its verbs."""
    return get_command(application())


@cache
def help_of(name: str, *verb: str) -> str:
    """Return the help text of a program or a verb; for `ilc`, also its parts."""
    if name != "ilc":
        argv = [*launcher(name), *verb, "--help"]
        return subprocess.run(argv, capture_output=True, text=True, check=True, timeout=60).stdout
    command = program_tree()
    for word in verb:
        command = getattr(command, "commands")[word]  # noqa: B009
    options = [word for parameter in command.params for word in parameter.opts]
    options += [word for parameter in command.params for word in parameter.secondary_opts]
    return "\n".join([command.help or "", *options])


def verbs_of(name: str) -> list[list[str]]:
    """Return every verb of a program, including nested ones."""
    if name == "ilc":
        found: list[list[str]] = []
        open_ones = [([], program_tree())]
        while open_ones:
            verb, command = open_ones.pop(0)
            found.append(verb)
            inner = getattr(command, "commands", {})
            open_ones += [([*verb, word], one) for word, one in inner.items()]
        return found
    open_verbs: list[list[str]] = [[]]
    listed_verbs = []
    while open_verbs:
        verb = open_verbs.pop(0)
        listed_verbs.append(verb)
        listed = re.search(r"^Commands:\n(.*?)\n\n", help_of(name, *verb), re.DOTALL | re.MULTILINE)
        words = re.findall(r"^  ([a-z][a-z-]*) ", listed.group(1), re.MULTILINE) if listed else []
        # Those of a verb follow it.
        open_verbs = [[*verb, word] for word in words if word != "help"] + open_verbs
    assert len(listed_verbs) > 1 or name == "ilc-sim", f"{name} --help lists no verb"
    return listed_verbs


def commands_of_help() -> list[Command]:
    """Return every example in a program's help."""
    found = []
    for name in ("ilc", "ilc-rt", "ilc-sim"):
        example = re.compile(rf"^\s*(?:Examples?:)?\s*({name} .*?)\s*$", re.MULTILINE)
        for verb in verbs_of(name):
            where = " ".join([name, *verb, "--help"])
            found += [Command(where, line) for line in example.findall(help_of(name, *verb))]
    return found
