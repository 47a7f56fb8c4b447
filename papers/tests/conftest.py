"""`ilc` as a process, for the tests of its verb `reproduce`."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@pytest.fixture
def ilc(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return a function that runs `ilc` as a process in an empty folder."""

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "ilc_rt.cli", *arguments],
            cwd=tmp_path, capture_output=True, text=True, timeout=120.0, check=False,
            env={**os.environ, "COLUMNS": "120"},
        )  # fmt: skip

    return run
