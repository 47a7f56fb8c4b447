"""Section 6.4: three agents that track, keep a formation, or both; one of them is disturbed.

The paper's package makes its section `formation` with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_papers.barton2010.agents import AXES, DT_S, FORMATION, agents, together
from ilc_papers.barton2010.runs import runs
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import NormOptimalIlc, analyze, trajectory, weights
from ilc_rt.pictures.themes import WIDTH_IN

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Weights of input and change of input, section 6.4.2.
S, R = 0.005, 0.001
#: Shares of tracking (X1), of an agent's own error (B1) and of the centre's (B2), section 6.4.2.
#: The leader is the neighbour's and leader's reference of section 6.3.1.
CASES: dict[str, dict[str, Any]] = {
    "individual": {"tracking": 1.0, "own": 1.0, "centre": 0.0},
    "formation": {"tracking": 0.0},
    "combined": {"tracking": 0.5, "own": 0.0, "centre": 1.0},
}
#: True gains over the model's, one per axis: the print has an uncertainty and not its size.
TRUE_GAINS = np.array([1.08, 1.05, 0.95, 0.93, 1.02, 1.04])
#: Disturbance of agent 1, new in each run; the print has no size.
DISTURBANCE_STD_M = 0.01
ITERATIONS, CONVERGED = 20, 10


def raster_m() -> Array:
    """Return the raster of every agent, shape (n_samples, 2); the print shows its shape alone."""
    path = trajectory.raster(
        width_m=1.0, pitch_m=0.25, rows=4, feed_m_s=0.1, dt_s=DT_S,
        velocity_max_m_s=0.2, acceleration_max_m_s2=0.05, jerk_max_m_s3=0.05,
    )  # fmt: skip
    return path.position_m


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return RMS errors of the six axes and of the formation per run, for each objective.

    `tracking_rms_m`: x1, y1, x2, y2, x3, y3; `formation_rms_m`: d1, d2, d3, h1, h2, h3; a list of
    runs each. `disturbed` has the same with a disturbance of agent 1 that does not repeat.

    References
    ----------
    Barton 2010, eq. (6.1) to (6.17), figures 6.3 to 6.7.
    """
    tell("formation: individual, formation, combined")
    models = agents()
    plant = together(models)
    reference = np.tile(raster_m(), 3)
    n_samples = len(reference)
    drawn = np.random.default_rng(3).normal(
        scale=DISTURBANCE_STD_M, size=(ITERATIONS + 1, n_samples, 2)
    )
    disturbance = np.concatenate([drawn, np.zeros((ITERATIONS + 1, n_samples, 4))], axis=2)

    def true(u: Array) -> Array:
        y: Array = plant.simulate(u) * TRUE_GAINS
        return y

    figures: Figures = {
        "axes": list(AXES),
        "formation_names": list(FORMATION),
        "reference_m": raster_m().tolist(),
        "rank_of_f": int(np.linalg.matrix_rank(weights.formation_errors(np.eye(6), 3))),
        "disturbed": {},
    }
    laws = {
        name: NormOptimalIlc.formation(models, n_samples, s=S, r=R, **shares)
        for name, shares in CASES.items()
    }
    laws["leader"] = NormOptimalIlc.formation(
        models, n_samples, s=S, r=R, tracking=0.5, leaders=[0]
    )
    for name, law in laws.items():
        figures[name] = _run(law, true, reference, lambda _: 0.0)
        figures["disturbed"][name] = _run(law, true, reference, disturbance.__getitem__)
    tell("formation: analysis")
    short = 20
    figures["monotonic_factor"] = {
        name: analyze(
            NormOptimalIlc.formation(models, short, s=S, r=R, **shares), plant, short
        ).monotonic_factor
        for name, shares in CASES.items()
    }
    return figures


def _run(
    law: NormOptimalIlc,
    plant: Callable[[Array], Array],
    reference: Array,
    disturbance: Callable[[int], Array | float],
) -> Figures:
    history = runs(law, plant, reference, ITERATIONS, disturbance)
    inputs, errors = zip(*history, strict=True)
    shapes = [weights.formation_errors(e, 3) for e in errors]
    return {
        "tracking_rms_m": np.sqrt(np.mean(np.square(errors), axis=1)).T.tolist(),
        "formation_rms_m": np.sqrt(np.mean(np.square(shapes), axis=1)).T.tolist(),
        "largest_input": float(np.abs(inputs[-1]).max()),
    }


