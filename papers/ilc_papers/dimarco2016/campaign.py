"""Campaigns of the five laws of chapter 4 over one sequence of temperatures.

The laws are the product's; the machine consists of its models, run after run. Read by the other
modules of this package only.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ilc_papers.dimarco2016.reference import DT_S
from ilc_rt import FlexibleIlc, PdIlc, RelevanceIlc, RelevanceWeights
from ilc_rt.signal import fir

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ilc_papers.dimarco2016.machine import System

#: Gains of the text, section 4.2.1.1; those of the listing differ.
GAIN = 1.284

#: Weights of error and error rate, as printed, and EPSILON of the listing.
N_E, N_ER, EPSILON = 10.0, 2.0, 1.0

#: Filter of the error rate, s/(0.1 s + 1).
RATE_FILTER_S = 0.1

#: Number of most relevant runs used by the trimmed law.
TOP = 30

#: Temperatures closer than this are one entry of the table of Flexible ILC; not printed.
TOLERANCE_K = 1.0

#: Without a Q filter PD-ILC diverges here; the thesis has none. 25 taps, ends held.
Q_FILTER = fir(np.array([-1.0, 4.0, 10.0, 4.0, -1.0]) / 16.0, repeats=6)


class Law(Protocol):
    """Interface of a law to a campaign."""

    def update(
        self, u: NDArray[np.float64], e: NDArray[np.float64], disturbance: float | None = None
    ) -> NDArray[np.float64]:
        """Return the input of the next run, whose disturbance is given."""
        ...


def core() -> PdIlc:
    """Return PD-ILC with one sample of lead (Eq. 3.2) and the Q filter."""
    return PdIlc(GAIN, GAIN, Q_FILTER)


def relevance(system: System, top: int | None) -> RelevanceIlc:
    """Return DPW-ILC (Eq. 4.5 to 4.13) around PD-ILC."""
    weights = RelevanceWeights(
        error=N_E,
        error_rate=N_ER,
        disturbance=system.disturbance_weight,
        epsilon=EPSILON,
        rate_filter_s=RATE_FILTER_S,
    )
    return RelevanceIlc(None, core(), weights, top, dt_s=DT_S)


#: Each law by its name in the figures; None is PD control alone.
LAWS: dict[str, Callable[[System], Law] | None] = {
    "pd": None,
    "pd_ilc": lambda _: core(),
    "flexible": lambda _: FlexibleIlc(None, core(), TOLERANCE_K),
    "dpw": lambda system: relevance(system, None),
    "dpw_top30": lambda system: relevance(system, TOP),
}


@dataclass
class Campaign:
    """Runs of one law.

    Parameters
    ----------
    rms : list of float
        RMS error of every run.
    error, input : dict of ndarray
        Error and ILC signal of the runs asked for.
    law : law or None
        As it is after the last run.
    """

    rms: list[float] = field(default_factory=list)
    error: dict[int, NDArray[np.float64]] = field(default_factory=dict)
    input: dict[int, NDArray[np.float64]] = field(default_factory=dict)
    law: Law | None = None


def run(
    system: System,
    reference: NDArray[np.float64],
    temperatures_k: NDArray[np.float64],
    names: Sequence[str] = tuple(LAWS),
    kept: Sequence[int] = (),
) -> dict[str, Campaign]:
    """Run the laws side by side through one sequence of temperatures.

    The ILC signal is added to the reference of the PD loop; each law is given the temperature of
    the next run before it begins (Eq. 4.11). Errors are relative to the part.

    Error and input are kept of the runs in `kept`.
    """
    campaigns = {name: Campaign() for name in names}
    inputs = {name: np.zeros_like(reference) for name in names}
    for name, campaign in campaigns.items():
        make = LAWS[name]
        campaign.law = make(system) if make else None
        if isinstance(campaign.law, (FlexibleIlc, RelevanceIlc)):
            campaign.law.expect(temperatures_k[0])
    for number, temperature_k in enumerate(temperatures_k):
        loop, scale = system.loop(temperature_k), system.expansion(temperature_k)
        # The input after the last run is not needed, and its temperature is unknown.
        coming_k = temperatures_k[number + 1] if number + 1 < len(temperatures_k) else None
        for name, campaign in campaigns.items():
            error = reference - loop.simulate(reference + inputs[name]) / scale
            campaign.rms.append(float(np.sqrt(np.mean(error**2))))
            if number in kept:
                campaign.error[number], campaign.input[number] = error, inputs[name]
            if campaign.law is not None and coming_k is not None:
                inputs[name] = campaign.law.update(inputs[name], error, coming_k)
    return campaigns
