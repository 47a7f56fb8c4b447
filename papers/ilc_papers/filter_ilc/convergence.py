"""Eq. 9 and Fig. 17, 18, 27: critical frequency of learning, and the pass-band of a filter.

A user sees this before the first run. Only the paper's package imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.filter_ilc.bench import DT_S, GAIN, KP, loop, motion, plant
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import ErrorFeedforwardIlc, StateSpace, analyze, signal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ORDER = 4
#: The paper's lead, and the one that compensates the lag of the loop at 50 Hz.
LEADS = (1, 5)
CUTOFFS_HZ = (10.0, 11.0, 12.0, 15.0, 20.0)
_MOST_LEADS = 10


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return critical frequencies, contraction over frequency, and the cut-offs that converge.

    ``|1 - phi z^lead G / (1 + C G)| < 1`` where learning converges without a filter.

    References
    ----------
    [filter-ilc], Eq. (9).
    """
    model, n_samples = loop(), motion().n_samples
    tell("critical frequency")
    by_lead = {}
    for lead in LEADS:
        told = analyze(ErrorFeedforwardIlc(GAIN, lead_samples=lead), model, n_samples)
        by_lead[lead] = {
            "critical_frequency_hz": told.critical_frequency_hz,
            "frequency_hz": told.frequency_hz.tolist(),
            "contraction": told.contraction.tolist(),
        }
    figures: Figures = {
        **by_lead[LEADS[0]],
        f"lead_{LEADS[1]}": by_lead[LEADS[1]],
        "told": [_with_filter(model, n_samples, lead, 50.0, tell) for lead in LEADS],
        "printed": _printed(),
    }
    if not reduced:
        figures["critical_frequency_by_lead_hz"] = [
            analyze(
                ErrorFeedforwardIlc(GAIN, lead_samples=lead), model, n_samples
            ).critical_frequency_hz
            for lead in range(1, _MOST_LEADS + 1)
        ]
        figures["told"] += [
            _with_filter(model, n_samples, lead, cutoff_hz, tell)
            for lead in LEADS
            for cutoff_hz in CUTOFFS_HZ
        ]
    return {"convergence": figures}


def _with_filter(
    model: StateSpace, n_samples: int, lead: int, cutoff_hz: float, tell: Tell
) -> Figures:
    tell(f"analysis with {cutoff_hz:g} Hz, lead {lead}")
    law = ErrorFeedforwardIlc(GAIN, signal.butterworth(ORDER, cutoff_hz, DT_S), lead)
    told = analyze(law, model, n_samples)
    return {
        "lead": lead,
        "cutoff_hz": cutoff_hz,
        "converges": told.converges,
        "spectral_radius": told.spectral_radius,
        "why": told.why,
    }


def _printed() -> Figures:
    """Return the behaviour of the paper's printed model and filter, unchanged.

    References
    ----------
    [filter-ilc], Eq. (3), and the coefficients below Eq. (10).
    """
    a = np.array([[2.85, -1.35, 0.8502], [2.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    b = np.array([[0.25], [0.0], [0.0]])
    gain = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[KP]], DT_S)
    model = StateSpace(a, b, np.array([[0.19, 0.0, -0.01899]]), np.zeros((1, 1)), DT_S)
    numerator, denominator = [0.0, 0.00018896, 0.00017992], [1.0, -2.8531, 2.7167, -0.8633]
    return {
        "loop_radius": float(abs(model.feedback(gain).poles()).max()),
        "filter_gain": float(np.sum(numerator) / np.sum(denominator)),
        "loop_radius_here": float(abs(plant().feedback(gain).poles()).max()),
    }


def claims(figures: Figures) -> list[Claim]:
    """State the results of the analysis for the paper's filters, and for its print."""
    told = figures["convergence"]
    critical_hz = told["critical_frequency_hz"]
    lead_5_hz = told[f"lead_{LEADS[1]}"]["critical_frequency_hz"]
    held = [
        Claim("critical frequency, lead of one sample", critical_hz, None, "Hz", "eq. 9",
              holds=critical_hz > 10.0,
              remark="The paper's 10 Hz lies below it, 50 Hz does not. Of 50 Hz `analyze` says "
              f"before the first run: \"{told['told'][0]['why']}\"."),
        Claim("critical frequency, lead of five samples", lead_5_hz, None, "Hz", "eq. 9",
              holds=lead_5_hz > 50.0,
              remark="The lead makes up for the lag of loop and plant, so that 50 Hz is possible."),
        Claim("the loop of eq. 3 as printed is stable", told["printed"]["loop_radius"], None, "",
              "eq. 3", holds=told["printed"]["loop_radius"] < 1.0,
              remark="The figure is the spectral radius. C must read [0.0190, 0, -0.01899]; the "
              f"radius is then {told['printed']['loop_radius_here']:.3f}."),
        Claim("the printed filter passes what is constant", told["printed"]["filter_gain"], None,
              "", "section 4", holds=abs(told["printed"]["filter_gain"] - 1.0) < 0.01,
              remark="The figure is its gain at 0 Hz: the coefficients, of a third-order filter, "
              "are rounded. Here a fourth-order one is designed."),
    ]  # fmt: skip
    held += [
        Claim(f"a filter of {each['cutoff_hz']:g} Hz converges, lead {each['lead']}",
              each["spectral_radius"], None, "", "eq. 9", holds=each["converges"],
              remark="The figure is the spectral radius of one iteration over the whole run. "
              "10 and 50 Hz are the paper's.")
        for each in sorted(told["told"], key=lambda each: (each["lead"], each["cutoff_hz"]))
        if each["cutoff_hz"] in {10.0, 50.0}
    ]  # fmt: skip
    return held


def _draw(figures: Figures, figure: Figure) -> None:
    told = figures["convergence"]
    axes = figure.subplots()
    cases = ((told, "#D55E00", LEADS[0]), (told[f"lead_{LEADS[1]}"], "#0072B2", LEADS[1]))
    for case, colour, lead in cases:
        critical_hz = case["critical_frequency_hz"]
        axes.semilogx(case["frequency_hz"][1:], case["contraction"][1:], color=colour,
                      label=f"lead {lead}: converges below {critical_hz:.1f} Hz")  # fmt: skip
        axes.axvline(critical_hz, color=colour, linewidth=1.0, linestyle="--")
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set_xlim(0.5, 0.5 / DT_S)
    axes.set_xlabel("frequency in Hz")
    axes.set_ylabel("contraction in one run")
    axes.legend(loc="upper left")


PICTURES = [
    Picture("convergence", "By what each run multiplies the error at each frequency, without a "
            "filter: above 1 it grows (eq. 9).", _draw),
]  # fmt: skip
