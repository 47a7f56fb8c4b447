"""Campaigns in this process: their results, laws, faults and options."""

from __future__ import annotations

import dataclasses
import signal
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ports_fixture import free_bus

from ilc_rt import (
    BadInputError,
    Campaign,
    CampaignError,
    CampaignResult,
    FaultError,
)
from ilc_rt.events import (
    LastCycles,
    StateEvent,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Install = Callable[[str, str], None]


def test_a_run_in_this_process_learns_and_keeps_every_run(finished: CampaignResult) -> None:
    """The real controller: errors fall, arrays have the right shapes, figures match arrays."""
    first, last = finished.records[0], finished.records[-1]
    assert [record.index for record in finished.records] == [0, 1, 2]
    assert last.tracking_rms_m < 0.5 * first.tracking_rms_m
    shape = (finished.n_samples, finished.n_axes)
    assert first.reference_m.shape == first.input.shape == first.encoder_m.shape == shape
    assert not first.input.any()
    assert last.input.any()
    assert first.tool_m is not None
    np.testing.assert_array_equal(first.error_m, first.reference_m - first.tool_m)
    assert np.abs(last.error_m).max() == last.tracking_inf_m
    assert finished.status == "completed"
    assert finished.mode == "lockstep"
    assert finished.latency is None


def test_two_lockstep_campaigns_are_the_same_bit_by_bit(gantry: Path, tmp_path: Path) -> None:
    """No wall clock: equal digests."""
    digests = []
    for name in ("a.db", "b.db"):
        campaign = Campaign(gantry, library=tmp_path / name, bus="loopback:")
        digests.append([record.digest for record in campaign.run(2)])
    assert digests[0] == digests[1]
    assert len(set(digests[0])) == 2


def test_records_are_frozen(finished: CampaignResult) -> None:
    """A record of the past cannot be changed by accident."""
    with pytest.raises(dataclasses.FrozenInstanceError):
        finished.records[0].index = 5  # type: ignore[misc]


def test_a_law_written_in_python_is_asked_between_the_runs(gantry: Path, tmp_path: Path) -> None:
    """It receives input and error of the previous run, and its result is applied."""

    class Constant:
        def __init__(self) -> None:
            self.asked: list[tuple[int, ...]] = []

        def update(self, u: np.ndarray, e: np.ndarray, disturbance: object = None) -> np.ndarray:
            del e, disturbance
            self.asked.append(u.shape)
            return np.full_like(u, 1e-5)

    law = Constant()
    campaign = Campaign(gantry, law=law, library=tmp_path / "l.db", bus="loopback:")
    records = list(campaign.run(2))
    assert law.asked
    assert set(law.asked) == {records[0].reference_m.shape}
    np.testing.assert_allclose(records[1].input, 1e-5)


def test_a_late_law_costs_a_run_and_is_counted(gantry: Path, tmp_path: Path) -> None:
    """In real time the loop does not wait for a late law: it repeats the old input."""
    program, first, *_ = gantry.read_text().split("[[program.segment]]")
    learning = gantry.read_text().partition("[learning]")
    cell = tmp_path / "short.toml"
    cell.write_text("[[program.segment]]".join([program, first]) + "".join(learning[1:]))

    class Slow:
        def __init__(self) -> None:
            self.may_answer = threading.Event()

        def update(self, u: np.ndarray, e: np.ndarray, disturbance: object = None) -> np.ndarray:
            del e, disturbance
            assert self.may_answer.wait(30.0)
            return np.full_like(u, 1e-5)

    law = Slow()
    campaign = Campaign(cell, law=law, library=tmp_path / "l.db", bus=free_bus(), lockstep=False)
    for event in campaign.events(3):
        if isinstance(event, StateEvent) and (event.state, event.iteration) == ("running", 1):
            law.may_answer.set()
    records = campaign.result.records
    assert [record.late_updates for record in records] == [0, 1, 1]
    np.testing.assert_array_equal(records[1].input, 0.0)
    np.testing.assert_allclose(records[2].input, 1e-5)


def test_a_law_that_fails_is_a_fault_that_names_it(gantry: Path, tmp_path: Path) -> None:
    """The axes are stopped; the error names the law and the reason; the previous run is kept."""

    class Broken:
        def update(self, u: np.ndarray, e: np.ndarray, disturbance: object = None) -> np.ndarray:
            del u, e, disturbance
            message = "I divide by zero"
            raise ArithmeticError(message)

    campaign = Campaign(gantry, law=Broken(), library=tmp_path / "l.db", bus="loopback:")
    with pytest.raises(CampaignError, match="I divide by zero") as caught:
        list(campaign.run(3))
    assert caught.value.exit_code == 3
    assert "Broken" in str(caught.value)
    assert len(campaign.result.records) == 1


def test_ctrl_c_in_this_process_is_a_controlled_stop(gantry: Path, tmp_path: Path) -> None:
    """The controller stops, then the exception is raised; the runs are kept."""
    campaign = Campaign(gantry, library=tmp_path / "l.db", bus="loopback:")
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        for record in campaign.run(500):
            if record.index == 1:
                signal.raise_signal(signal.SIGINT)
    assert campaign.result.status == "interrupted"
    kept = CampaignResult.from_library(tmp_path / "l.db")
    assert 2 <= len(kept.records) < 500


def test_a_campaign_that_was_left_goes_on_with_what_it_had_learned(
    gantry: Path, tmp_path: Path
) -> None:
    """The next input is bit-identical to that without the break; the result has all runs."""
    whole = Campaign(gantry, library=tmp_path / "whole.db", bus="loopback:")
    expected = list(whole.run(6))
    for record in Campaign(gantry, library=tmp_path / "cut.db", bus="loopback:").run(4):
        if record.index == 1:
            break
    kept = len(CampaignResult.from_library(tmp_path / "cut.db").records)
    rest = Campaign(gantry, library=tmp_path / "cut.db", bus="loopback:", resume=True)
    resumed = list(rest.run(6))
    assert [record.index for record in resumed] == list(range(kept, 6))
    assert [record.index for record in rest.result.records] == list(range(6))
    np.testing.assert_array_equal(resumed[0].input, expected[kept].input)
    assert resumed[0].input.any()


def test_a_campaign_is_found_again_in_the_library(finished: CampaignResult) -> None:
    """The events and the library agree."""
    again = CampaignResult.from_library(finished.library)
    assert again.campaign == finished.campaign
    assert again.records == finished.records
    assert again.sentence() == finished.sentence()
    assert CampaignResult.from_library(finished.library, again.campaign[:-1]).records
    with pytest.raises(BadInputError, match="no campaign 'nix'"):
        CampaignResult.from_library(finished.library, "nix")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"bus": "foo"}, "bus = foo: allowed can:INTERFACE"),
        ({"bus": "usb:0"}, "bus = usb:0"),
        ({"law": "norm_optimal"}, "law = 'norm_optimal': an object with update"),
        ({"drives": "real"}, "drives = real"),
        ({"bus": "loopback:", "drives": "external"}, "loopback: has no outside"),
        ({"library": "/no/such/folder/l.db"}, "no such folder"),
    ],
)
def test_bad_options_are_refused_with_what_is_allowed(
    gantry: Path, options: dict[str, str], said: str
) -> None:
    """Before anything is started."""
    with pytest.raises(BadInputError, match=said):
        Campaign(gantry, **options)  # type: ignore[arg-type]


