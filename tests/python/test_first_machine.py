"""The page of the first machine, line by line, on drives with the habits of real ones."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import time
from typing import TYPE_CHECKING

import pytest
from documentation_fixture import PAGE_OF_ITS_OWN as PAGE
from documentation_fixture import Block, blocks
from ports_fixture import free_bus
from processes_fixture import DEADLINE_S, Process, program

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.timeout(600)

#: The machine of the page: what its drives and its mechanics are, which no cell of it says.
MACHINE = {
    "x": "mass_kg = 150.0\nnatural_frequency_hz = 15.0\ndamping = 1.0\ncoulomb_n = 60.0\n"
    "static_n = 100.0\nposition_start_m = 0.04",
    "y": "mass_kg = 20.0\nnatural_frequency_hz = 15.0\ndamping = 0.6\ncoulomb_n = 15.0\n"
    "static_n = 25.0\nposition_start_m = 0.03",
}
QUIRKS = """
[axis.simulation.quirks]
quick_stop_option = 2
keeps_mode_under_halt = true
statusword_on_event = true
lacks_torque_offset = true
lacks_torque = true
lacks_following_error = true
lacks_following_error_time = true
lacks_emergencies = true
"""
#: Verbs that run the loop, here paced by the drives.
LOOP = re.compile(r"^ilc-rt (enable|jog|goto|home|identify|run) ")
#: Verbs that have an option for the bus.
ON_BUS = re.compile(r"^ilc-rt (status|reset|enable|jog|goto|home|identify|run) ")


def into_axis(text: str, axis: str, section: str) -> str:
    """Return the cell with a section at the end of one of its axes."""
    head, rest = text.split(f'name = "{axis}"', 1)
    end = re.search(r"^(\[\[axis\]\]|\[program\])", rest, re.MULTILINE)
    assert end is not None
    return f'{head}name = "{axis}"{rest[: end.start()]}{section}\n\n{rest[end.start() :]}'


class Reader:
    """Follows the page in a folder, on a bus of this host."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.bus = free_bus()
        self.production: Process | None = None
        self.output: dict[str, str] = {}
        self.environment = {
            **os.environ,
            "PATH": f"{program('ilc-rt').parent}:{os.environ['PATH']}",
            "XDG_RUNTIME_DIR": str(folder),
        }

    def write(self, block: Block) -> None:
        """Write a file that the page shows; its first line has the name."""
        name = block.text.splitlines()[0].removeprefix("# ")
        (self.folder / name).write_text(block.text + "\n", encoding="utf-8")

    def type(self, line: str) -> None:
        """Type a line of the page."""
        text = re.sub(r"\s+#.*", "", line).replace("can:can0", self.bus)
        text = text.replace("--seconds 10", "--seconds 1")
        text, in_background = re.subn(r" &$", "", text)
        if ON_BUS.match(text):
            text += f" --bus {self.bus}"
        if LOOP.match(text):
            text += " --lockstep"
        if re.match(r"ilc-rt run ", text):
            text += " --no-telemetry"
        if in_background:
            argv = [program("ilc-rt"), *shlex.split(text)[1:]]
            self.production = Process(["env", f"XDG_RUNTIME_DIR={self.folder}", *argv], self.folder)
            self.production.line_with("control: ")
            return
        self.output[line] = self.run(text)
        if text.startswith("ilc-rt identify"):
            self.paste(re.sub(r".*--axis (\S+).*", r"\1", line))

    def run(self, text: str) -> str:
        """Run a line, which must succeed."""
        done = subprocess.run(
            ["bash", "-c", text], cwd=self.folder, env=self.environment, capture_output=True,
            text=True, timeout=280, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def paste(self, axis: str) -> None:
        """Paste a model, as the page says."""
        section = json.loads((self.folder / f"{axis}.json").read_text())["axis_model"]
        cell = self.folder / "machine.toml"
        cell.write_text(into_axis(cell.read_text(), axis, section), encoding="utf-8")

    def position_m(self, cell: str, axis: int) -> float:
        """Return where an axis is."""
        text = self.run(f"ilc-rt status {cell} --bus {self.bus} --json -")
        return float(json.loads(text)["axes"][axis]["position_m"])

    def until_state(self, wanted: str) -> None:
        """Wait until production is in a state."""
        until = time.monotonic() + DEADLINE_S
        while wanted not in (said := self.run("ilc-rt ctl machine.toml status")):
            assert time.monotonic() < until, said
            time.sleep(0.05)


@pytest.fixture
def reader(tmp_path: Path) -> Reader:
    """Return a reader with the data sheet of the drives."""
    return Reader(tmp_path)


def page() -> list[Block]:
    """Return what the page shows, without what cannot run."""
    return [block for block in blocks(PAGE) if not block.excuse]


def machine(reader: Reader) -> Path:
    """Write the description of the machine that the drives are simulated from."""
    [text] = [block.text for block in page() if block.text.startswith("# machine.toml")]
    for axis, simulation in MACHINE.items():
        text = into_axis(text, axis, f"[axis.simulation]\n{simulation}\n{QUIRKS}")
    path = reader.folder / "drives.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_page_leads_to_a_learned_contour(reader: Reader) -> None:
    drives_cell = machine(reader)
    sheet = reader.run(f"ilc-sim eds {drives_cell} --node 1")
    (reader.folder / "servo.eds").write_text(sheet, encoding="utf-8")
    argv = [program("ilc-sim"), "run", drives_cell, "--bus", reader.bus, "--lockstep"]
    drives = Process(argv, reader.folder)
    try:
        drives.line_with("ready")
        for block in page():
            if block.language == "toml":
                reader.write(block)
                continue
            for line in filter(None, block.text.splitlines()):
                if line.startswith("ilc-rt home") and "--axis" in line:
                    # Without a home nothing moves.
                    jog = ["jog", "machine.toml", "x", "0.001", "--bus", reader.bus]
                    refused = subprocess.run(
                        [program("ilc-rt"), *jog],
                        cwd=reader.folder, capture_output=True, text=True, check=False,
                    )  # fmt: skip
                    assert refused.returncode == 2
                    assert "axis x (node 1) is not homed" in refused.stderr
                if line == "ilc-rt ctl machine.toml start":
                    # A person is not as fast as the machine is ready.
                    reader.until_state(": waiting, run 0")
                if line == "ilc-rt ctl machine.toml stop":
                    # The part is made.
                    reader.until_state(": waiting, run 1")
                reader.type(line)
                if line == "ilc-rt jog first.toml y 0.003":
                    assert reader.position_m("first.toml", 1) == pytest.approx(0.003, abs=1e-4)
                if line == "ilc-rt goto machine.toml x=0.04 y=0.03":
                    assert reader.position_m("machine.toml", 0) == pytest.approx(0.04, abs=1e-4)
        assert reader.production is not None
        assert reader.production.end() == 0, reader.production.errors
    finally:
        if reader.production is not None:
            reader.production.close()
        drives.close()
    assert "axis x: homed, at -0.0188" in reader.output["ilc-rt home machine.toml --axis x"]
    assert "axis x: was homed before" in reader.output["ilc-rt home machine.toml"]
    runs = json.loads((reader.folder / "runs.json").read_text())["iterations"]
    assert len(runs) == 10
    assert runs[-1]["contour_inf_m"] < 0.3 * runs[0]["contour_inf_m"]
