"""Both examples of chapter 4, twenty sequences of temperatures each, five laws.

Read by the package's `__init__` only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.dimarco2016 import campaign
from ilc_papers.dimarco2016.machine import EXPANSION, MOTOR, System, temperatures_k
from ilc_papers.dimarco2016.reference import DT_S, INCH_M, appendix_a
from ilc_papers.paper import Claim, Figures, Tell
from ilc_rt import RelevanceIlc

if TYPE_CHECKING:
    from numpy.typing import NDArray

N_SEEDS, N_RUNS = 20, 500
REDUCED_SEEDS, REDUCED_RUNS = 3, 120

#: Decimation of the signals stored in the figures.
STEP = 5

TITLES = {"motor": "motor with R(T)", "expansion": "thermal expansion"}


def last(n_runs: int) -> int:
    """Return the number of last runs: 100 of 500, fewer of fewer."""
    return min(100, n_runs // 4)


def rms_of(values: list[float]) -> float:
    """Return the RMS over runs of their RMS errors."""
    return float(np.sqrt(np.mean(np.square(values))))


def learned(system: System, n_seeds: int, n_runs: int, tell: Tell) -> Figures:
    """Return the figures of one example; errors in the reference's unit, the inch."""
    reference = appendix_a().position_m[:, 0]
    n_last = last(n_runs)
    kept = (0, 1, 10, n_runs // 5, n_runs - 1)
    found: Figures = {
        "unit": "in",
        "n_last": n_last,
        "early_runs": [n_last // 3, n_last],
        "last100_rms": {name: [] for name in campaign.LAWS},
        "early_rms": {name: [] for name in campaign.LAWS},
    }
    for seed in range(n_seeds):
        tell(f"{TITLES[system.name]}, seed {seed + 1} of {n_seeds}, {n_runs} runs of five laws")
        kelvin = temperatures_k(seed, n_runs)
        campaigns = campaign.run(system, reference, kelvin, kept=kept if seed == 0 else ())
        for name, made in campaigns.items():
            found["last100_rms"][name].append(rms_of(made.rms[-n_last:]))
            found["early_rms"][name].append(rms_of(made.rms[n_last // 3 : n_last]))
        if seed == 0:
            found["rms_seed0"] = {name: made.rms for name, made in campaigns.items()}
            found["temperature_seed0_k"] = kelvin.tolist()
            found["final_relevance"] = final_relevance(campaigns["dpw"].law, kelvin)
            found["signals_seed0"] = signals(campaigns["dpw"], reference)
    return found


def final_relevance(law: campaign.Law | None, kelvin: NDArray[np.float64]) -> Figures:
    """Return the share of every past run in the last one (Eq. 4.13)."""
    if not isinstance(law, RelevanceIlc):
        message = "the relevance is DPW-ILC's"
        raise TypeError(message)
    runs, shares = law.relevant(float(kelvin[-1]))
    by_run = np.zeros(len(runs))
    by_run[runs] = shares
    nearest = np.argsort(np.abs(kelvin[:-1] - kelvin[-1]), kind="stable")
    return {
        "share": by_run.tolist(),
        "temperature_k": float(kelvin[-1]),
        "three_largest_runs": runs[:3].tolist(),
        "three_largest_apart_k": np.abs(kelvin[runs[:3]] - kelvin[-1]).tolist(),
        "rank_of_nearest": int(np.flatnonzero(runs == nearest[0])[0]),
        "share_of_top30": float(np.sum(shares[: campaign.TOP])),
    }


def signals(made: campaign.Campaign, reference: NDArray[np.float64]) -> Figures:
    """Return reference, errors and ILC signals of the kept runs."""
    every = slice(None, None, STEP)
    return {
        "t_s": (DT_S * np.arange(len(reference)))[every].tolist(),
        "reference": reference[every].tolist(),
        "run": list(made.error),
        "error": [error[every].tolist() for error in made.error.values()],
        "input": [signal[every].tolist() for signal in made.input.values()],
    }


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return `motor` and `expansion`."""
    n_seeds, n_runs = (REDUCED_SEEDS, REDUCED_RUNS) if reduced else (N_SEEDS, N_RUNS)
    return {system.name: learned(system, n_seeds, n_runs, tell) for system in (MOTOR, EXPANSION)}


def claims(figures: Figures) -> list[Claim]:
    """Return the statements of sections 4.2.1.2 and 4.2.2.2, as medians over the seeds."""
    made: list[Claim] = []
    for name, title in TITLES.items():
        found = figures[name]
        median = {law: float(np.median(rms)) for law, rms in found["last100_rms"].items()}
        gain = {
            law: float(np.median(np.divide(found["last100_rms"][law], found["early_rms"][law])))
            for law in ("pd_ilc", "dpw", "dpw_top30")
        }
        seeds = (
            f"median of {len(found['last100_rms']['pd'])} sequences, last {found['n_last']} runs"
        )
        source = "Fig. 4.6" if name == "motor" else "Fig. 4.9"
        made += [
            Claim(f"{title}: RMS error of {label}", median[law] * INCH_M, unit="m", source=source)
            for law, label in LABELS.items()
        ]
        made += [
            Claim(
                f"{title}: PD-ILC over PD",
                median["pd_ilc"] / median["pd"],
                source=source,
                holds=median["pd_ilc"] < median["pd"],
                remark=seeds,
            ),
            Claim(
                f"{title}: DPW-ILC over PD-ILC",
                median["dpw"] / median["pd_ilc"],
                source=source,
                holds=median["dpw"] < 0.5 * median["pd_ilc"],
                remark=f"{seeds}; temperatures that seldom come again make it larger",
            ),
            Claim(
                f"{title}: DPW-ILC, last runs over runs {found['early_runs'][0]} to "
                f"{found['early_runs'][1]}",
                gain["dpw"],
                source=source,
                holds=gain["dpw"] < min(1.0, gain["pd_ilc"]),
                remark=f"goes on improving where PD-ILC stays ({gain['pd_ilc']:.2f}); trimmed to "
                f"{campaign.TOP} runs {gain['dpw_top30']:.2f}. Untrimmed, what all distant runs "
                "weigh together sets a floor, a high one with the expansion's small N_d",
            ),
            Claim(
                f"{title}: trimmed to {campaign.TOP} runs, over all runs",
                median["dpw_top30"] / median["dpw"],
                source="section 5.1",
                holds=median["dpw_top30"] < 1.1 * median["dpw"],
                remark="the thesis's future work; the most relevant runs are found exactly",
            ),
        ]
    return made


LABELS = {
    "pd": "PD",
    "pd_ilc": "PD-ILC",
    "flexible": "Flexible ILC",
    "dpw": "DPW-ILC",
    "dpw_top30": f"DPW-ILC, {campaign.TOP} most relevant",
}
