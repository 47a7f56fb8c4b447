"""The wheel is self-sufficient: the package, both programs, no toolchain."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from ports_fixture import free_bus

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = ("ilc-rt", "ilc-sim")
LARGEST_WHEEL_BYTES = 25_000_000


@pytest.fixture(scope="module")
def wheel() -> Path:
    """Return the wheel that `make build` made."""
    wheels = sorted((ROOT / "build" / "wheels").glob("ilc_rt-*.whl"))
    assert len(wheels) == 1, "one wheel in build/wheels, from `make build`"
    return wheels[0]


def binaries(wheel: Path) -> dict[str, bytes]:
    """Return the compiled files of the wheel by name."""
    with zipfile.ZipFile(wheel) as archive:
        return {
            Path(name).name: archive.read(name)
            for name in archive.namelist()
            if name.endswith(".so") or ".data/scripts/" in name
        }


def test_both_programs_are_in_the_wheel(wheel: Path) -> None:
    """Executable, as pip installs them beside Python."""
    with zipfile.ZipFile(wheel) as archive:
        scripts = {
            Path(entry.filename).name: entry.external_attr >> 16
            for entry in archive.infolist()
            if ".data/scripts/" in entry.filename
        }
    assert sorted(scripts) == sorted(PROGRAMS)
    assert all(mode & 0o111 == 0o111 for mode in scripts.values())


def test_the_papers_are_a_wheel_of_their_own(wheel: Path) -> None:
    """The library's wheel does not contain them."""
    with zipfile.ZipFile(wheel) as archive:
        folders = {name.split("/")[0] for name in archive.namelist()}
    assert "ilc_papers" not in folders
    (papers,) = wheel.parent.glob("ilc_papers-*.whl")
    with zipfile.ZipFile(papers) as archive:
        assert "ilc_papers/haas2016/bench.toml" in archive.namelist()


def test_the_wheel_is_small_and_stripped(wheel: Path) -> None:
    """No symbol table, no debug information."""
    assert wheel.stat().st_size <= LARGEST_WHEEL_BYTES
    for name, content in binaries(wheel).items():
        assert content.startswith(b"\x7fELF"), name
        assert b".symtab\0" not in content, name
        assert b".debug_info\0" not in content, name


def test_the_tag_names_the_c_library_that_is_needed(wheel: Path) -> None:
    """No compiled file needs a newer one than the wheel's tag says."""
    tags = re.findall(r"manylinux_2_(\d+)_", wheel.name)
    assert tags, wheel.name
    promised = min(int(minor) for minor in tags)
    for name, content in binaries(wheel).items():
        needed = max(int(minor) for minor in re.findall(rb"GLIBC_2\.(\d+)", content))
        assert needed <= promised, f"{name} needs glibc 2.{needed}"


def test_an_empty_environment_needs_nothing_but_the_wheel(wheel: Path, tmp_path: Path) -> None:
    """`ilc demo` in a new environment, over UDP, without toolchain or checkout."""
    home = tmp_path / "environment"
    venv.create(home, with_pip=False, symlinks=True)
    subprocess.run(
        [sys.executable, "-m", "pip", "--python", str(home / "bin" / "python"), "install",
         "--quiet", "--no-deps", "--no-index", "--disable-pip-version-check", str(wheel)],
        check=True, timeout=110,
    )  # fmt: skip
    # The wheel's dependencies come from here, after the environment's own packages, so that no
    # network is needed.
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    site = home / "lib" / version / "site-packages"
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    bare = {"PATH": f"{home / 'bin'}:/usr/bin:/bin", "HOME": str(tmp_path), "LC_ALL": "C.UTF-8"}
    if "MPLCONFIGDIR" in os.environ:
        bare["MPLCONFIGDIR"] = os.environ["MPLCONFIGDIR"]

    where = subprocess.run(
        [home / "bin" / "python", "-c",
         "import ilc_rt; from ilc_rt.processes import find_program as find;"
         "print(ilc_rt.__file__, find('ilc-rt'), find('ilc-sim'), sep='\\n')"],
        cwd=tmp_path, env=bare, capture_output=True, text=True, check=True, timeout=60,
    ).stdout.split()  # fmt: skip
    assert all(Path(path).is_relative_to(home) for path in where), where

    bus = free_bus()
    demo = subprocess.run(
        [home / "bin" / "ilc", "demo", "--iterations", "2", "--lockstep", "--bus", bus],
        cwd=tmp_path, env=bare, capture_output=True, text=True, check=False, timeout=110,
    )  # fmt: skip
    assert demo.returncode == 0, demo.stdout + demo.stderr
    assert (tmp_path / "ilc-report.html").stat().st_size > 10_000
