"""A reversal: E/S and linear interpolation at a 180° corner.

The ratio of the two depends on the jerk limit, which is not printed, and on the evaluated part:
both are tabulated. Read by the other modules of this package only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_papers.dimarco2016.index import index
from ilc_papers.dimarco2016.reference import INCH_M
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ilc_rt.trajectory import Trajectory

#: 10 in there and back at 10 in/s, 500 in/s².
LENGTH_M = 10.0 * INCH_M
FEED_M_S = 10.0 * INCH_M
ACCELERATION_M_S2 = 500.0 * INCH_M
DT_S = 1e-4

#: Jerk over acceleration limit, in 1/s.
JERKS_PER_S = (25.0, 50.0, 75.0, 100.0, 200.0, 1000.0, 10000.0)
REDUCED_JERKS_PER_S = (50.0, 1000.0)

#: Evaluated part, in s of the 2 s.
SPANS_S = {"whole move": (0.0, 2.0), "half a second around the corner": (0.75, 1.25)}

PRINTED_ALPHA = 50.0


def planned(jerk_per_s: float) -> dict[str, Trajectory]:
    """Plan the move in all three ways."""
    points_m = [0.0, LENGTH_M, 0.0]
    machine = {
        "feed_m_s": FEED_M_S,
        "dt_s": DT_S,
        "velocity_max_m_s": 10.0 * FEED_M_S,
        "acceleration_max_m_s2": ACCELERATION_M_S2,
        "jerk_max_m_s3": jerk_per_s * ACCELERATION_M_S2,
    }
    ways = {
        setting: trajectory.jerk_limited(points_m, setting=setting, **machine)
        for setting in ("complete", "on_time")
    }
    return {"exponential_sigmoid": trajectory.exponential_sigmoid(points_m, **machine), **ways}


def passing_m(path: Trajectory) -> float:
    """Return the overshoot of a path beyond the corner; 0 if there is none."""
    return max(0.0, float(path.position_m.max()) - LENGTH_M)


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return, for each jerk limit, the alpha of the corner and J of every way and span."""
    tell("there and back again")
    rows: list[Figures] = []
    for jerk_per_s in REDUCED_JERKS_PER_S if reduced else JERKS_PER_S:
        paths = planned(jerk_per_s)
        alphas = {place: alpha for _, place, alpha, _ in paths["exponential_sigmoid"].alphas}
        costs = {
            span: {way: index(path, *times) for way, path in paths.items()}
            for span, times in SPANS_S.items()
        }
        rows.append(
            {
                "jerk_max_m_s3": jerk_per_s * ACCELERATION_M_S2,
                "jerk_per_s": jerk_per_s,
                "alpha": alphas["transition"],
                "passes_corner_m": passing_m(paths["exponential_sigmoid"]),
                "cost": costs,
                "ratio": {
                    span: {
                        setting: {
                            part: cost[setting][part] / cost["exponential_sigmoid"][part]
                            for part in ("tracking", "acceleration", "total")
                        }
                        for setting in ("complete", "on_time")
                    }
                    for span, cost in costs.items()
                },
            }
        )
    paths = planned(1000.0)
    shown = slice(round(0.8 / DT_S), round(1.25 / DT_S), 20)
    found = {
        "rows": rows,
        "motion": {
            "t_s": paths["exponential_sigmoid"].t_s[shown].tolist(),
            "programmed_m": paths["exponential_sigmoid"].programmed_m[shown, 0].tolist(),
            **{way: path.position_m[shown, 0].tolist() for way, path in paths.items()},
        },
    }
    return {"corner": found}


def claims(figures: Figures) -> list[Claim]:
    """Return the statements of section 2.3.4."""
    rows = figures["interpolation"]["corner"]["rows"]
    ratios = [row["ratio"]["whole move"]["complete"] for row in rows]
    tracking = [ratio["tracking"] for ratio in ratios]
    total = [ratio["total"] for ratio in ratios]
    passing = max(row["passes_corner_m"] for row in rows)
    return [
        Claim(
            "largest alpha of the corner at 500 in/s²",
            rows[-1]["alpha"],
            PRINTED_ALPHA,
            unit="1/s",
            source="section 2.3.4",
            holds=abs(rows[-1]["alpha"] / PRINTED_ALPHA - 1.0) < 1e-3,
            remark="a jerk limit below 50/s times the acceleration limit makes it smaller",
        ),
        Claim(
            "tracking part of J, linear over E/S, whole move, the largest of all jerk limits",
            max(tracking),
            30.0,
            source="section 2.3.4",
            holds=min(tracking) < 30.0 < max(tracking),
            remark="30-fold is printed for J: of its tracking part it comes out at some jerk limit "
            f"between 25/s and 10000/s of the acceleration limit ({min(tracking):.0f} to "
            f"{max(tracking):.0f}), every move completed",
        ),
        Claim(
            "J, linear over E/S, whole move, the largest of all jerk limits",
            max(total),
            30.0,
            source="section 2.3.4",
            holds=max(total) >= 30.0,
            remark="does not follow from the printed k_e and k_a: with them the acceleration part "
            "is by far the larger, and E/S spends as much of it or more",
        ),
        Claim(
            "how far E/S goes beyond the corner",
            passing,
            0.0,
            unit="m",
            source="Fig. 2.17",
            holds=passing <= 1e-12,
        ),
    ]


def draw(figures: Figures, figure: Figure) -> None:
    """Draw the corner, and the ratios over the jerk limit."""
    found = figures["interpolation"]["corner"]
    figure.set_size_inches(figure.get_figwidth(), 4.6)
    near, over = figure.subplots(1, 2)
    motion = found["motion"]
    near.plot(motion["t_s"], motion["programmed_m"], color="0.7", label="programmed")
    for way, label in (
        ("exponential_sigmoid", "E/S"),
        ("complete", "linear, every move completed"),
        ("on_time", "linear, next move on time"),
    ):
        near.plot(motion["t_s"], motion[way], linewidth=1.0, label=label)
    near.set(xlabel="time (s)", ylabel="position (m)", title="Corner at 1 s")
    jerks = [row["jerk_per_s"] for row in found["rows"]]
    for span in SPANS_S:
        for part in ("tracking", "total"):
            ratios = [row["ratio"][span]["complete"][part] for row in found["rows"]]
            label = f"{'J' if part == 'total' else 'tracking'}, {span}"
            over.loglog(jerks, ratios, marker=".", label=label)
    over.axhline(30.0, color="0.7", linestyle=":", label="printed")
    over.set(xlabel="jerk over acceleration limit (1/s)", ylabel="linear over E/S")
    for axes in (near, over):
        axes.legend(fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2))


PICTURES = (
    Picture(
        "corner",
        "A corner that turns round, and how many times more the linear interpolator costs: it "
        "depends on the jerk limit and on what is counted (as Fig. 2.16 and 2.17)",
        draw,
    ),
)
