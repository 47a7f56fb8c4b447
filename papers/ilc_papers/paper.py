"""A reproduced paper: how its figures are computed, what it printed, its pictures.

Every paper's own package makes one `Paper`; the command `ilc reproduce` and the gallery import it.
Claims and plots are made from the figures alone, so that pages can be regenerated from a JSON file
without computing anything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Results of a paper's systems: numbers, strings and lists by name, as stored in JSON.
Figures = dict[str, Any]

#: Called with the step being computed, before it starts.
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Claim:
    """One statement of a paper beside the result here.

    Parameters
    ----------
    what : str
        The quantity or the statement, as "contour error after 9 runs, tool".
    ours : float or None
        The figure computed here, in `unit`; None for a statement without a figure.
    printed : float or None
        The figure that the paper prints, in `unit`; None if it prints none.
    unit : str
        SI unit; empty for a ratio.
    source : str
        Place in the paper, such as "Table 1" or "section 3.4".
    holds : bool or None
        True if the statement holds here; None for a figure that is only compared.
    remark : str
        Explanation for the reader: why it differs, or that it does not follow from the print.
    """

    what: str
    ours: float | None
    printed: float | None = None
    unit: str = ""
    source: str = ""
    holds: bool | None = None
    remark: str = ""

    @property
    def ratio(self) -> float | None:
        """Ours over printed; None where either is missing or the printed one is zero."""
        if self.ours is None or not self.printed:
            return None
        return self.ours / self.printed


@dataclass(frozen=True)
class Picture:
    """One plot of a paper, drawn from its figures.

    Parameters
    ----------
    stem : str
        Name of the file without its ending.
    caption : str
        One sentence: its content, and the figure of the paper that it corresponds to.
    draw : callable
        `draw(figures, figure)` fills an empty matplotlib figure.
    """

    stem: str
    caption: str
    draw: Callable[[Figures, Figure], None]


@dataclass(frozen=True)
class Paper:
    """One paper that is reproduced.

    Parameters
    ----------
    name : str
        Its name on the command line.
    title : str
        Authors, title, year.
    about : str
        A few sentences for the page: the systems, and the inputs that the print leaves open.
    compute : callable
        `compute(reduced, tell)` runs the systems and returns the figures; `reduced` takes fewer
        seeds, runs or samples, for a test.
    claims : callable
        `claims(figures)` compares the printed figures with ours.
    pictures : sequence of Picture
        In the order of the page.
    parts : tuple of int
        Number of parts that `compute` tells, in full and reduced, for the time left; 0 if it is not
        known.
    """

    name: str
    title: str
    about: str
    compute: Callable[[bool, Tell], Figures]
    claims: Callable[[Figures], list[Claim]]
    pictures: Sequence[Picture]
    parts: tuple[int, int] = (0, 0)
