"""Sweeps: the same results on every executor, kept and resumed, and failures named."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from ports_fixture import free_port
from sweep_fixture import cluster, drawn, failing, learned

from ilc_rt import BadInputError, SweepError, SweepResult, grid, latin_hypercube, sweep

pytestmark = pytest.mark.xdist_group("sweep")

CASES = grid(natural_rad_s=[60.0, 90.0, 120.0], kp=[0.3, 0.6])


@pytest.fixture(scope="module")
def serial() -> SweepResult:
    return sweep(learned, CASES, seed=9)


def test_results_are_arrays_in_the_order_of_the_cases(serial: SweepResult) -> None:
    arrays = serial.arrays()
    np.testing.assert_array_equal(arrays["kp"], [0.3, 0.6] * 3)
    assert arrays["rms_m"].shape == (6, 5)
    np.testing.assert_array_equal(arrays["last_m"], arrays["rms_m"][:, -1])
    assert arrays["law"].tolist() == ["pd"] * 6
    assert len(serial) == 6
    assert "natural_rad_s" in serial._repr_html_()
    assert repr(serial).startswith("SweepResult(6 cases: natural_rad_s, kp, last_m")


def test_threads_and_processes_give_the_same_bits(serial: SweepResult) -> None:
    with ThreadPoolExecutor(3) as pool:
        assert sweep(learned, CASES, pool, seed=9).digest == serial.digest
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert sweep(learned, CASES, pool, seed=9).digest == serial.digest
    assert sweep(learned, CASES, seed=10).digest != serial.digest


@pytest.mark.filterwarnings("ignore")
@pytest.mark.timeout(300)
def test_a_cluster_of_dask_gives_the_same_bits(serial: SweepResult, tmp_path: Path, ilc) -> None:
    """A scheduler and two workers in processes of their own; also by `ilc sweep`."""
    distributed = pytest.importorskip("distributed")
    gantry = Path(__file__).parents[2] / "examples" / "01_gantry.toml"
    vary = ["--vary", "axis.y.simulation.mass_kg=15:25", "--samples", "3", "--iterations", "3"]
    with cluster(free_port(socket.SOCK_STREAM), tmp_path) as address:
        with distributed.Client(address, timeout="60s") as client:
            client.wait_for_workers(2, timeout=120)
            # The workers cannot import this folder.
            client.upload_file(str(Path(__file__).with_name("sweep_fixture.py")))
            with client.get_executor() as executor:
                assert sweep(learned, CASES, executor, seed=9).digest == serial.digest
        for number, where in enumerate((f"dask:{address}", "serial")):
            done = ilc(
                "sweep", gantry, *vary, "--executor", where, "--json", f"{number}.json",
                timeout_s=200.0,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
    assert (tmp_path / "0.json").read_bytes() == (tmp_path / "1.json").read_bytes()


def test_each_case_has_random_numbers_of_its_own() -> None:
    cases = grid(scale=[1.0] * 50)
    values = sweep(drawn, cases, seed=1).arrays()["value"]
    assert len(set(values)) == 50
    # The number of a case decides, not how many there are.
    np.testing.assert_array_equal(sweep(drawn, cases[:7], seed=1).arrays()["value"], values[:7])


def test_a_sweep_resumes_from_its_file_bit_for_bit(serial: SweepResult, tmp_path: Path) -> None:
    file = tmp_path / "sweep.jsonl"
    sweep(learned, CASES, seed=9, file=file)
    lines = file.read_text().splitlines(keepends=True)
    # As after a kill in the middle of the fourth result.
    file.write_text("".join(lines[:4]) + lines[4][:17])
    calls: list[tuple[int, int]] = []
    resumed = sweep(learned, CASES, seed=9, file=file, progress=lambda *n: calls.append(n))
    assert resumed.digest == serial.digest
    assert calls == [(4, 6), (5, 6), (6, 6)]
    assert len(file.read_text().splitlines()) == 7
    assert sweep(learned, CASES, seed=9, file=file).digest == serial.digest


def test_a_killed_sweep_resumes(serial: SweepResult, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import os, signal\nfrom sweep_fixture import learned\nfrom ilc_rt import grid, sweep\n"
        "cases = grid(natural_rad_s=[60.0, 90.0, 120.0], kp=[0.3, 0.6])\n"
        "kill = lambda n, _: n == 3 and os.kill(os.getpid(), signal.SIGKILL)\n"
        "sweep(learned, cases, seed=9, file='sweep.jsonl', progress=kill)\n"
    )
    here = str(Path(__file__).parent)
    done = subprocess.run(
        [sys.executable, str(script), here], cwd=tmp_path, check=False, timeout=100
    )
    assert done.returncode == -signal.SIGKILL
    assert len((tmp_path / "sweep.jsonl").read_text().splitlines()) == 4
    resumed = sweep(learned, CASES, seed=9, file=tmp_path / "sweep.jsonl")
    assert resumed.digest == serial.digest


def test_another_sweep_is_not_resumed(tmp_path: Path) -> None:
    file = tmp_path / "sweep.jsonl"
    sweep(drawn, grid(scale=[1.0, 2.0]), seed=1, file=file)
    for cases, seed in ((grid(scale=[1.0, 3.0]), 1), (grid(scale=[1.0, 2.0]), 2)):
        with pytest.raises(BadInputError, match="of another sweep"):
            sweep(drawn, cases, seed=seed, file=file)
    file.write_text('{"a": 1}\n')
    with pytest.raises(BadInputError, match="not the file of a sweep"):
        sweep(drawn, grid(scale=[1.0]), file=file)
    with pytest.raises(BadInputError, match="cannot be used"):
        sweep(drawn, grid(scale=[1.0]), file=tmp_path / "no" / "folder")


def test_a_failing_case_is_named_and_what_is_done_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "sweep.jsonl"
    with pytest.raises(SweepError, match=r"case 3 \(number = 3\): ValueError: no such plant"):
        sweep(failing, grid(number=range(6)), file=file)
    assert [json.loads(line).get("case") for line in file.read_text().splitlines()[1:]] == [0, 1, 2]
    with ThreadPoolExecutor(2) as pool, pytest.raises(SweepError, match="case 3"):
        sweep(failing, grid(number=range(6)), pool)


@pytest.mark.parametrize("bad", [object(), {"a": object()}, np.array(["x"]), 1j])
def test_a_result_that_cannot_be_kept_is_refused(bad: object) -> None:
    with pytest.raises(TypeError, match="cannot be kept"):
        sweep(lambda: bad, [{}])


def test_missing_and_ragged_results_have_a_column() -> None:
    answers = [{"a": 1.5}, {"a": None, "b": np.ones(2)}, {"a": np.float64(0.1), "b": np.ones(3)}]
    arrays = sweep(lambda n: answers[n], grid(n=[0, 1, 2])).arrays()
    np.testing.assert_array_equal(arrays["a"], [1.5, np.nan, 0.1])
    assert arrays["b"].dtype == object


def test_tables_and_parquet(serial: SweepResult, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    serial.to_parquet(tmp_path / "sweep.parquet")
    table = pandas.read_parquet(tmp_path / "sweep.parquet")
    np.testing.assert_array_equal(table["last_m"], serial.arrays()["last_m"])
    np.testing.assert_array_equal(np.stack(table["rms_m"]), serial.arrays()["rms_m"])
    assert list(serial.to_dataframe()["kp"]) == [0.3, 0.6] * 3


def test_a_latin_hypercube_covers_every_range_evenly() -> None:
    cases = latin_hypercube({"a": (0.0, 10.0), "b": (1.0, 1000.0, "log")}, 10, seed=4)
    assert sorted(int(case["a"]) for case in cases) == list(range(10))
    assert sorted(int(np.log10(case["b"]) / 0.3) for case in cases) == list(range(10))
    for ranges, words in (
        ({"a": (1.0, 1.0)}, "a: from 1.0 to 1.0"),
        ({"a": (0.0, 1.0, "log")}, "not a range of this scale"),
        ({"a": (0.0, 1.0, "cubic")}, "the scale is 'cubic'"),
    ):
        with pytest.raises(ValueError, match=words):
            latin_hypercube(ranges, 3)


def test_nothing_is_left_of_an_interrupted_sweep(tmp_path: Path) -> None:
    """Ctrl-C after the second case of a pool: no further case begins, and the file resumes."""
    file = tmp_path / "sweep.jsonl"

    def stop(done: int, _: int) -> None:
        if done == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with ThreadPoolExecutor(1) as pool, pytest.raises(KeyboardInterrupt):
        sweep(drawn, grid(scale=[1.0] * 200), pool, file=file, progress=stop)
    assert len(file.read_text().splitlines()) == 3
    resumed = sweep(drawn, grid(scale=[1.0] * 200), file=file)
    assert resumed.digest == sweep(drawn, grid(scale=[1.0] * 200)).digest
