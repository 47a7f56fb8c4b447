"""Shared fixtures: the cell, a finished campaign, stand-ins for programs."""

from __future__ import annotations

import gc
import os
import signal
import stat
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings
from warm_fixture import Warm, ilc, warm  # noqa: F401, they are fixtures

from ilc_rt import Campaign, controllers, processes

if TYPE_CHECKING:
    from collections.abc import Callable

    from ilc_rt import CampaignResult

ROOT = Path(__file__).resolve().parents[2]
GANTRY = ROOT / "examples" / "01_gantry.toml"

# A change is judged by fixed problems: every run draws the same examples. `make fuzz` sets another
# seed (also for Hypothesis); a failing case becomes an `@example` of the test.
settings.register_profile("fixed", derandomize=True, database=None, deadline=None)
settings.register_profile("fuzz", deadline=None, database=None, print_blob=True)
settings.load_profile("fuzz" if "ILC_FUZZ_SEED" in os.environ else "fixed")


# Thousands of tests, and all that they import, stay until the end: no search for garbage finds any.
gc.disable()

# The workers and hundreds of processes share the processors: threads of NumPy's library only cost.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Restore the signal handlers that a background job or nohup inherits as ignored."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    if session.config.getoption("numprocesses", None):
        # This process collects no tests.
        gc.enable()
        # The workers share one, whose start takes as long as that of four commands.
        server = Warm()
        os.environ[Warm.VARIABLE] = server.socket
        session.config.add_cleanup(server.close)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Refuse to share costly fixtures out among the workers: each would make its own."""
    # From now on there is garbage, but not among what is there already.
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    gc.enable()
    if not getattr(session.config.option, "loadgroup", False):
        return
    for item in session.items:
        if item.get_closest_marker("xdist_group") and "@" not in item.nodeid:
            message = f"pytest-xdist does not group tests with pytest {pytest.__version__}"
            raise pytest.UsageError(message)


@pytest.fixture(scope="session")
def gantry() -> Path:
    """Return the path of the example cell."""
    return GANTRY


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> CampaignResult:
    """Return a campaign of three runs by the real controller, in lock-step."""
    library = tmp_path_factory.mktemp("finished") / "library.db"
    campaign = Campaign(GANTRY, library=library, bus="loopback:")
    assert len(list(campaign.run(3))) == 3
    return campaign.result


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Return a function that puts a script in place of a program.

    The scripts fail in ways that the real programs do not.
    """
    folder = tmp_path / "programs"
    folder.mkdir()

    def install(name: str, source: str) -> None:
        script = folder / name
        script.write_text(f"#!{sys.executable}\n{source}")
        script.chmod(script.stat().st_mode | stat.S_IXUSR)

    for module in (controllers, processes):
        monkeypatch.setattr(module, "find_program", lambda name: folder / name)
    return install
