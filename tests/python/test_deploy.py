"""The Debian package, unpacked into a clean root: its files, its service, a cell that it runs."""

from __future__ import annotations

import json
import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from processes_fixture import PATIENT, Bench

from ilc_rt.processes import find_program

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]
UNIT = "usr/lib/systemd/system/ilc-rt@.service"

pytestmark = [
    pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="dpkg-deb is not installed"),
    pytest.mark.xdist_group("deploy"),
]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def output(*argv: str | Path) -> str:
    done = subprocess.run(argv, text=True, capture_output=True, check=False, timeout=60)
    assert done.returncode == 0, (argv, done.stderr)
    return done.stdout


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("package")
    programs = Path(find_program("ilc-rt")).parent
    return Path(output(ROOT / "packaging" / "deb", programs, out).strip())


@pytest.fixture(scope="module")
def unpacked(package, tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("root")
    output("dpkg-deb", "-x", package, root)
    return root


def test_the_package_has_both_programs_and_nothing_that_starts(package, unpacked):
    fields = output("dpkg-deb", "--field", package, "Package", "Version", "Depends")
    version = output(find_program("ilc-rt"), "--version").split()[1]
    assert f"Package: ilc-rt\nVersion: {version}\n" in fields
    for name in ("ilc-rt", "ilc-sim"):
        assert output(unpacked / "usr" / "bin" / name, "--version").split() == [name, version]
    listed = output("dpkg-deb", "-c", package).splitlines()
    assert all(line.split()[1] == "root/root" for line in listed)
    assert listed[0].startswith("drwxr-xr-x")
    # The maintainer's scripts create a user and stop cells; they never start one.
    scripts = "".join(path.read_text() for path in (ROOT / "packaging" / "debian").iterdir())
    assert "start" not in scripts.replace("Nothing is started", "")
    for name in ("postinst", "prerm"):
        output("sh", "-n", ROOT / "packaging" / "debian" / name)


def test_systemd_reads_the_service_without_a_complaint(unpacked):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    folder = unpacked / "usr" / "lib" / "systemd" / "system"
    for name in ("sysinit", "shutdown", "basic", "multi-user", "network"):
        (folder / f"{name}.target").write_text(f"[Unit]\nDescription={name}\n")
    (folder / "system.slice").write_text("[Unit]\nDescription=slice\n[Slice]\n")
    verified = subprocess.run(
        ["systemd-analyze", "verify", f"--root={unpacked}", "ilc-rt@gantry.service"],
        text=True, capture_output=True, check=False, timeout=60,
    )  # fmt: skip
    assert (verified.returncode, verified.stderr) == (0, "")


def test_the_command_of_the_service_waits_for_its_start_or_says_what_is_missing(
    unpacked: Path, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = bench.cell(short=True, more=PATIENT, name="etc.toml")
    etc = unpacked / "etc" / "ilc-rt" / "gantry.toml"
    etc.write_bytes(cell.read_bytes())
    (unpacked / "var" / "lib" / "ilc-rt").mkdir(parents=True)
    runtime = unpacked / "run"
    runtime.mkdir(mode=0o700)
    settings = dict(
        line.split("=", 1)
        for line in (unpacked / UNIT).read_text().splitlines()
        if "=" in line and not line.startswith("#")
    )
    words = shlex.split(settings["ExecStart"].replace("%i", "gantry"))
    assert words.pop() == "$ILC_RT_OPTIONS"
    argv = [word if not word.startswith("/") else str(unpacked / word[1:]) for word in words]
    bench.drives(cell, bus=bench.bus)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    service = bench.start(*argv, "--bus", bench.bus, "--no-telemetry")
    doctor = subprocess.run([argv[0], "doctor", "--json", "-"], text=True, capture_output=True,
                            check=False, timeout=60)  # fmt: skip
    rights = {one["what"]: one["verdict"] for one in json.loads(doctor.stdout)["findings"]}
    if "poor" in (rights["priority"], rights["memory"]):
        assert service.end() == 2
        assert service.errors[0].startswith("ilc-rt: --require-rt: ")
        return
    service.line_with("control: ")
    until = time.monotonic() + 60.0
    while "waiting" not in (told := output(argv[0], "ctl", etc, "status")):
        assert time.monotonic() < until, (told, service.errors)
        time.sleep(0.1)
    service.signal(signal.SIGTERM)
    assert service.end() == 128 + signal.SIGTERM
