"""Reproduced papers, by their names on the command line.

A paper's package is imported only on request, so that one does not wait for another's. The command,
the workers and the tests import it.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from ilc_papers.paper import Paper

ALL = "all"
_ORDER = ("haas2016", "dimarco2016", "barton2010", "filter-ilc")


def _package(name: str) -> str:
    return f"ilc_papers.{name.replace('-', '_')}"


#: Names of the installed papers, in the order of the gallery.
NAMES = tuple(name for name in _ORDER if find_spec(_package(name)) is not None)


def load(name: str) -> Paper:
    """Return a paper by its name.

    Examples
    --------
    >>> load("haas2016").name
    'haas2016'
    """
    if name not in NAMES:
        message = f"paper = {name}: allowed {', '.join((*NAMES, ALL))}"
        raise BadInputError(message)
    paper: Paper = import_module(_package(name)).PAPER
    return paper


def chosen(name: str) -> tuple[str, ...]:
    """Return the names that `name` stands for: all of them, or itself."""
    if name == ALL:
        return NAMES
    load(name)
    return (name,)
