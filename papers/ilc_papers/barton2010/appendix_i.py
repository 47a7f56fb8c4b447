"""Appendix I: the small worked example whose converged signals are printed.

The paper's package makes its section `appendix_i` with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.barton2010 import printed
from ilc_papers.barton2010.agents import AXES, FORMATION, agents, together
from ilc_papers.barton2010.runs import runs
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import NormOptimalIlc, weights

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Samples 0 to 4; the learned input has four of them, as the error has from sample 1 on.
N_SAMPLES = 5
ITERATIONS = 5
S, R = 1e-4, 1e-6


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return converged inputs u(0..3), errors e(1..4) and formation errors, a row per channel.

    `u`, `e`: x1, y1, x2, y2, x3, y3; `formation`: d1, d2, d3, h1, h2, h3. `difference`: largest
    difference from the print; `in_last_digit`: in units of the last printed digit, half of which
    is what rounding explains.

    References
    ----------
    Barton 2010, appendix I, case 1 (individual tracking), tables I.1 to I.3, figures I.3 to I.8.
    """
    tell("appendix I")
    models = agents()
    plant = together(models)
    x, y = [0.0, 0.5, 0.5, 1.0, 1.0], [0.0, 0.5, 0.0, 0.5, 0.0]
    reference = np.tile(np.column_stack([x, y]), 3)
    law = NormOptimalIlc.formation(models, N_SAMPLES, s=S, r=R)
    history = list(runs(law, plant.simulate, reference, ITERATIONS))
    u, e = history[-1]
    formation = weights.formation_errors(e, 3)
    errors = np.array([run for _, run in history])
    shapes = np.array([weights.formation_errors(run, 3) for run in errors])
    return {
        "axes": list(AXES),
        "formation_names": list(FORMATION),
        "reference": reference[:, :2].T.tolist(),
        "u": u[:-1].T.tolist(),
        "e": e[1:].T.tolist(),
        "formation": formation[1:].T.tolist(),
        "rms": np.sqrt(np.mean(errors[:, 1:] ** 2, axis=1)).T.tolist(),
        "formation_rms": np.sqrt(np.mean(shapes[:, 1:] ** 2, axis=1)).T.tolist(),
        "printed": {
            "u": _against(u, printed.INPUT),
            "e": _against(e, printed.ERROR),
            "formation": _against_formation(formation),
        },
    }


def _against(found: np.ndarray, tables: dict[str, list[float]]) -> Figures:
    difference = np.abs(found - np.column_stack([tables[name] for name in AXES]))
    largest = float(difference.max())
    return {"difference": largest, "in_last_digit": largest * 10.0**printed.DECIMALS}


def _against_formation(found: np.ndarray) -> Figures:
    rows = {name: np.array(values) for name, (_, values) in printed.FORMATION.items()}
    difference = np.abs(found - np.column_stack([rows[name] for name in FORMATION]))
    digits = difference * np.array([10.0 ** printed.FORMATION[name][0] for name in FORMATION])
    name, sample = printed.MISPRINT
    place = (sample, FORMATION.index(name))
    misprint = float(digits[place])
    digits[place] = 0.0
    return {
        "difference": float(difference.max()),
        "in_last_digit": float(digits.max()),
        "misprint_in_last_digit": misprint,
        "misprint_found": float(found[place]),
    }


def claims(figures: Figures) -> list[Claim]:
    """Compare tables I.1 to I.3 with the print."""
    against, names = figures["printed"], figures["axes"]
    shown = [
        Claim(
            f"input {name} at sample 0", figures["u"][names.index(name)][0], printed.INPUT[name][0],
            source="table I.1",
        )
        for name in names
    ]  # fmt: skip
    return [
        *shown,
        *(
            Claim(
                f"{what}: largest difference from print, in units of its last digit",
                against[key]["in_last_digit"], source=f"table I.{number}",
                holds=against[key]["in_last_digit"] <= 0.5 + 1e-6,
                remark=remark,
            )
            for number, what, key, remark in (
                (1, "inputs", "u", "all 24 figures to the printed digits"),
                (2, "errors", "e", "all 24 figures to the printed digits"),
                (3, "formation errors", "formation",
                 "E_h2 read in thousandths, the last row as E_h3; without E_d1 at sample 2"),
            )
        ),
        Claim(
            "E_d1 at sample 2", against["formation"]["misprint_found"],
            printed.FORMATION["d1"][1][2], "m", "table I.3", holds=False,
            remark="one too many in the last printed digit",
        ),
        Claim(
            "learning lowers every axis' error: largest share left after 5 runs",
            max(row[-1] / row[0] for row in figures["rms"]), source="figures I.3 to I.5",
            holds=all(row[-1] < row[0] for row in figures["rms"]),
        ),
    ]  # fmt: skip


def _draw(figures: Figures, figure: Figure) -> None:
    section = figures["appendix_i"]
    left, right = figure.subplots(1, 2)
    for name, row in zip(section["axes"], section["rms"], strict=True):
        left.semilogy(range(len(row)), np.array(row) / row[0], "o-", markersize=3, label=name)
    for name, row in zip(section["formation_names"], section["formation_rms"], strict=True):
        right.semilogy(range(1, len(row)), row[1:], "o-", markersize=3, label=name)
    left.set_ylabel("RMS error over that of run 0")
    right.set_ylabel("RMS formation error in m")
    for axes in (left, right):
        axes.set_xlabel("run")
        axes.legend(ncols=2)


PICTURES = [
    Picture(
        "appendix_i",
        "Errors of the six axes and of the formation, case 1 (figures I.3 to I.8).",
        _draw,
    )
]
