"""A reproduced paper: how its figures are computed, what it printed, its pictures.

Every paper's own package makes one `Paper`; the command `ilc reproduce` and the gallery import it.
Claims and pictures are made from the figures alone, so that pages can be made again from a JSON
file without computing anything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What a paper's systems gave: numbers, strings and lists under names, as they go to JSON.
Figures = dict[str, Any]

#: Told what is being computed, before it is.
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
        Where the paper says it, as "Table 1" or "section 3.4".
    holds : bool or None
        Whether the statement holds here; None for a figure that is only compared.
    remark : str
        What a reader has to know: why it differs, or that it does not follow from the print.
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
    """One picture of a paper, drawn from its figures.

    Parameters
    ----------
    stem : str
        Name of the file without its ending.
    caption : str
        One sentence: what is seen, and which figure of the paper it stands for.
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
        `claims(figures)` sets the printed figures beside ours.
    pictures : sequence of Picture
        In the order of the page.
    """

    name: str
    title: str
    about: str
    compute: Callable[[bool, Tell], Figures]
    claims: Callable[[Figures], list[Claim]]
    pictures: Sequence[Picture]
