"""Weights proposed by `ilc tune`: their effect on unknown cells, and their output."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from tuning_fixture import GANTRY, RUNS, learn, other_cell

from ilc_rt import Campaign, Cell
from ilc_rt.cell_file import changed_text, write_values
from ilc_rt.cli import main
from ilc_rt.errors import BadInputError
from ilc_rt.trials import Bench, Weights, believed_axes
from ilc_rt.tuning import propose_weights

README = {"uncertainty": 0.3, "noise_m": 1e-6}
SHIPPED = ["examples/01_gantry.toml", "examples/02_parallel.toml", "examples/04_gcode.toml"]
OFFSETS = [
    "examples/10_cst.toml",
    "examples/11_csp_torque.toml",
    "examples/12_csp_velocity.toml",
    "examples/13_csv_torque.toml",
]


def copied(tmp_path, cell):
    """Copy a cell with its part program, if it has one."""
    for file in (Path(cell), Path("examples/04_gcode.ngc")):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path / Path(cell).name


def assert_learns(path, tmp_path, left):
    """Run a cell; assert the remaining contour error, and that no input was rolled back."""
    records = list(Campaign(path, bus="loopback:", library=tmp_path / "runs.db").run(RUNS))
    contour = [record.contour_inf_m for record in records]
    assert contour[-1] <= left * contour[0]
    inputs = {record.input.tobytes() for record in records}
    assert len(inputs) == RUNS, "an input that comes again is one that was restored"


@pytest.mark.parametrize("options", [README, {}], ids=["readme", "defaults"])
@pytest.mark.parametrize("cell", SHIPPED)
def test_a_shipped_cell_learns_with_what_is_proposed(cell, options, tmp_path):
    path = copied(tmp_path, cell)
    found = propose_weights(path, **options)
    assert found.write(path)
    assert_learns(path, tmp_path, 0.15)


@pytest.mark.parametrize("cell", OFFSETS)
def test_a_cell_that_learns_an_offset_learns_with_what_is_proposed(cell, tmp_path):
    path = copied(tmp_path, cell)
    found = propose_weights(path)
    assert found.write(path)
    assert_learns(path, tmp_path, 0.3)


def test_the_cell_of_the_demo_gets_what_the_first_example_gets():
    demo = propose_weights("python/ilc_rt/data/gantry.toml")
    assert demo.weights == propose_weights(GANTRY).weights


@pytest.mark.parametrize("seed", range(10))
def test_another_cell_learns_with_what_is_proposed(seed, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(other_cell(seed), encoding="utf-8")
    assert propose_weights(path, **README).write(path)
    contour, _ = learn(path, tmp_path / "runs.db")
    assert contour[-1] < 0.3 * contour[0]


@pytest.mark.parametrize("cell", SHIPPED + OFFSETS)
def test_the_axes_of_the_trials_are_those_of_the_controller(cell):
    described = Cell.load(cell)
    axes, _ = believed_axes(described)
    model = described.model()
    way = described.reference() - described.reference()[0]
    for index, axis in enumerate(axes):
        whole = np.zeros_like(way)
        whole[:, index] = way[:, index]
        np.testing.assert_allclose(
            axis.model().simulate(way[:, index]),
            model.simulate(whole / described.input_scales[index])[:, index],
            atol=1e-12,
        )
        np.testing.assert_allclose(
            axis.first_error(), described.first_error()[:, index], atol=1e-12
        )


def test_a_mode_nearer_by_asks_for_slower_learning():
    near, far = (propose_weights(GANTRY, known_hz=hz).weights.rate for hz in (15.0, 40.0))
    assert near > 1.5 * far


def test_gains_that_reach_one_say_up_to_where_the_model_is_known():
    # 0.3 at frequency zero, 1 at 25 Hz of 250 Hz.
    gains = [0.3 + 7.0 * k / 100 for k in range(101)]
    found = propose_weights(GANTRY, uncertainty=gains)
    assert found.uncertainty == 0.3
    assert found.known_hz == pytest.approx({"x": 25.0, "y": 25.0})


def test_noise_asks_for_slower_learning():
    quiet, noisy = (propose_weights(GANTRY, noise_m=noise_m) for noise_m in (1e-6, 1e-3))
    assert noisy.weights.rate > 2.0 * quiet.weights.rate
    assert "noise" in next(reason.why for reason in noisy.reasons if reason.key == "r")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"uncertainty": 1.0}, "uncertainty = 1.0; below 1"),
        ({"uncertainty": -0.1}, "uncertainty = -0.1"),
        ({"uncertainty": float("nan")}, "uncertainty = nan"),
        ({"uncertainty": []}, "uncertainty"),
        ({"known_hz": 0.0}, "known_hz = 0.0; between 0 and 250 Hz"),
        ({"known_hz": 250.0}, "known_hz = 250.0"),
        ({"noise_m": -1.0}, "noise_m = -1.0"),
        ({"noise_m": float("inf")}, "noise_m = inf"),
        ({"n_runs": 0}, "n_runs = 0; 1 to 10000 is needed"),
        ({"n_runs": 10_001}, "n_runs = 10001"),
    ],
)
def test_what_is_out_of_range_is_refused(options, told):
    with pytest.raises(BadInputError, match=re.escape(told)):
        propose_weights(GANTRY, **options)


def gantry_with(tmp_path, *changes):
    text = GANTRY.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "cell.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_rotary_axis_is_tuned_in_its_own_unit(tmp_path, capsys):
    path = gantry_with(tmp_path, ('name = "y"\n', 'name = "y"\nunit = "rad"\n'))
    assert main(["tune", str(path)]) == 0
    text = capsys.readouterr().out
    assert re.search(r"\bx .*µm .*µm", text)
    assert re.search(r"\by .*µrad .*µrad", text)


def test_axes_of_both_kinds_share_one_rate(tmp_path):
    text = GANTRY.read_text(encoding="utf-8")
    parallel = Path(SHIPPED[1]).read_text(encoding="utf-8")
    axis = re.search(r'\[\[axis\]\]\nname = "y".*?(?=\[tcp_encoder\])', parallel, re.DOTALL)
    mixed = re.sub(
        r'\[\[axis\]\]\nname = "y".*?(?=\[tcp_encoder\])', axis.group(), text, flags=re.DOTALL
    )
    path = tmp_path / "mixed.toml"
    path.write_text(mixed, encoding="utf-8")
    found = propose_weights(path)
    assert all(trial.growth <= 1.2 for trial in found.trials)
    # The input of y is a velocity: a rate that suits x makes it slow, which is noted.
    assert any(note.startswith("axis y: ") and "--runs" in note for note in found.notes)


def test_a_program_without_motion_is_refused(tmp_path):
    text = GANTRY.read_text(encoding="utf-8")
    head, rest = text.split("[[program.segment]]", 1)
    learning = rest[rest.index("[learning]") :]
    path = tmp_path / "still.toml"
    path.write_text(
        head + "[[program.segment]]\ndwell_s = 0.5\nto_m = [0.08, 0.0]\n\n" + learning,
        encoding="utf-8",
    )
    with pytest.raises(BadInputError):
        propose_weights(path)


def test_a_law_that_has_no_weights_is_said_and_never_written(tmp_path, capsys):
    path = gantry_with(tmp_path, ('law = "norm_optimal"', 'law = "pd"'))
    before = path.read_bytes()
    assert main(["tune", str(path)]) == 0
    assert 'law = "pd" does not read these weights' in capsys.readouterr().out
    assert main(["tune", str(path), "--write"]) == 2
    assert "left as it was" in capsys.readouterr().err
    assert path.read_bytes() == before


def test_the_constrained_law_gets_the_weights_in_its_own_table(tmp_path):
    path = gantry_with(tmp_path, ('law = "norm_optimal"', 'law = "constrained"'))
    found = propose_weights(path)
    assert found.section == "learning.constrained"
    found.write(path)
    table = tomlkit.parse(path.read_text(encoding="utf-8"))["learning"]["constrained"]
    assert table["rate"] == found.weights.rate
    Cell.load(path)


def test_more_input_than_is_allowed_names_the_key(tmp_path):
    path = gantry_with(tmp_path, ("input_max_m = 0.005", "input_max_m = 0.0005"))
    notes = propose_weights(path).notes
    assert any("raise input_max_m" in note for note in notes)


def test_ilc_tune_prints_writes_and_tells_everything(tmp_path, capsys):
    path, file = copied(tmp_path, GANTRY), tmp_path / "figures.json"
    arguments = ["tune", str(path), "--uncertainty", "0.3", "--noise-m", "1e-6"]
    assert main([*arguments, "--json", str(file)]) == 0
    text = capsys.readouterr().out
    assert path.read_bytes() == GANTRY.read_bytes(), "nothing is written unless it is asked for"
    figures = json.loads(file.read_text(encoding="utf-8"))
    assert f"rate = {figures['rate']}" in text
    assert figures["known_hz"] == pytest.approx({"x": 19.5, "y": 19.5})
    assert all(trial["growth"] <= 1.2 for trial in figures["trials"])
    assert main([*arguments, "--write"]) == 0
    assert f"written: {path}" in capsys.readouterr().out
    assert tomlkit.parse(path.read_text(encoding="utf-8"))["learning"]["norm_optimal"][
        "rate"
    ] == pytest.approx(figures["rate"])
    assert main([*arguments, "--write"]) == 0
    assert "has these weights already" in capsys.readouterr().out
    assert main(["tune", str(path), "--noise-m", "-1"]) == 2
    assert "noise_m = -1.0" in capsys.readouterr().err


def test_writing_changes_nothing_but_the_numbers(tmp_path):
    path = copied(tmp_path, GANTRY)
    path.chmod(0o640)
    before = path.read_text(encoding="utf-8").splitlines()
    write_values(path, {"learning.norm_optimal": {"q": 1.0, "rate": 7.5}})
    after = path.read_text(encoding="utf-8").splitlines()
    changed = [pair for pair in zip(before, after, strict=True) if pair[0] != pair[1]]
    assert len(changed) == 1
    assert changed[0][1].startswith("rate = 7.5 ")
    assert changed[0][1].endswith("# d * cycle = 12 ms")
    assert path.stat().st_mode & 0o777 == 0o640
    assert [entry.name for entry in tmp_path.iterdir() if entry.name.startswith(".")] == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a = 1\n", "a = 1\n\n[t]\n\n[t.u]\nrate = 2.0\n"),
        ("[t]\nu = { rate = 1 } # c\n", "[t]\nu = { rate = 2.0 } # c\n"),
        ("t.u.rate = 1 # c\n", "t.u.rate = 2.0 # c\n"),
        ("[t.u]\r\nrate = 1 # c\r\n", "[t.u]\r\nrate = 2.0 # c\r\n"),
        ("[t.u]\n# why\nrate = 2 # c\n", "[t.u]\n# why\nrate = 2 # c\n"),
        ("[t.u]\nq = 1\n[[t.u.phase]]\nq = 2\n", None),
    ],
)
def test_every_spelling_of_a_table_is_kept(text, expected):
    found = changed_text(text, "t.u", {"rate": 2.0}, "cell.toml")
    assert tomlkit.parse(found).unwrap()["t"]["u"]["rate"] == 2.0
    if expected is None:
        assert tomlkit.parse(found).unwrap()["t"]["u"]["phase"] == [{"q": 2}]
    elif "a = 1" not in text:
        assert found == expected


def test_a_mark_at_the_beginning_and_a_link_are_kept(tmp_path):
    path, link = copied(tmp_path, GANTRY), tmp_path / "link.toml"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    link.symlink_to(path)
    assert write_values(link, {"learning.norm_optimal": {"rate": 7.5}})
    assert link.is_symlink()
    assert path.read_bytes().startswith(b"\xef\xbb\xbf")


def test_what_the_controller_would_refuse_is_not_written(tmp_path):
    path = copied(tmp_path, GANTRY)
    with pytest.raises(BadInputError, match=r"left as it was.*rate"):
        write_values(path, {"learning.norm_optimal": {"rate": -1.0}})
    assert path.read_bytes() == GANTRY.read_bytes()
    assert len(list(tmp_path.glob(".*"))) == 0
    broken = tmp_path / "broken.toml"
    broken.write_text("[learning\n", encoding="utf-8")
    assert main(["tune", str(broken), "--write"]) == 2
    assert broken.read_text(encoding="utf-8") == "[learning\n"


@pytest.mark.parametrize(
    "contour",
    ["contour = { weight = 10.0 }\n", "[learning.norm_optimal.contour]\nweight = 100.0\n"],
    ids=["inline", "table"],
)
def test_a_cell_with_contour_weights_learns_with_what_is_proposed(contour, tmp_path):
    path = copied(tmp_path, GANTRY)
    path.write_text(path.read_text(encoding="utf-8") + contour, encoding="utf-8")
    found = propose_weights(path)
    assert found.along is not None
    assert found.write(path)
    assert propose_weights(path).along is None, "it has what it needs"
    assert_learns(path, tmp_path, 0.2)


def test_contour_weights_as_the_manual_says_learn_nearly_as_well(tmp_path):
    # docs/cell.md: rate times the root of q + weight, along so that across weighs 1.5 times more.
    weight = 10.0
    along, rate = (1.0 + weight) / 1.5 - 1.0, 6.0 * (1.0 + weight) ** 0.5
    path = copied(tmp_path, GANTRY)
    plain, _ = learn(path, tmp_path / "plain.db")
    text = path.read_text(encoding="utf-8").replace("rate = 6.0", f"rate = {rate}")
    text += f"contour = {{ weight = {weight}, along = {along} }}\n"
    path.write_text(text, encoding="utf-8")
    weighed, _ = learn(path, tmp_path / "weighed.db")
    assert weighed[7] < 0.1 * weighed[0]
    assert weighed[-1] < 1.5 * plain[-1]


def test_a_trial_stops_when_its_error_grows():
    (_, axis), _ = believed_axes(Cell.load(GANTRY))
    bench = Bench(axis, 0.3, 19.5, 0.0, 10)
    assert bench.try_weights(Weights(1.0, 0.0, 0.0, 0.5), 1.2) is None
    trials = bench.try_weights(Weights(1.0, 0.0, 0.0, 20.0), 1.2)
    assert [trial.what for trial in trials][-1] == "as its model"
    assert all(trial.rms[-1] < trial.rms[0] for trial in trials)
