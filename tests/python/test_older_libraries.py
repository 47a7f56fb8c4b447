"""Campaigns of version 0.1 with a native law of Python go on in this version.

Version 0.1 told its laws apart by a `repr` of its own. `OLDER` has the fingerprints that it
stored for the example gantry.
"""

from __future__ import annotations

import sqlite3
from typing import TYPE_CHECKING

import pytest

from ilc_rt import (
    AdjointIlc,
    Campaign,
    CampaignError,
    Cell,
    ErrorFeedforwardIlc,
    Ladder,
    ModelInverseIlc,
    NormOptimalIlc,
    PdIlc,
    signal,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ilc_rt.laws import Law


def low_pass(cell: Cell) -> signal.Filter:
    """Return the Q-filter of the laws."""
    return signal.butterworth(2, 8.0, cell.cycle_s)


def pd(cell: Cell) -> Law:
    """Return a PD law."""
    return PdIlc(0.5, 0.0, low_pass(cell), lead_samples=10)


OLDER: dict[str, tuple[Callable[[Cell], Law], str]] = {
    "pd": (pd, "7985fe0b16dd0ec087d874102a21ad1ca6d4b04760dcd5e71c878cbff0ce63f8"),
    "gaussian": (
        lambda cell: PdIlc(0.5, 0.0, signal.gaussian(12.0, cell.cycle_s), lead_samples=10),
        "d67a1bb4ddefb596e86dc2b18743730184a92e1b62bef770c04d2bb3f935f600",
    ),
    "error_feedforward": (
        lambda cell: ErrorFeedforwardIlc(2.0, low_pass(cell), lead_samples=5),
        "9ddfb47884ac9c05af6124d03e20709dc060cdd58ddaa94ad07e596013a38585",
    ),
    "norm_optimal": (
        lambda cell: NormOptimalIlc(cell.model(), cell.n_samples, rate=6.0),
        "8c029c164c07a095458f69d2102b19dc4c4741f2f9772ef62bcb43bf6d2e619f",
    ),
    "adjoint": (
        lambda cell: AdjointIlc(cell.model(), cell.n_samples, 0.7),
        "8e099b1857fc868650c0217d01d8c08c7507d3a91ad35f7f0bdf6fec77ce58d4",
    ),
    "model_inverse": (
        lambda cell: ModelInverseIlc(cell.model(), cell.n_samples, 0.5, low_pass(cell)),
        "13da749e168f5f238a60043cb51c329effffe90efd22a2886381f87d5a7e444b",
    ),
    "ladder": (
        lambda cell: Ladder(pd(cell), 3),
        "dcbd6ace7ffda5a0d287ae71ec24e6676d50336a87915d410ae8c035d956e8e9",
    ),
}


@pytest.mark.parametrize("name", OLDER)
def test_a_campaign_of_version_0_1_goes_on(gantry: Path, tmp_path: Path, name: str) -> None:
    build, fingerprint = OLDER[name]
    cell, library = Cell.load(gantry), tmp_path / "library.db"

    def run(law: Law, n_runs: int, *, resume: bool) -> list[int]:
        campaign = Campaign(
            gantry, law, library, bus="loopback:", resume=resume, allow_divergent=True
        )
        return [record.index for record in campaign.run(n_runs)]

    assert run(build(cell), 2, resume=False) == [0, 1]
    with sqlite3.connect(library) as connection:
        connection.execute("UPDATE iteration SET fingerprint = ?", [fingerprint])
    connection.close()
    other = PdIlc(0.4, 0.0, low_pass(cell), lead_samples=10)
    with pytest.raises(CampaignError, match="no campaign"):
        run(other, 3, resume=True)
    assert run(build(cell), 3, resume=True) == [2]
