"""Results for programs: every verb that prints one writes it as JSON, too."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
import typer

from ilc_rt.cli import application

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable, Iterator

    from ilc_rt import CampaignResult

# Verbs without a result of their own, and why.
WITHOUT = {
    "library export": "writes one run to a file, of which .json is a format",
    "dashboard": "serves pages until it is stopped",
    "bridge plotjuggler": "passes on what it hears until it is stopped",
    "bridge foxglove": "passes on what it hears until it is stopped",
}


def verbs(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Yield every verb with its command, those of groups too."""
    for name, one in getattr(command, "commands", {}).items():
        if hasattr(one, "commands"):
            yield from verbs(one, (*path, name))
        else:
            yield " ".join((*path, name)), one


FOUND = dict(verbs(typer.main.get_command(application())))


@pytest.mark.parametrize("verb", sorted(FOUND))
def test_every_verb_that_prints_a_result_writes_json(verb: str) -> None:
    """With --json; a verb without it is listed above with the reason, and no other is."""
    flags = {flag for parameter in FOUND[verb].params for flag in parameter.opts}
    assert ("--json" in flags) != (verb in WITHOUT)


def test_no_reason_is_left_over() -> None:
    """Every verb with a reason exists."""
    assert set(WITHOUT) <= set(FOUND)


def test_the_verbs_of_a_library_write_their_results(
    finished: CampaignResult, ilc: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    """On standard output alone, where the words go to standard error."""
    record = finished.records[-1]
    shown = ilc("library", "show", finished.library, str(record.id), "--json", "-")
    assert shown.returncode == 0, shown.stderr
    row = json.loads(shown.stdout)
    assert row["tracking_inf_m"] == record.tracking_inf_m
    assert row["reference_m"]["shape"] == list(record.reference_m.shape)
    trimmed = ilc("library", "trim", finished.library, "1000", "--json", "-")
    assert json.loads(trimmed.stdout) == {"deleted": 0}
    drawn = ilc("plot", finished.library, "--out", "pictures", "--json", "-")
    assert drawn.returncode == 0, drawn.stderr
    assert len(json.loads(drawn.stdout)["iterations"]) == len(finished.records)
