"""Options of the controller, as `ilc-rt` itself describes them.

Names, defaults, ranges and help are defined in one place, in Rust; the classes and verbs of this
package take them from here and pass their values on as words of a command line.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from ilc_rt._native import described_options

if TYPE_CHECKING:
    from collections.abc import Mapping

Verb = Literal["run", "identify"]


@dataclass(frozen=True, slots=True)
class Option:
    """One option of the controller.

    Attributes
    ----------
    name : str
        Identifier, as a keyword of Python.
    flags : tuple of str
        Names on a command line, the long one first.
    help : str
        Help text, one sentence; the new name of a renamed option.
    kind : str
        ``flag``, ``inverse_flag``, ``integer``, ``number``, ``choice``,
        ``path``, ``text`` or ``renamed``.
    default : str or None
        Default, as on a command line.
    choices : tuple of str
        Allowed values of a choice.
    placeholder : str or None
        Placeholder of the value in a help text.
    """

    name: str
    flags: tuple[str, ...]
    help: str
    kind: str
    default: str | None
    choices: tuple[str, ...]
    placeholder: str | None

    def words(self, value: Any) -> list[str]:  # noqa: ANN401 (each kind has its own)
        """Return a value as words of a command line; none for the default.

        Examples
        --------
        >>> options("run")["learning"].words(False)
        ['--no-learning']
        >>> options("run")["iterations"].words(3)
        ['--iterations', '3']
        """
        if self.kind in {"flag", "inverse_flag"}:
            return [self.flags[0]] if bool(value) == (self.kind == "flag") else []
        if value is None:
            return []
        default = self.default
        if self.kind == "number":
            # `0` and `0.0` are one number.
            text, default = repr(float(value)), default and repr(float(default))
        else:
            text = os.fspath(value) if self.kind == "path" else str(value)
        if text == default:
            return []
        # Separately, a value that begins with a hyphen would be taken for an option.
        flag = self.flags[0]
        return [f"{flag}={text}"] if text.startswith("-") else [flag, text]


@cache
def options(verb: Verb) -> dict[str, Option]:
    """Return the options of a verb of ``ilc-rt`` by their names.

    Examples
    --------
    >>> options("run")["iterations"].default
    '10'
    """
    described = json.loads(described_options(verb))
    return {
        one["name"]: Option(
            **{**one, "flags": tuple(one["flags"]), "choices": tuple(one["choices"])}
        )
        for one in described
    }


def arguments(verb: Verb, values: Mapping[str, Any]) -> list[str]:
    """Return values of options as words of the command line of ``ilc-rt``.

    Examples
    --------
    >>> arguments("run", {"iterations": 3, "resume": True, "bus": None})
    ['--iterations', '3', '--resume']
    """
    known = options(verb)
    return [word for name, value in values.items() for word in known[name].words(value)]


DEFAULT_LIBRARY = str(options("run")["library"].default)
