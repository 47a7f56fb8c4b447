"""One example or more of every public class, for the tests over all of them."""

from pathlib import Path

import numpy as np

import ilc_rt
from ilc_rt import (
    AdjointIlc,
    BadInputError,
    BasisFunctions,
    CampaignError,
    CampaignResult,
    Cell,
    Compared,
    ConstrainedIlc,
    ErrorFeedforwardIlc,
    FaultError,
    FlexibleIlc,
    Gate,
    IterationRecord,
    Ladder,
    ManyResult,
    ModelInverseIlc,
    NormOptimalIlc,
    PdIlc,
    PlantError,
    Recommendation,
    RelevanceIlc,
    RelevanceWeights,
    SimulatedTuning,
    StateSpace,
    SweepResult,
    ThroughJacobian,
    TimeVarying,
    TrialResult,
    analyze,
    compare,
    discretize,
    grid,
    identify,
    kinematics,
    recommend,
    repeatability,
    second_order,
    signal,
    simulate,
    simulate_many,
    sweep,
    trajectory,
    tune,
    tune_by_simulation,
)
from ilc_rt.control import Cascade, CrossCoupled, Pid
from ilc_rt.laws import (
    Filtered,
    HigherOrderIlc,
    ModelFreeIlc,
    PointToPointIlc,
    PositionHarmonic,
    RepetitiveIlc,
    StableInverseIlc,
)

ROOT = Path(__file__).parents[2]
MODULES = ["ilc_rt"] + [
    f"ilc_rt.{name}"
    for name in ("control", "identify", "kinematics", "signal", "trajectory", "weights")
]
N = 60
RNG = np.random.default_rng(3)
ERROR = RNG.normal(size=N)
U = RNG.normal(size=N)


def axis():
    return discretize(second_order(94.0, 0.7), 0.002)


def both():
    return axis().append(axis())


def low_pass():
    return signal.butterworth(2, 40.0, 0.002)


def line():
    return np.outer(np.linspace(0.0, 0.1, N), [1.0, 0.5])


def response():
    f = np.linspace(1.0, 60.0, 80)
    h = axis().frequency_response(2 * np.pi * f)
    return f, np.asarray(h).reshape(-1)


def updated(law, n_channels=1):
    """Return a law's update for a run."""
    shape = (N,) if n_channels == 1 else (N, n_channels)
    size = N * n_channels
    return law.update(np.resize(U, size).reshape(shape), np.resize(ERROR, size).reshape(shape))


def limits():
    return {"velocity_max_m_s": 0.5, "acceleration_max_m_s2": 2.0, "jerk_max_m_s3": 50.0}


