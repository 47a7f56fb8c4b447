"""Fig. 5 to 7 and Table 1 of Haas et al.: the gantry bench, learned by the real controller.

Servo loop, drives and learning run in lock-step in this process; `bench.toml` is the machine. Only
the paper's package imports it.
"""

from __future__ import annotations

import tempfile
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from ilc_papers.axes import errors_over_runs
from ilc_papers.paper import Claim, Figures, Picture, Tell
from ilc_rt import Campaign
from ilc_rt.deviation import path_deviation
from ilc_rt.trajectory import contour_error

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ilc_rt import IterationRecord

    Array = NDArray[np.float64]

RUNS = 31
#: Table 1 is of the run after nine updates.
PRINTED_RUN = 9
Measure = Literal["encoder", "tcp"]
CASES: dict[str, Measure | None] = {"none": None, "enc": "encoder", "kgm": "tcp"}
COLOURS = {"none": "#D55E00", "enc": "#009E73", "kgm": "#0072B2"}
LABELS = {"none": "without learning", "enc": "CO-ILC (ENC)", "kgm": "CO-ILC (KGM)"}


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001
    """Return the errors at the tool in each run, by the measurement learned from.

    Returns
    -------
    dict
        Under `gantry` for `none`, `enc` and `kgm`: `tracking_inf_m` and `contour_inf_m` at the
        tool, the same at the encoders; under `path` the paths of Fig. 7.
    """
    runs = PRINTED_RUN + 4 if reduced else RUNS
    gantry: Figures = {}
    path: Figures = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, measure in CASES.items():
            tell(f"gantry, {LABELS[name]}")
            records = _run(measure, runs, Path(folder) / f"{name}.db")
            gantry[name] = _told(records)
            last = records[PRINTED_RUN]
            path["reference_m"] = _shown(last.reference_m)
            path[f"{name}_m"] = _shown(last.tool_or_encoder_m)
    return {"gantry": gantry, "path": path}


def _run(measure: Measure | None, runs: int, library: Path) -> list[IterationRecord]:
    bench = resources.files("ilc_papers.haas2016").joinpath("bench.toml")
    with resources.as_file(bench) as cell:
        campaign = Campaign(cell, library=library, measure=measure, learning=measure is not None)
        return list(campaign.run(runs))


def _told(records: list[IterationRecord]) -> Figures:
    reference_m = records[0].reference_m
    return {
        "tracking_inf_m": [record.tool_tracking_inf_m for record in records],
        "contour_inf_m": [record.contour_inf_m for record in records],
        "encoder_tracking_inf_m": [record.encoder_tracking_inf_m for record in records],
        "encoder_contour_inf_m": [
            float(contour_error(reference_m, record.encoder_m).max()) for record in records
        ],
    }


def _shown(path_m: Array) -> list[list[float]]:
    """Return every other sample, to the nanometre."""
    shown: list[list[float]] = path_m[::2].round(9).tolist()
    return shown


def claims(figures: Figures) -> list[Claim]:
    """Set Table 1 and the statements on figures 5 to 7 beside the results."""
    gantry = figures["gantry"]
    contour = {name: gantry[name]["contour_inf_m"][PRINTED_RUN] for name in CASES}
    tracking = {name: gantry[name]["tracking_inf_m"][PRINTED_RUN] for name in CASES}
    less = {name: 1.0 - contour[name] / contour["none"] for name in CASES}
    enc = np.array(gantry["enc"]["contour_inf_m"])
    best = int(enc.argmin())
    set_of_bench = (
        "The percentages depend on friction, mode and misalignment, which are not printed."
    )
    return [
        Claim("contour error without learning", contour["none"], 611e-6, "m", "Table 1"),
        Claim("contour error after 9 updates, ENC", contour["enc"], 296e-6, "m", "Table 1"),
        Claim("contour error after 9 updates, KGM", contour["kgm"], 89e-6, "m", "Table 1"),
        Claim("contour error reduced by, ENC", less["enc"], 0.52, "", "Table 1",
              remark=set_of_bench),
        Claim("contour error reduced by, KGM", less["kgm"], 0.85, "", "Table 1",
              remark=set_of_bench),
        Claim("contour error KGM < ENC < without learning", None, source="Table 1",
              holds=contour["kgm"] < contour["enc"] < contour["none"]),
        Claim("tracking error without learning", tracking["none"], 1848e-6, "m", "Table 1"),
        Claim("tracking error after 9 updates, ENC", tracking["enc"], 337e-6, "m", "Table 1"),
        Claim("tracking error after 9 updates, KGM", tracking["kgm"], 138e-6, "m", "Table 1"),
        Claim("tracking error KGM < ENC < without learning", None, source="Table 1",
              holds=tracking["kgm"] < tracking["enc"] < tracking["none"]),
        Claim("learning from the encoders improves them more than the tool", None,
              source="Fig. 5, 6",
              holds=gantry["enc"]["encoder_contour_inf_m"][PRINTED_RUN] < contour["enc"]),
        Claim("learning from the encoders: at the tool a minimum, then worse",
              float(enc[-1] / enc[best]), None, "", "Fig. 6", holds=1 <= best < len(enc) - 1,
              remark=f"The contour error at the tool is smallest after {best} updates; the "
              "encoders go on to be exact, and so drive a crossbeam that they do not see. The "
              "figure is the last error over the smallest."),
    ]  # fmt: skip


def _draw_errors(figures: Figures, figure: Figure) -> None:
    figure.set_size_inches(5.6, 5.6)
    grid = figure.subplots(2, 1, sharex=True)
    for axes, key, label in zip(
        grid, ("tracking_inf_m", "contour_inf_m"), ("tracking", "contour"), strict=True
    ):
        for name, colour in COLOURS.items():
            error_um = np.array(figures["gantry"][name][key]) * 1e6
            axes.plot(error_um, color=colour, marker="o", markersize=3,
                          label=f"{LABELS[name]}, at the tool")  # fmt: skip
        seen = np.array(figures["gantry"]["enc"][f"encoder_{key}"]) * 1e6
        axes.plot(seen, color=COLOURS["enc"], linestyle=":",
                      label=f"{LABELS['enc']}, at the encoders")  # fmt: skip
        axes.axvline(PRINTED_RUN, color="#9AA0A8", linewidth=1.0, linestyle="--")
        errors_over_runs(axes, f"max {label} error in µm", runs=axes is grid[-1])
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)


def _draw_path(figures: Figures, figure: Figure) -> None:
    """Draw the deviations magnified, as Fig. 7 does."""
    factor = 20.0
    path = {name: np.array(points) for name, points in figures["path"].items()}
    reference_m = path["reference_m"]
    figure.set_size_inches(5.6, 4.9)
    axes = figure.subplots()
    axes.plot(*(reference_m.T * 1e3), color="#DADDE2", linewidth=4.0, label="programmed")
    for name, colour in COLOURS.items():
        across = path_deviation(reference_m, path[f"{name}_m"])
        shown = reference_m + factor * across
        axes.plot(*(shown.T * 1e3), color=colour, linewidth=1.2, label=LABELS[name])
    axes.set_aspect("equal")
    axes.set_xlabel("x in mm")
    axes.set_ylabel("y in mm")
    axes.set_title(f"deviation from the path shown {factor:g} times")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)


PICTURES = [
    Picture("gantry", "Largest tracking and contour error of the gantry against the run, by what "
            "is learned from (Fig. 5 and 6; dashed: the run of Table 1).", _draw_errors),
    Picture("contour", "The path without learning and after nine updates, deviations magnified "
            "(Fig. 7).", _draw_path),
]  # fmt: skip
