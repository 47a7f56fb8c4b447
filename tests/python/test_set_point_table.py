"""Cells of many rotary axes with a table of set points as program."""

import numpy as np
import pytest

from ilc_rt import Campaign, Cell
from ilc_rt.plots import learned_input, tracking

N_AXES = 9
NAMES = [f"a{axis}" for axis in range(1, N_AXES + 1)]

AXIS = """
[[axis]]
name = "{name}"
node = {node}
interface = "csp"
unit = "rad"
counts_per_m = 1e6
limits = {{ position_min_m = -1.0, position_max_m = 1.0, velocity_max_m_s = 4.0,
    acceleration_max_m_s2 = 100.0, jerk_max_m_s3 = {jerk}, following_error_max_m = 0.5 }}
model = {{ natural_frequency_hz = 6.0, damping = 0.6, delay_samples = 1 }}
simulation = {{ mass_kg = 0.002, natural_frequency_hz = 6.0, damping = 0.6, force_max_n = 5.0 }}
"""


def cell_text(
    bus: str = "loopback:", cycle_us: int = 5000, jerk: float = 4000.0, n_axes: int = N_AXES
) -> str:
    head = f'[cell]\nname = "nine"\ncycle_us = {cycle_us}\n[bus]\naddress = "{bus}"\n'
    axes = [AXIS.format(name=f"a{k}", node=k, jerk=jerk) for k in range(1, n_axes + 1)]
    job = (
        f'[program]\nkind = "table"\nfile = "points.csv"\nfeed_m_s = 0.5\n'
        f"start_m = {[0] * n_axes}\n"
        '[learning]\nmeasure = "encoder"\ninput_max_m = 0.5\n[learning.norm_optimal]\nrate = 0.5\n'
    )
    return "\n".join([head, *axes, job])


def set_points() -> np.ndarray:
    """Return a smooth move of each axis, proportional to its number, and back."""
    share = (0.5 * (1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, 161)))) ** 2
    return 0.02 * share[:, None] * np.arange(1, N_AXES + 1)


def table_text(points: np.ndarray, names: list[str] = NAMES) -> str:
    rows = [",".join(repr(float(value)) for value in row) for row in points]
    return "\n".join(["# one row a cycle", ",".join(names), *rows]) + "\n"


def load(folder, cell: str, table: str) -> Cell:
    (folder / "points.csv").write_text(table)
    (folder / "cell.toml").write_text(cell)
    return Cell.load(folder / "cell.toml")


def refusal(folder, cell: str, table: str) -> str:
    with pytest.raises(ValueError, match=r"\w") as refused:
        load(folder, cell, table)
    line = str(refused.value)
    assert "\n" not in line
    return line


def test_nine_axes_learn_their_table(tmp_path):
    cell = load(tmp_path, cell_text(), table_text(set_points()))
    assert cell.axis_units == ["rad"] * N_AXES
    reference = cell.reference()
    assert np.array_equal(reference[20:181], set_points())
    assert np.array_equal(reference[181:], np.tile(set_points()[-1], (40, 1)))
    campaign = Campaign(cell, library=tmp_path / "library.db")
    rms = [record.tracking_rms_m for record in campaign.run(4)]
    assert rms[-1] < 0.1 * rms[0]
    assert [campaign.result.input_unit(axis) for axis in range(N_AXES)] == ["rad"] * N_AXES
    assert learned_input(campaign.result).axes[0].get_ylabel() == "input in µrad"
    assert tracking(campaign.result).axes[0].get_ylabel() == "error in µrad"


def test_a_table_is_refused_with_its_line_or_row(tmp_path):
    good = table_text(set_points())
    swapped = table_text(set_points(), ["a2", "a1", *NAMES[2:]])
    line = refusal(tmp_path, cell_text(), swapped)
    assert "points.csv: line 2: a2: " in line
    assert "names the axes in order: a1, a2, a3" in line
    line = refusal(tmp_path, cell_text(), table_text(set_points()[5:]))
    assert "points.csv: line 3: axis a1 begins at" in line
    assert "start_m" in line
    line = refusal(tmp_path, cell_text(), good + "0,0\n")
    assert "line 164: 2 columns: 9 columns are needed" in line
    line = refusal(tmp_path, cell_text(jerk=10.0), good)
    assert "cell.toml: [program] (axis 8 is a8): row 5: axis 8: the jerk over the cycle" in line
    line = refusal(tmp_path, cell_text(), table_text(set_points()[:40]))
    assert "row 41: axis " in line
    assert "rest at the first and the last" in line
    line = refusal(tmp_path, cell_text().replace("points.csv", "gone.csv"), good)
    assert "gone.csv: cannot be read" in line
    assert "a text file of set points" in line


def test_nine_axes_fit_a_can_bus_at_200_hz_and_not_at_500(tmp_path):
    table = table_text(set_points())
    assert load(tmp_path, cell_text("can:can0"), table).n_axes == N_AXES
    line = refusal(tmp_path, cell_text("can:can0", 2000, 1e6), table)
    assert "[bus] load_max" in line
    assert "2260 us at worst" in line
    assert "cycle_us = 2900" in line


def test_thirteen_axes_are_refused(tmp_path):
    line = refusal(tmp_path, cell_text(n_axes=13), table_text(set_points()))
    assert "[[axis]] count = 13: 1 to 12 axes" in line
