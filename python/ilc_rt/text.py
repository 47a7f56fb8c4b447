"""Sanitised display of untrusted text in a terminal, a page or a figure."""

from __future__ import annotations

import re
import unicodedata

# Control and format characters (escape sequences, bell, null, bidirectional overrides), surrogates,
# and line separators: characters that act instead of being displayed.
HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
LENGTH_MAX = 400
NAME_MAX = 64


def printable(text: object, length_max: int = LENGTH_MAX) -> str:
    r"""Return a text as one line of limited length in which every character is visible.

    A longer text ends in an ellipsis.

    Examples
    --------
    >>> printable("x\x1b[2J\n")
    'x\\x1b[2J\\n'
    """
    whole = str(text)
    # The part of a huge text that is cut off need not be examined.
    part = whole[: length_max + 1]
    seen = "".join(map(_seen, part))
    if len(whole) > length_max:
        return seen[: length_max - 1] + "…"
    return seen


def printable_lines(text: str) -> str:
    """Return a text with its line breaks, in which all other hidden characters are visible."""
    return "\n".join("".join(map(_seen, line)) for line in text.split("\n"))


def runs_counted(number: int) -> str:
    """Return a number of runs in words.

    Examples
    --------
    >>> runs_counted(1), runs_counted(0)
    ('1 run', '0 runs')
    """
    return f"{number} run{'' if number == 1 else 's'}"


def label(name: object) -> str:
    r"""Return a name for a figure, in which a dollar sign does not start a formula.

    Examples
    --------
    >>> label("a$b$")
    'a\\$b\\$'
    """
    return printable(name, NAME_MAX).replace("$", r"\$")


def file_name(name: object) -> str:
    """Return a name as part of a file name: letters, digits, ``-`` and ``_``.

    Examples
    --------
    >>> file_name("../y axis"), file_name("y")
    ('___y_axis', 'y')
    """
    return re.sub(r"[^A-Za-z0-9_-]", "_", str(name))[:NAME_MAX] or "_"


def _seen(character: str) -> str:
    if unicodedata.category(character) not in HIDDEN:
        return character
    # As Python's escapes, `\x1b`; a character without one, as its number.
    written = ascii(character)[1:-1]
    return written if written != character else f"\\x{ord(character):02x}"
