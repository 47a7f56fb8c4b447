"""Texts that came from elsewhere, as they may be shown in a terminal, a page or a picture."""

from __future__ import annotations

import re
import unicodedata

# Control and format characters (escape sequences, bell, null, overrides of the writing direction),
# halves of characters, and separators of lines: what does something other than being read.
HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
LENGTH_MAX = 400
NAME_MAX = 64


def printable(text: object, length_max: int = LENGTH_MAX) -> str:
    r"""Return a text in one line in which every character is seen, and not too long.

    Parameters
    ----------
    text : object
        What is to be shown.
    length_max : int
        Characters at most; what is longer ends in an ellipsis.

    Examples
    --------
    >>> printable("x\x1b[2J\n")
    'x\\x1b[2J\\n'
    """
    whole = str(text)
    # Nothing of a text of megabytes that is cut off need be looked at.
    part = whole[: length_max + 1]
    seen = "".join(map(_seen, part))
    if len(whole) > length_max:
        return seen[: length_max - 1] + "…"
    return seen


def printable_lines(text: str) -> str:
    """Return a text whose line breaks stay and whose other hidden characters are seen."""
    return "\n".join("".join(map(_seen, line)) for line in text.split("\n"))


def label(name: object) -> str:
    r"""Return a name for a picture, where a dollar is a dollar and begins no formula.

    Examples
    --------
    >>> label("a$b$")
    'a\\$b\\$'
    """
    return printable(name, NAME_MAX).replace("$", r"\$")


def file_name(name: object) -> str:
    """Return a name as part of a file's name: letters, digits, ``-`` and ``_``.

    Examples
    --------
    >>> file_name("../y axis"), file_name("y")
    ('___y_axis', 'y')
    """
    return re.sub(r"[^A-Za-z0-9_-]", "_", str(name))[:NAME_MAX] or "_"


def _seen(character: str) -> str:
    if unicodedata.category(character) not in HIDDEN:
        return character
    # As Python writes it, `\x1b`; what it would print as it is, as a number.
    written = ascii(character)[1:-1]
    return written if written != character else f"\\x{ord(character):02x}"
