"""The command reference derives from the help of the three programs; `make derived` writes it."""

from __future__ import annotations

import inspect
import re
from enum import Enum
from pathlib import Path
from typing import Any, get_args

from derived_fixture import hold_derived_file
from documentation_fixture import help_of, verbs_of
from typer.main import get_command

from ilc_rt.cli import application


def choices(annotation: Any) -> list[str]:
    """Return the values of a choice, from the annotation of its parameter."""
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return [str(one.value) for one in annotation]
    return [value for inner in get_args(annotation) for value in choices(inner)]


def line_of(parameter: Any, annotation: Any) -> str:
    """Return the line of an option or argument in its table."""
    if parameter.param_type_name == "argument":
        name = f"`{parameter.metavar or parameter.name.upper()}`"
    else:
        flags = [*parameter.opts, *parameter.secondary_opts]
        value = "" if parameter.is_flag else " " + (parameter.metavar or "VALUE")
        name = ", ".join(f"`{flag}{value}`" for flag in flags)
    said = [" ".join((parameter.help or "").split())]
    if found := choices(annotation):
        said.append(f"One of {', '.join(f'`{one}`' for one in found)}.")
    default = parameter.default
    if isinstance(default, (int, float, str, Path)) and not isinstance(default, bool):
        said.append(f"Default: `{getattr(default, 'value', default)}`.")
    return f"| {name} | {' '.join(said).replace('|', chr(92) + '|')} |"


def section_of_ilc(verb: list[str]) -> str:
    """Return the section of a verb of `ilc`, from its declaration."""
    command: Any = get_command(application())
    for word in verb:
        command = command.commands[word]
    called = command.callback
    annotations = inspect.signature(called, eval_str=True).parameters if called else {}
    lines = [
        line_of(one, annotations[one.name].annotation if one.name in annotations else None)
        for one in command.params
        if not one.hidden and one.name not in {"install_completion", "show_completion"}
    ]
    text, *examples = re.split(r"Examples?:", command.help or "")
    parts = [f"### {' '.join(['ilc', *verb])}", " ".join(text.split())]
    if examples:
        shown = [line.strip() for line in "".join(examples).splitlines() if line.strip()]
        parts.append("\n".join(["```sh", *shown, "```"]))
    if lines:
        parts.append("\n".join(["| option | meaning |", "|---|---|", *lines]))
    return "\n\n".join(part for part in parts if part)


def section(name: str, verb: list[str]) -> str:
    """Return the section of a verb."""
    if name == "ilc":
        return section_of_ilc(verb)
    text = "\n".join(line.rstrip() for line in help_of(name, *verb).splitlines())
    return f"### {' '.join([name, *verb])}\n\n```text\n{text.strip()}\n```"


def test_the_command_reference() -> None:
    parts = ["# Commands", "Derived from the help of the programs by `make derived`."]
    for name, what in (
        ("ilc", "The user interface."),
        ("ilc-rt", "The controller."),
        ("ilc-sim", "The simulated drives."),
    ):
        parts += [f"## {name}: {what.lower().rstrip('.')}"]
        parts += [section(name, verb) for verb in verbs_of(name)]
    hold_derived_file("docs/commands.md", "\n\n".join(parts) + "\n")