# One or more examples of each class, and the call that distinguishes two beyond their attributes.
EXAMPLES = {
    StateSpace: (lambda: axis().delayed(2), lambda m: m.simulate(U)),
    TimeVarying: (
        lambda: TimeVarying(
            *(np.repeat(x[None], N, 0) for x in (axis().a, axis().b, axis().c, axis().d)), 0.002
        ),
        lambda m: m.simulate(U),
    ),
    PdIlc: (lambda: PdIlc(0.4, 0.1, low_pass(), lead_samples=2), updated),
    ErrorFeedforwardIlc: (
        lambda: ErrorFeedforwardIlc(0.4, signal.gaussian(20.0, 0.002), 3, 0.5),
        updated,
    ),
    NormOptimalIlc: (
        lambda: NormOptimalIlc(axis(), N, q=np.linspace(0.5, 2.0, N), r=0.1, rate=0.3),
        updated,
    ),
    ConstrainedIlc: (
        lambda: ConstrainedIlc(axis(), N, r=0.1, input_max=(-0.4, 0.4)),
        updated,
    ),
    AdjointIlc: (lambda: AdjointIlc(axis(), N, q_filter=low_pass()), updated),
    ModelInverseIlc: (lambda: ModelInverseIlc(axis(), N, 0.5, low_pass()), updated),
    BasisFunctions: (
        lambda: BasisFunctions(axis(), ERROR, ["velocity", "coulomb"], r=0.1, lead_samples=2),
        updated,
    ),
    RepetitiveIlc: (
        lambda: RepetitiveIlc(axis(), ERROR, 0.5, by_direction=True, r=0.1),
        updated,
    ),
    Filtered: (lambda: Filtered(PdIlc(0.4, 0.0), low_pass()), updated),
    HigherOrderIlc: (lambda: HigherOrderIlc(PdIlc(0.4, 0.0), (1.5, -0.5)), updated),
    PointToPointIlc: (lambda: PointToPointIlc(axis(), N, [20, 59], gain=0.5, r=0.1), updated),
    StableInverseIlc: (lambda: StableInverseIlc(axis(), N, q_filter=low_pass()), updated),
    ModelFreeIlc: (lambda: ModelFreeIlc(0.5, probe=0.2), updated),
    PositionHarmonic: (lambda: PositionHarmonic(0.01, 2), lambda psi: psi(ERROR, 0.002)),
    ThroughJacobian: (
        lambda: ThroughJacobian(PdIlc(0.4, 0.0), np.array([[2.0, 0.1], [0.0, 1.0]])),
        lambda law: updated(law, 2),
    ),
    Gate: (lambda: Gate(PdIlc(0.4, 0.0), tolerance=0.1, measure="max", patience=3), updated),
    Ladder: (lambda: Ladder(PdIlc(0.4, 0.0), 2), updated),
    RelevanceWeights: (lambda: RelevanceWeights(error=3.0, disturbance=[0.1, 0.2]), None),
    RelevanceIlc: (
        lambda: RelevanceIlc(None, PdIlc(0.4, 0.0), RelevanceWeights(), dt_s=0.002),
        None,
    ),
    FlexibleIlc: (lambda: FlexibleIlc(None, PdIlc(0.4, 0.0), 0.1), None),
    signal.ButterworthFilter: (
        lambda: signal.ButterworthFilter(3, 40.0, 0.002, causal=True),
        lambda f: f.filter(U),
    ),
    signal.FirFilter: (lambda: signal.FirFilter([0.25, 0.5, 0.25], 3), None),
    signal.GaussianFilter: (lambda: signal.GaussianFilter(20.0, 0.002), None),
    signal.SwitchedFilter: (
        lambda: signal.SwitchedFilter([10.0, 50.0], [0, 30], 0.002, order=3, blend=8),
        None,
    ),
    kinematics.Delta: (
        lambda: kinematics.Delta(0.04, 0.06, 0.15),
        lambda d: d.forward([0.1, 0.2, 0.3]),
    ),
    kinematics.Gantry: (lambda: kinematics.Gantry(0.002), lambda g: g.forward([0.1, 0.2])),
    Pid: (
        lambda: Pid(2.0, 0.3, 0.5, dt_s=0.1, derivative="filtered", filter_s=0.2, output_max=9.0),
        lambda pid: [pid.step(1.0) for _ in range(5)],
    ),
    Cascade: (
        lambda: Cascade(50.0, 100.0, 0.1, dt_s=0.001, force_max_n=5.0),
        lambda c: [c.step(0.001, 0.0, 0.0) for _ in range(5)],
    ),
    CrossCoupled: (
        lambda: CrossCoupled(Pid(10.0, dt_s=0.001)),
        lambda c: [c.step([0.0, 0.5], [0.0, 1.0])[0].tolist() for _ in range(3)],
    ),
    trajectory.MovePlan: (
        lambda: trajectory.MovePlan(
            [[0.0, 0.0], [0.1, 0.05], [0.0, 0.0]],
            feed_m_s=[0.1, 0.2],
            setting="on_time",
            start_velocity_m_s=[0.05, 0.0],
            **limits(),
        ),
        lambda plan: [table.tolist() for table in plan.at([0.0, 0.4, 1.1])],
    ),
    trajectory.Line: (
        lambda: trajectory.Line([0.0, 0.0], [1.0, 2.0]),
        lambda piece: trajectory.contour_error([piece], [[0.5, 0.25]]),
    ),
    trajectory.Arc: (
        lambda: trajectory.Arc([1.0, 0.0], [0.0, 0.0], 3.14),
        lambda piece: trajectory.contour_error([piece], [[0.0, 1.5]]),
    ),
    trajectory.Trajectory: (
        lambda: trajectory.jerk_limited(
            [[0.0, 0.0], [0.1, 0.05]], feed_m_s=0.1, dt_s=0.002, **limits()
        ),
        None,
    ),
    identify.FrequencyResponse: (
        lambda: identify.FrequencyResponse(*response(), np.linspace(0.8, 1.0, 80), 4.0),
        None,
    ),
    identify.SecondOrderFit: (
        lambda: identify.fit_second_order(*response(), dt_s=0.002),
        lambda fit: fit.response([1.0, 5.0]),
    ),
    identify.VelocityLoopFit: (
        lambda: identify.fit_velocity_loop(*response(), 20.0, 0.002),
        lambda fit: fit.response([1.0, 5.0]),
    ),
    identify.RationalFit: (
        lambda: identify.fit_rational(*response(), 1, 2, dt_s=0.002),
        lambda fit: fit.response([1.0, 5.0]),
    ),
    identify.Experiment: (
        lambda: identify.Experiment("x", "multisine", 1.0, 50.0, 8.0, 3, 1e-3),
        None,
    ),
    identify.Identification: (
        lambda: identify.multisine(axis().simulate, dt_s=0.002, amplitude=1e-3),
        lambda found: found.section(),
    ),
    ilc_rt.Analysis: (
        lambda: analyze(NormOptimalIlc(axis(), N, r=0.1), axis(), reference=ERROR),
        None,
    ),
    ilc_rt.Tuning: (lambda: tune(axis(), N, uncertainty=0.3, noise_std=1e-6), None),
    ilc_rt.Repeatability: (lambda: repeatability(RNG.normal(size=(3, N))), None),
    Cell: (lambda: Cell.load(ROOT / "examples" / "01_gantry.toml"), lambda cell: cell.reference()),
    IterationRecord: (lambda: IterationRecord.from_row(ROW, "nowhere.db"), None),
    CampaignResult: (lambda: CampaignResult("nowhere.db", cell="gantry"), None),
    SweepResult: (lambda: sweep(lambda a: {"b": 2 * a}, grid(a=[1.0, 2.0])), None),
    CampaignError: (lambda: CampaignError("node 2 is silent", exit_code=3), None),
    PlantError: (lambda: PlantError("nan at sample 17", trial=3, sample=17), None),
    Compared: (
        lambda: compare({"p": simulate(axis(), PdIlc(0.4, 0.0), ERROR, trials=3)}),
        str,
    ),
    TrialResult: (lambda: simulate(axis(), PdIlc(0.4, 0.0), ERROR, trials=3), None),
    ManyResult: (
        lambda: simulate_many([axis(), axis()], PdIlc(0.4, 0.0), ERROR, trials=3),
        None,
    ),
    Recommendation: (lambda: recommend(axis(), reference=ERROR, uncertainty=0.3), str),
    SimulatedTuning: (
        lambda: tune_by_simulation(
            lambda kp: PdIlc(kp, 0.0), grid(kp=[0.2, 0.4]), [axis()], ERROR, trials=3
        ),
        None,
    ),
    FaultError: (lambda: FaultError("node 2 is silent", kind="silent_drive", node=2), None),
    BadInputError: (lambda: BadInputError("no such file"), None),
}
ROW = {"id": 4, "index": 2, "tracking_inf_m": 1e-3, "tracking_rms_m": 1e-4}
