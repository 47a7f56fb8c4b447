"""Names and defaults of the Python classes agree with the schema of the cell description."""

from __future__ import annotations

import inspect
import json
import subprocess
from typing import Any

import pytest

from ilc_rt import laws
from ilc_rt.processes import find_program

# The class for each table of `[learning]` that describes a law or a wrapper of one.
CLASSES = {
    "adjoint": laws.AdjointIlc,
    "basis_functions": laws.BasisFunctions,
    "constrained": laws.ConstrainedIlc,
    "dynamic": laws.NormOptimalIlc.dynamic,
    "error_feedforward": laws.ErrorFeedforwardIlc,
    "filtered": laws.Filtered,
    "flexible": laws.FlexibleIlc,
    "formation": laws.NormOptimalIlc.formation,
    "gate": laws.Gate,
    "higher_order": laws.HigherOrderIlc,
    "ladder": laws.Ladder,
    "model_free": laws.ModelFreeIlc,
    "model_inverse": laws.ModelInverseIlc,
    "norm_optimal": laws.NormOptimalIlc,
    "pd": laws.PdIlc,
    "point_to_point": laws.PointToPointIlc,
    "position_domain": laws.RepetitiveIlc,
    "relevance": laws.RelevanceWeights,
    "stable_inverse": laws.StableInverseIlc,
    "through_jacobian": laws.ThroughJacobian,
}
# What a cell says otherwise: its own filter in place of an object, quantities with the unit of
# the axis, laws by name.
OTHER_IN_A_CELL = {
    "adjoint": {"order", "cutoff_hz"},
    "basis_functions": {"functions", "harmonic", "parameters"},
    "constrained": {
        "change_max_m", "change_max_m_s", "step_max_m", "step_max_m_s", "velocity_max_m_s",
        "acceleration_max_m_s2",
    },
    "dynamic": {"order", "cutoff_hz", "input", "change"},
    "error_feedforward": {"order", "cutoff_hz"},
    "filtered": {"core", "order", "cutoff_hz"},
    "flexible": {"core", "disturbances"},
    "formation": {"agents", "formation", "q"},
    "gate": {"tolerance_m"},
    "higher_order": {"core", "weights"},
    "model_inverse": {"order", "cutoff_hz"},
    "norm_optimal": {"contour", "phase", "smoothing_hz"},
    "pd": {"order", "cutoff_hz"},
    "point_to_point": {"points_s"},
    "position_domain": {"spacing_m", "axes", "functions"},
    "relevance": {"core", "disturbances", "top"},
    "stable_inverse": {"order", "cutoff_hz"},
    "through_jacobian": {"core", "jacobian"},
}  # fmt: skip
# A number of Python that a cell leaves out to mean the same.
NOTHING = {("dynamic", "plain"), ("relevance", "disturbance")}


def tables() -> dict[str, Any]:
    """Return the tables of ``[learning]`` in the schema that the controller prints."""
    command = [str(find_program("ilc-rt")), "schema"]
    whole = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)

    def resolved(part: dict[str, Any]) -> dict[str, Any]:
        while True:
            if "$ref" in part:
                part = whole["definitions"][part["$ref"].rsplit("/", 1)[-1]]
            elif "anyOf" in part:
                part = next(one for one in part["anyOf"] if one.get("type") != "null")
            elif len(part.get("allOf", [])) == 1:
                part = part["allOf"][0]
            else:
                return part

    learning = resolved(whole["properties"]["learning"])["properties"]
    found = {name: resolved(part) for name, part in learning.items()}
    return {name: part["properties"] for name, part in found.items() if "properties" in part}


TABLES = tables()


def test_every_table_of_learning_has_a_class() -> None:
    assert set(TABLES) == set(CLASSES)


@pytest.mark.parametrize("name", CLASSES)
def test_the_defaults_are_those_of_the_cell_description(name: str) -> None:
    parameters = inspect.signature(CLASSES[name]).parameters
    other = OTHER_IN_A_CELL.get(name, set())
    assert not other - set(TABLES[name]), "not in the schema"
    compared = set(TABLES[name]) - other
    assert not compared - set(parameters), "not in Python"
    for key in compared:
        given = parameters[key].default
        if (name, key) in NOTHING and given is None:
            continue
        wanted = TABLES[name][key].get("default")
        given = None if given is inspect.Parameter.empty else given
        assert given == wanted, key
