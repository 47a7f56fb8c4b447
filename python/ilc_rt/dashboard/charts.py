"""Options of ECharts for every chart of the page, from the model and from libraries.

A colour is a role, ``$series0`` or ``$grid``: the page resolves it by the theme that is shown. The
key ``ilc`` is for the page's own script and unknown to ECharts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.deviation import magnification, path_deviation
from ilc_rt.quantity import unit_for

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ilc_rt.dashboard.archive import StoredRun
    from ilc_rt.dashboard.capture import Capture
    from ilc_rt.dashboard.model import CellModel
    from ilc_rt.quantity import Unit

    Array = NDArray[np.float64]
    Option = dict[str, Any]

N_COLOURS = 7
TIMES = "\N{MULTIPLICATION SIGN}"
#: A second sign of each line besides its colour.
DASHES = ("solid", "dashed", "dotted")
POINTS_MAX = 4_000
#: Of each axis in a chart of the last run.
RUN_POINTS_MAX = 800
#: Factors of the deviation that the page offers; 0 is a suitable one.
FACTORS = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
GRID = {"left": 58, "right": 14, "top": 30, "bottom": 34}


def runs(cell: CellModel) -> Option:
    """Return the errors of the runs over their numbers, on a logarithmic scale."""
    option = frame("run", "")
    comparison, records = cell.comparison, cell.records
    if comparison is None:
        return without(option, "no run has ended yet")
    series, units = [], []
    for number, column in enumerate(comparison.errors()):
        units.append(column.unit.symbol)
        scale = column.unit.scale
        data = [[r.index, _above_zero(column.of(r), scale)] for r in records]
        series.append(line(f"{column.name} {column.unit.symbol}", number, data, symbol=True))
    turned = [
        {"name": "rolled back", "xAxis": r.index, "label": {"formatter": "↩ rolled back"}}
        for r in records
        if r.rolled_back
    ] + [
        {"name": "learning off", "xAxis": r.index, "label": {"formatter": "⏸ learning off"}}
        for r in records
        if r.learning_off
    ]
    if turned and series:
        series[0]["markLine"] = {
            "symbol": "none", "silent": True, "data": turned[-20:],
            "lineStyle": {"color": "$warn", "type": "dashed"},
            "label": {"color": "$ink", "fontSize": 10, "position": "insideEndTop"},
        }  # fmt: skip
    option["series"] = series
    option["xAxis"]["minInterval"] = 1
    option["xAxis"]["min"], option["xAxis"]["max"] = records[0].index, max(records[-1].index, 1)
    option["yAxis"] |= {"type": "log", "name": " / ".join(dict.fromkeys(units))}
    return option


def live(cell: CellModel, what: str) -> Option:
    """Return the frame of a live chart, "error", "reference" or "input"; the page adds points.

    With the first points the page takes the words away.
    """
    option = frame("s", "") | words("no signals yet; in lock-step a cell sends none")
    units = cell.input_units if what == "input" else cell.units
    # The first unit has the left axis, all others share the right one.
    groups = list(dict.fromkeys(units))
    option["yAxis"] = [
        _axis("") | {"position": side} for side in ("left", "right")[: max(1, len(groups))]
    ]
    if len(groups) > 1:
        option["yAxis"][1]["splitLine"] = {"show": False}
        option["grid"] = GRID | {"right": 58}
    option["xAxis"] |= {"min": -10, "max": 0}
    option["tooltip"] = {"show": False}
    option["series"] = [
        line(name, number, []) | {"yAxisIndex": min(1, groups.index(units[number]))}
        for number, name in enumerate(cell.axis_names)
    ]
    return option


def live_units(cell: CellModel, what: str, largest: Sequence[float]) -> list[Unit]:
    """Return the display unit of each axis in a live chart, by the largest value of its kind."""
    bases = cell.input_units if what == "input" else cell.units
    sizes: dict[str, float] = {}
    for base, size in zip(bases, largest, strict=True):
        sizes[base] = max(sizes.get(base, 0.0), size)
    return [unit_for(base, sizes[base]) for base in bases]


def contour(cell: CellModel, run: Capture | None, factor: int = 0) -> tuple[Option, int]:
    """Return the path of the first two axes, with the deviation magnified, and the factor."""
    option = frame("", "")
    linear = [axis for axis, unit in enumerate(cell.units) if unit == "m"][:2]
    if len(linear) < 2:
        return without(option, "a contour needs two linear axes"), factor
    if run is None or run.n_axes <= max(linear):
        return without(option, "no run has been heard to its end yet"), factor
    good = np.isfinite(run.reference_m[:, linear]).all(axis=1)
    good &= np.isfinite(run.measured_m[:, linear]).all(axis=1)
    stride = max(1, int(good.sum()) // POINTS_MAX)
    reference = run.reference_m[good][::stride][:, linear]
    if len(reference) < 2:
        return without(option, "the run has too few samples"), factor
    away = path_deviation(reference, run.measured_m[good][::stride][:, linear])
    extent_m = float(np.ptp(reference, axis=0).max())
    factor = factor or magnification(float(np.linalg.norm(away, axis=1).max()), extent_m)
    unit = unit_for("m", extent_m)
    names = [cell.axis_names[axis] for axis in linear]
    option["xAxis"] |= {"name": f"{names[0]} {unit.symbol}", "scale": True}
    option["yAxis"] |= {"name": f"{names[1]} {unit.symbol}", "scale": True}
    option["series"] = [
        line("programmed", 0, _pairs(reference * unit.scale))
        | {"lineStyle": {"color": "$edge", "width": 2}, "color": "$edge"},
        line(
            f"made, deviation {TIMES} {factor}", 0, _pairs((reference + factor * away) * unit.scale)
        ),
    ]
    option["ilc"] = {"equal": True}
    return option, factor


def inputs(cell: CellModel, run: Capture | None) -> Option:
    """Return the learned inputs of a run over its time."""
    option = frame("s", "")
    if run is None or not cell.cycle_s or run.n_axes != cell.n_axes:
        return without(option, "no run has been heard to its end yet")
    time_s: Array = np.arange(run.n_samples, dtype=np.float64) * cell.cycle_s
    sizes = [_largest(run.input[:, axis]) for axis in range(run.n_axes)]
    units = live_units(cell, "input", sizes)
    option["series"] = [
        line(
            f"{name} {unit.symbol}",
            axis,
            thinned(time_s, run.input[:, axis], unit.scale, RUN_POINTS_MAX),
        )
        for axis, (name, unit) in enumerate(zip(cell.axis_names, units, strict=True))
    ]
    option["yAxis"]["name"] = " / ".join(dict.fromkeys(unit.symbol for unit in units))
    _end_with_data(option)
    return option


def timing(cell: CellModel) -> Option:
    """Return the histograms of the times of the loop."""
    option = frame("µs", "cycles")
    if not cell.timing:
        return option
    option["xAxis"]["type"] = option["yAxis"]["type"] = "log"
    for number, (name, histogram) in enumerate(cell.timing.items()):
        data = [[max(upper, 0.1), count] for upper, count in histogram.bins if count > 0]
        option["series"].append(
            line(name, number, data, symbol=True)
            | {"step": "middle", "areaStyle": {"opacity": 0.1}}
        )
    return option


def late_cycle(cell: CellModel) -> Option:
    """Return the stages of the worst cycle beside usual ones."""
    option = frame("µs", "")
    late = cell.late
    if late is None:
        return option
    option["yAxis"] = _axis("") | {"type": "category", "data": ["usual", "late"]}
    option["xAxis"] |= {"type": "value", "min": 0}
    option["series"] = [
        {
            "type": "bar", "name": stage, "stack": "cycle", "barWidth": "55%",
            "color": f"$series{number}",
            "data": [
                round(getattr(late.usual, f"{stage}_us"), 1),
                round(getattr(late.stages, f"{stage}_us"), 1),
            ],
        }
        for number, stage in enumerate(("wake", "receive", "control", "send"))
    ]  # fmt: skip
    return option


def compared(stored: Sequence[StoredRun], what: str, axis: int) -> Option:
    """Return a signal of several runs over a common time, with a cursor shared by all charts."""
    option = frame("s", "")
    if not stored:
        return without(option, "no run is chosen")
    sizes = [_largest(run.signal(what, axis)) for run in stored]
    unit = unit_for(stored[0].unit(what, axis), max(sizes))
    for number, run in enumerate(stored):
        told = f", shifted {1e3 * run.shift_s:+.3g} ms" if run.shift_s else ""
        told = told if run.is_same else ", another motion"
        data = thinned(run.time_s(), run.signal(what, axis), unit.scale)
        option["series"].append(line(run.name + told, number, data))
    option["yAxis"]["name"] = unit.symbol
    # A motion far from zero is more than a line at the edge.
    option["yAxis"]["scale"] = what == "command"
    _end_with_data(option)
    option["ilc"] = {"group": "compare"}
    option["dataZoom"] = [{"type": "inside", "filterMode": "none"}]
    return option


def frame(x_name: str, y_name: str) -> Option:
    """Return a chart without series."""
    return {
        "animation": False,
        "aria": {"enabled": False},
        "grid": dict(GRID),
        "legend": {
            "type": "scroll", "top": 0, "left": 66, "right": 8, "itemWidth": 18, "itemHeight": 8,
            "textStyle": {"color": "$ink", "fontSize": 11}, "pageTextStyle": {"color": "$ink"},
            "pageIconColor": "$ink",
        },
        "tooltip": {
            "trigger": "axis", "confine": True, "backgroundColor": "$ground",
            "borderColor": "$edge", "textStyle": {"color": "$ink", "fontSize": 12},
            "axisPointer": {"type": "line", "lineStyle": {"color": "$ticks"}},
        },
        "xAxis": _axis(x_name) | {"nameLocation": "middle", "nameGap": 20},
        "yAxis": _axis(y_name) | {"nameGap": 8},
        "series": [],
    }  # fmt: skip


def without(option: Option, why: str) -> Option:
    """Return a chart that says why it shows nothing."""
    for axis in ("xAxis", "yAxis"):
        option[axis] |= {"show": False}
    return option | words(why)


def words(said: str) -> Option:
    """Return words in the middle of a chart."""
    style = {"color": "$ticks", "fontSize": 12, "fontWeight": "normal"}
    return {"title": {"text": said, "left": "center", "top": "middle", "textStyle": style}}


def line(name: str, number: int, data: list[Any], *, symbol: bool = False) -> Option:
    """Return a line; its number decides on colour and dashes."""
    colour = f"$series{number % N_COLOURS}"
    return {
        "type": "line", "name": name, "data": data, "color": colour, "showSymbol": symbol,
        "symbol": ("circle", "rect", "triangle", "diamond")[number % 4], "symbolSize": 5,
        "lineStyle": {"width": 1.4, "type": DASHES[number // N_COLOURS % len(DASHES)]},
        "emphasis": {"disabled": True},
    }  # fmt: skip


def thinned(
    time_s: Array, values: Array, scale: float = 1.0, n_max: int = POINTS_MAX
) -> list[list[float | None]]:
    """Return points of a line, values times `scale`: minimum and maximum of each span if many."""
    if len(values) <= n_max:
        return _pairs(np.column_stack((time_s, values * scale)))
    starts = np.linspace(0, len(values), n_max // 2, endpoint=False).astype(np.intp)
    middles = (starts + np.append(starts[1:], len(values))) // 2
    points = np.empty((2 * len(starts), 2))
    points[0::2, 0], points[1::2, 0] = time_s[starts], time_s[middles]
    points[0::2, 1] = np.fmin.reduceat(values, starts) * scale
    points[1::2, 1] = np.fmax.reduceat(values, starts) * scale
    return _pairs(points)


def _axis(name: str) -> Option:
    return {
        "type": "value", "name": name,
        "nameTextStyle": {"color": "$ticks", "fontSize": 11, "align": "right"},
        "axisLine": {"show": True, "onZero": False, "lineStyle": {"color": "$edge"}},
        "axisLabel": {"color": "$ticks", "fontSize": 11, "hideOverlap": True},
        "splitLine": {"lineStyle": {"color": "$grid"}},
    }  # fmt: skip


def _end_with_data(option: Option) -> None:
    """Let the time axis end where the data end, whatever number that is."""
    option["xAxis"] |= {"max": "dataMax"}
    option["xAxis"]["axisLabel"] = option["xAxis"]["axisLabel"] | {"showMaxLabel": False}


def _above_zero(value: float | None, scale: float) -> float | None:
    """Return a value for a logarithmic scale, which has no zero."""
    return None if value is None or not value > 0.0 else float(f"{value * scale:.4g}")


def _largest(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if finite.size else 0.0


def _pairs(points: Array) -> list[list[float | None]]:
    rows: list[list[float | None]] = np.round(points, 5).tolist()
    if np.isnan(points).any():
        return [[None if value != value else value for value in row] for row in rows]
    return rows