def test_a_real_bus_never_gets_simulated_drives_by_itself(gantry: Path) -> None:
    """`auto` simulates on every bus but CAN."""
    assert Campaign(gantry, bus="udp:239.74.163.2").simulated
    assert Campaign(gantry, bus="zenoh:ilc/bus").simulated
    assert not Campaign(gantry, bus="can:can0").simulated
    assert Campaign(gantry, bus="can:vcan0", drives="simulated").simulated


def test_no_runs_are_refused(gantry: Path, tmp_path: Path) -> None:
    """Zero runs is no campaign."""
    with pytest.raises(BadInputError, match="--iterations"):
        list(Campaign(gantry, library=tmp_path / "l.db").run(0))


def test_a_fault_is_an_exception_with_its_fields(gantry: Path, tmp_path: Path) -> None:
    """Kind, axis, node, numbers and the last cycles, beside the sentence."""
    text = gantry.read_text().replace(
        "following_error_max_m = 0.01", "following_error_max_m = 1e-4"
    )
    cell = tmp_path / "tight.toml"
    cell.write_text(text)
    campaign = Campaign(cell, bus="loopback:", library=tmp_path / "l.db")
    with pytest.raises(FaultError) as caught:
        list(campaign.run(2))
    fault = caught.value
    assert fault.kind in {"following_error", "drive_fault"}
    assert (fault.axis, fault.node) in {("x", 1), ("y", 2)}
    assert fault.axis in str(fault)
    assert str(fault.node) in str(fault)
    assert (fault.limit, fault.unit, fault.exit_code) == (1e-4, "m", 3)
    assert fault.value is not None
    assert abs(fault.value) > 1e-5
    cycles = fault.cycles
    assert isinstance(cycles, LastCycles)
    assert 0 < len(cycles.encoder_m) == len(cycles.missing) <= 32
    assert {len(row) for row in cycles.reference_m} == {2}
    assert campaign.result.fault is not None
    assert not campaign.result.unkept