def converged(rows: list[list[float]]) -> list[float]:
    """Return the RMS over the last runs of each row."""
    return [float(np.sqrt(np.mean(np.square(row[-CONVERGED:])))) for row in rows]


def claims(figures: Figures) -> list[Claim]:
    """Compare section 6.4 with the print."""
    x1 = {name: converged(figures[name]["tracking_rms_m"])[0] for name in CASES}
    start = figures["individual"]["tracking_rms_m"][0][0]
    shape = {name: max(converged(figures[name]["formation_rms_m"])) for name in CASES}
    disturbed = {
        name: dict(
            zip(
                figures["formation_names"],
                converged(figures["disturbed"][name]["formation_rms_m"]),
                strict=True,
            )
        )
        for name in CASES
    }
    factors = list(figures["monotonic_factor"].values())
    alone = disturbed["formation"]
    return [
        Claim("rank of F", figures["rank_of_f"], source="eq. (4.4)", holds=None,
              remark="six rows, of which in each axis one is the sum of the other two: not the "
              "bijective map of which the text speaks"),
        Claim(
            "RMS error of x1 in the end over the start, individual tracking",
            x1["individual"] / start, source="figure 6.5", holds=x1["individual"] < 0.05 * start,
        ),
        Claim(
            "the same, formation alone", x1["formation"] / start, source="figure 6.5",
            holds=x1["formation"] > 0.9 * start,
            remark="very poor tracking, as the thesis says: with identical references no input at "
            "all keeps the formation",
        ),
        Claim(
            "largest input, formation alone, undisturbed", figures["formation"]["largest_input"],
            0.0, source="figure 6.6", holds=figures["formation"]["largest_input"] < 1e-9,
            remark="formation errors tend to zero, by the trivial solution",
        ),
        Claim(
            "RMS error of x1 in the end over the start, combined", x1["combined"] / start,
            source="figure 6.5", holds=x1["individual"] < x1["combined"] < 0.05 * start,
        ),
        Claim(
            "largest RMS formation error, combined over individual",
            shape["combined"] / shape["individual"], source="figure 6.6",
            holds=shape["combined"] < shape["individual"],
            remark="without disturbance, both objectives at once",
        ),
        Claim(
            "agent 1 disturbed, formation alone: E_h2 over E_h1", alone["h2"] / alone["h1"],
            source="figure 6.7", holds=alone["h2"] < 0.2 * min(alone["h1"], alone["h3"]),
            remark="the error of the two agents that are not disturbed stays small",
        ),
        Claim(
            "agent 1 disturbed: E_d2, formation alone over individual",
            alone["d2"] / disturbed["individual"]["d2"], source="figure 6.6",
            remark="no ranking follows: under a disturbance that does not repeat, learning the "
            "formation hands it on to the other agents; the size of the disturbance is not printed",
        ),
        Claim(
            "largest monotonic factor of the three", max(factors), source="eq. (6.12)",
            holds=max(factors) < 1.0,
        ),
    ]  # fmt: skip


def _draw(figures: Figures, figure: Figure) -> None:
    section = figures["formation"]
    figure.set_size_inches(WIDTH_IN, 4.8)
    (left, right), (lower, disturbed) = figure.subplots(2, 2)
    for name, style in (("individual", "-"), ("formation", ":"), ("combined", "--")):
        left.semilogy(section[name]["tracking_rms_m"][0], style, label=name)
        values = np.array(section[name]["formation_rms_m"][1])
        # Rounding alone is no error.
        if np.any(values > 1e-12):
            right.semilogy(np.where(values > 1e-12, values, np.nan), style, label=name)
        lower.semilogy(section["disturbed"][name]["tracking_rms_m"][2], style, label=name)
    for number, label in ((3, "E_h1"), (4, "E_h2"), (5, "E_h3")):
        disturbed.semilogy(section["disturbed"]["formation"]["formation_rms_m"][number],
                           label=label)  # fmt: skip
    left.set_title("axis x1")
    right.set_title("formation error E_d2")
    lower.set_title("axis x2, agent 1 disturbed")
    disturbed.set_title("formation alone, disturbed")
    for axes in (left, right, lower, disturbed):
        axes.set_xlabel("run")
        axes.set_ylabel("RMS error in m")
        axes.legend()


PICTURES = [
    Picture(
        "formation",
        "Three objectives for three agents (figures 6.4 to 6.7). Where the formation alone has no "
        "curve its error is zero.",
        _draw,
    )
]
