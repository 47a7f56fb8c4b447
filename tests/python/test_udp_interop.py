"""Frames between python-can's ``udp_multicast`` interface and ours, in both directions.

The other side is ``bus_echo``, an example of the Rust crate, in its own process: it returns each
frame with the next identifier. ``make test-python`` builds it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import can
import pytest
from ports_fixture import GROUP, free_port

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]

STOP_ID = 0x7FF
PATIENCE_S = 20.0


@pytest.fixture(scope="module")
def bus_echo() -> Path:
    """Return the path of the echo program, in cargo's folder."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    program = ROOT / target / "release" / "examples" / "bus_echo"
    assert program.is_file(), f"{program} is not built: `make test-python` builds it"
    return program


@pytest.fixture
def port() -> int:
    """Reserve a unique UDP port."""
    return free_port()


@pytest.fixture
def bus(port: int) -> Iterator[can.BusABC]:
    """Open python-can's end; its frames stay on this host as ours do."""
    try:
        bus = can.Bus(interface="udp_multicast", channel=GROUP, port=port, hop_limit=0)
    except can.CanInitializationError as error:
        if not is_without_network(error):
            raise
        pytest.skip("python-can needs a network interface for multicast, ours does not")
    with bus:
        yield bus


@pytest.fixture
def echo(bus_echo: Path, bus: can.BusABC, port: int) -> Iterator[subprocess.Popen[str]]:
    """Start the echo program and stop it by a frame."""
    with echoing(bus_echo, bus, f"udp:{GROUP}:{port}") as process:
        yield process


@pytest.fixture
def echo_fd(bus_echo: Path, bus: can.BusABC, port: int) -> Iterator[subprocess.Popen[str]]:
    """Start the echo program on a bus with CAN FD."""
    with echoing(bus_echo, bus, f"udp:{GROUP}:{port}?fd=1") as process:
        yield process


@contextlib.contextmanager
def echoing(program: Path, bus: can.BusABC, address: str) -> Iterator[subprocess.Popen[str]]:
    """Run the echo program on a bus and stop it by a frame."""
    command = [str(program), address]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("ready")
        try:
            yield process
            bus.send(can.Message(arbitration_id=STOP_ID, is_extended_id=False))
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()


def is_without_network(error: can.CanInitializationError) -> bool:
    """Return whether the machine has no interface for multicast."""
    return isinstance(error.__cause__, OSError) and error.__cause__.errno == errno.ENODEV


def receive_answer(bus: can.BusABC) -> can.Message:
    """Return the next frame of the echo program, which has an odd identifier."""
    # python-can receives its own frames: those are even and skipped.
    while True:
        message = bus.recv(PATIENCE_S)
        assert message is not None, "the echo program did not answer"
        if message.arbitration_id % 2 == 1:
            return message


@pytest.mark.usefixtures("echo")
def test_every_length_comes_back(bus: can.BusABC) -> None:
    for length in range(9):
        data = bytes(range(0xF8, 0xF8 + length)) if length < 8 else bytes(8)
        for arbitration_id in (0x000, 0x07E, 0x080, 0x0FE, 0x100, 0x600, 0x7FC):
            sent = can.Message(arbitration_id=arbitration_id, data=data, is_extended_id=False)
            bus.send(sent)
            answer = receive_answer(bus)
            assert answer.arbitration_id == arbitration_id + 1
            assert bytes(answer.data) == data
            assert answer.dlc == length
            assert not answer.is_extended_id
            assert not answer.is_remote_frame
            assert not answer.is_error_frame
            assert not answer.is_fd


@pytest.mark.usefixtures("echo")
def test_a_burst_comes_back_in_order(bus: can.BusABC) -> None:
    numbers = range(50)
    for number in numbers:
        bus.send(can.Message(arbitration_id=0x200, data=[number], is_extended_id=False))
    assert [receive_answer(bus).data[0] for _ in numbers] == list(numbers)


@pytest.mark.usefixtures("echo")
@pytest.mark.parametrize(
    "foreign",
    [
        can.Message(arbitration_id=0x100, data=[1], is_extended_id=True),
        can.Message(arbitration_id=0x100, dlc=1, is_remote_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x100, data=[1], is_error_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x100, data=[1], is_fd=True, is_extended_id=False),
        can.Message(arbitration_id=0x100, data=bytes(64), is_fd=True, is_extended_id=False),
    ],
    ids=["extended", "remote", "error", "fd", "long fd"],
)
def test_other_kinds_of_frames_are_passed_over(bus: can.BusABC, foreign: can.Message) -> None:
    bus.send(foreign)
    bus.send(can.Message(arbitration_id=0x200, data=[2], is_extended_id=False))
    # An answer to the foreign frame would arrive first.
    assert receive_answer(bus).arbitration_id == 0x201


@pytest.mark.usefixtures("echo_fd")
def test_every_length_of_can_fd_comes_back(bus: can.BusABC) -> None:
    for length in (*range(9), 12, 16, 20, 24, 32, 48, 64):
        data = bytes((7 * n) % 256 for n in range(length))
        sent = can.Message(
            arbitration_id=0x200, data=data, is_extended_id=False, is_fd=True, bitrate_switch=True
        )
        bus.send(sent)
        answer = receive_answer(bus)
        assert (answer.arbitration_id, bytes(answer.data), answer.dlc) == (0x201, data, length)
        assert answer.is_fd
        assert answer.bitrate_switch
        assert not answer.error_state_indicator
    # Classical frames are understood on such a bus, and answered in its format.
    bus.send(can.Message(arbitration_id=0x200, data=[2], is_extended_id=False))
    answer = receive_answer(bus)
    assert (bytes(answer.data), answer.is_fd) == (b"\x02", True)


def test_a_wrong_address_is_one_clear_line(bus_echo: Path) -> None:
    run = subprocess.run(
        [bus_echo, "udp:192.168.0.1"],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "192.168.0.1" in run.stderr
    assert "224.0.0.0 to 239.255.255.255" in run.stderr
