"""Laws of a cell, and laws passed to a campaign: the checks before they start."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from ilc_rt import (
    AdjointIlc,
    BadInputError,
    Campaign,
    Cell,
    ConstrainedIlc,
    ErrorFeedforwardIlc,
    Gate,
    Ladder,
    LearningError,
    ModelInverseIlc,
    NormOptimalIlc,
    PdIlc,
    StateSpace,
    analyze,
    discretize,
    from_transfer_function,
    second_order,
    signal,
)
from ilc_rt.analysis import refuse_divergent

DT_S = 0.002
N = 300
GANTRY = Path("examples/01_gantry.toml")
LAWS = [
    "norm_optimal",
    "pd",
    "constrained",
    "adjoint",
    "model_inverse",
    "error_feedforward",
    "none",
]


def axis() -> StateSpace:
    """Return the closed position loop of one axis, with a dead time of two samples."""
    return discretize(second_order(94.0, 0.8), DT_S).delayed(2)


def believed(name: str) -> StateSpace:
    """Return the model that a law is tested on: feed-forward needs an axis that only lags."""
    if name != "error_feedforward":
        return axis()
    return from_transfer_function([1.0], [1.0, 0.0], DT_S)


def reverse(model: StateSpace) -> StateSpace:
    """Return the same axis with the wrong sign."""
    return StateSpace(model.a, model.b, -model.c, -model.d, DT_S)


def low_pass(cutoff_hz: float) -> signal.ButterworthFilter:
    """Return a zero-phase low-pass of second order."""
    return signal.butterworth(2, cutoff_hz, DT_S)


NATIVE = {
    "pd": lambda: PdIlc(0.5, 0.0, low_pass(4.0), lead_samples=9),
    "norm_optimal": lambda: NormOptimalIlc(axis(), N, rate=3.0),
    "constrained": lambda: ConstrainedIlc(axis(), N, rate=3.0, input_max=(-1e-6, 1e-6)),
    "adjoint": lambda: AdjointIlc(axis(), N),
    "model_inverse": lambda: ModelInverseIlc(axis(), N, 0.5, low_pass(4.0)),
    "error_feedforward": lambda: ErrorFeedforwardIlc(0.3, input_max=1e-6),
}
AROUND = {
    "alone": lambda law: law,
    "gate": lambda law: Gate(law, tolerance=10.0),
    "ladder": lambda law: Ladder(law, 3),
    "both": lambda law: Gate(Ladder(law, 3), tolerance=10.0),
}


def cell_with(folder: Path, learning: str, example: Path = GANTRY) -> Path:
    """Write an example with another [learning]."""
    text = example.read_text().split("[learning]")[0]
    path = folder / "cell.toml"
    path.write_text(f"{text}[learning]\n{learning}\n")
    return path


@pytest.mark.parametrize("around", AROUND)
@pytest.mark.parametrize("name", NATIVE)
def test_every_native_law_is_judged_before_it_starts(name: str, around: str) -> None:
    law = AROUND[around](NATIVE[name]())
    refuse_divergent(law, believed(name), N)
    with pytest.raises(LearningError, match="will not converge"):
        refuse_divergent(law, reverse(believed(name)), N)


@pytest.mark.parametrize("name", NATIVE)
def test_analysis_looks_inside_gates_and_ladders(name: str) -> None:
    alone = analyze(NATIVE[name](), believed(name), N)
    around = analyze(AROUND["both"](NATIVE[name]()), believed(name), N)
    assert around.converges
    assert around.why == alone.why
    assert around.spectral_radius == alone.spectral_radius


def test_laws_that_were_made_for_a_run_say_its_samples() -> None:
    for name in ["norm_optimal", "constrained", "adjoint", "model_inverse"]:
        assert analyze(AROUND["gate"](NATIVE[name]()), axis()).n_samples == N


def test_a_law_written_in_python_is_let_through_also_in_a_gate() -> None:
    class Wild:
        def update(self, u: np.ndarray, e: np.ndarray, disturbance: object = None) -> np.ndarray:
            return u + 50.0 * e

    refuse_divergent(Gate(Wild()), axis(), N)


@pytest.mark.parametrize("kind", ["pd", "switched", "gated"])
def test_a_low_pass_above_the_critical_frequency_warns_with_both(kind: str) -> None:
    # From 11.4 Hz on the axis lags by more than 90 degrees; the low-pass still suppresses it.
    cutoff_hz = 15.0
    switched = signal.SwitchedFilter([2.0, cutoff_hz], [0, 150], DT_S, blend=20)
    laws = {
        "pd": lambda: PdIlc(0.3, 0.0, low_pass(cutoff_hz)),
        "switched": lambda: PdIlc(0.3, 0.0, switched),
        "gated": lambda: Gate(PdIlc(0.3, 0.0, low_pass(cutoff_hz))),
    }
    with pytest.warns(UserWarning, match=r"begins at 15\.000 Hz, but from \d+\.\d+ Hz on") as told:
        refuse_divergent(laws[kind](), axis(), N)
    assert len(told) == 1
    critical_hz = float(str(told[0].message).split("from ")[1].split()[0])
    assert critical_hz == pytest.approx(11.4, abs=0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refuse_divergent(PdIlc(0.3, 0.0, low_pass(0.9 * critical_hz)), axis(), N)


def test_a_law_that_diverges_is_refused_rather_than_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(LearningError, match="will not converge"):
            refuse_divergent(PdIlc(3.0, 0.0, low_pass(60.0)), axis(), N)


def test_a_campaign_warns_of_its_law_and_refuses_one_that_diverges(tmp_path: Path) -> None:
    library = tmp_path / "library.db"

    def campaign(law: object) -> Campaign:
        return Campaign(GANTRY, law, library, bus="loopback:")  # type: ignore[arg-type]

    with pytest.warns(UserWarning, match=r"begins at 12\.000 Hz, but from"):
        campaign(Gate(PdIlc(0.3, 0.0, low_pass(12.0))))
    with pytest.raises(BadInputError, match="will not converge"):
        campaign(Ladder(PdIlc(5.0, 0.0, low_pass(100.0)), 2))
    model = Cell.load(GANTRY).model()
    with pytest.raises(BadInputError, match=r"300 samples of 2 channels"):
        campaign(AdjointIlc(model, N))


def test_a_campaign_warns_of_the_cells_law_unless_another_one_learns(tmp_path: Path) -> None:
    path = cell_with(tmp_path, 'law = "pd"\n[learning.pd]\nkp = 0.3\ncutoff_hz = 12.0')
    cell = Cell.load(path)
    assert any("begins at 12.000 Hz, but from" in line for line in cell.warnings)
    library = tmp_path / "library.db"
    with pytest.warns(UserWarning, match=r"cell\.toml: \[learning\]: .*begins at 12\.000 Hz"):
        Campaign(cell, library=library, bus="loopback:")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Campaign(cell, library=library, bus="loopback:", learning=False)
        Campaign(cell, PdIlc(0.3, 0.0, low_pass(3.0), lead_samples=10), library, bus="loopback:")
    assert Cell.load(GANTRY).warnings == []


@pytest.mark.parametrize("name", LAWS)
def test_a_cell_tells_its_law(name: str, tmp_path: Path) -> None:
    example = Path("examples/02_parallel.toml") if name == "error_feedforward" else GANTRY
    assert Cell.load(cell_with(tmp_path, f'law = "{name}"', example)).law == name


class Growing:
    """Improves twice, then worsens; counts rollbacks."""

    def __init__(self) -> None:
        self.updates = self.taken = 0

    def update(self, u: np.ndarray, e: np.ndarray, disturbance: object = None) -> np.ndarray:
        """Return the next input."""
        self.updates += 1
        return u + (0.5 if self.updates <= 2 else -4.0) * e

    def taken_back(self) -> None:
        """Count."""
        self.taken += 1


def test_the_controller_leaves_it_to_a_gate_and_tells_other_laws(tmp_path: Path) -> None:
    def back(law: object, name: str) -> list[int]:
        campaign = Campaign(GANTRY, law, tmp_path / f"{name}.db", bus="loopback:")  # type: ignore[arg-type]
        return [record.index for record in campaign.run(7) if record.rolled_back]

    alone, inside, rising = Growing(), Growing(), Growing()
    assert back(alone, "alone") == [3, 5]
    assert alone.taken == 2
    gate = Gate(inside, growth=1.5, patience=1)
    assert back(gate, "gate") == [3]
    assert gate.state == "rolled_back"
    assert inside.taken == 1
    ladder = Ladder(rising, 1, increase=1.0)
    assert back(ladder, "ladder")[0] == 3
    assert rising.taken >= 1
    assert ladder.gain <= 0.5
