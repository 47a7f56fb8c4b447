"""The equations of the pages of theory are those of the laws, on a plant that is not their model.

A page states an update and the map T from one run's distance from the limit to that of the next
one. Here the law itself is applied to every unit input, and the matrix compared.
"""

from __future__ import annotations

import numpy as np
import pytest

from ilc_rt import (
    AdjointIlc,
    BasisFunctions,
    ConstrainedIlc,
    Ladder,
    NormOptimalIlc,
    PdIlc,
    analyze,
    discretize,
    from_transfer_function,
    second_order,
    simulate,
    weights,
)
from ilc_rt.laws import HigherOrderIlc, ModelFreeIlc, PointToPointIlc, StableInverseIlc

N, DT_S = 40, 0.005
MODEL = discretize(second_order(60.0, 0.7), DT_S)
PLANT = discretize(second_order(50.0, 0.5), DT_S)
P, P0 = MODEL.lifted(N), PLANT.lifted(N)
EYE = np.eye(N)
#: Differences from sample to sample.
D = np.diff(EYE, axis=0)


def iteration(law, plant=P0) -> np.ndarray:
    """Return the map from one input to the next one, without a reference."""
    columns = []
    for u in EYE:
        if hasattr(law, "reset"):
            law.reset()
        columns.append(law.update(u, -plant @ u))
    return np.array(columns).T


@pytest.mark.parametrize(
    ("q", "s", "r", "rate"), [(1.0, 0.0, 0.1, 0.0), (2.0, 0.03, 0.2, 0.5), (1.0, 0.01, 0.0, 2.0)]
)
def test_norm_optimal(q: float, s: float, r: float, rate: float) -> None:
    """``T = H^-1 (r + rate^2 D'D + P'q (P - P0))``."""
    change = r * EYE + rate**2 * D.T @ D
    hessian = q * P.T @ P + s * EYE + change
    expected = np.linalg.solve(hessian, change + q * P.T @ (P - P0))
    law = NormOptimalIlc(MODEL, N, q=q, s=s, r=r, rate=rate)
    np.testing.assert_allclose(iteration(law), expected, rtol=0, atol=1e-9)
    found = analyze(law, PLANT)
    # The last input acts on nothing: with r alone it keeps its value, and does not count.
    counted = expected if s or rate else expected[:-1, :-1]
    assert found.spectral_radius == pytest.approx(np.abs(np.linalg.eigvals(counted)).max(), 1e-6)
    assert found.monotonic_factor == pytest.approx(np.linalg.norm(counted, 2), rel=1e-6)


def test_dynamic_weight() -> None:
    """``Q = plain + F'qF``."""
    low_pass = from_transfer_function([0.3], [1.0, -0.7], DT_S)
    f = low_pass.lifted(N)
    weight = 0.05 * EYE + 2.0 * f.T @ f
    expected = np.linalg.solve(P.T @ weight @ P + 0.1 * EYE, 0.1 * EYE + P.T @ weight @ (P - P0))
    law = NormOptimalIlc.dynamic(MODEL, N, low_pass, q=2.0, plain=0.05, r=0.1)
    np.testing.assert_allclose(iteration(law), expected, rtol=0, atol=1e-9)


def test_dynamic_weights_of_the_input() -> None:
    """``T = H^-1 (r + F_v'F_v + P'(P - P0))``, ``H = P'P + F_u'F_u + r + F_v'F_v``."""
    high, low = weights.high_pass(2, 24.0, DT_S), weights.low_pass(1, 24.0, DT_S)
    f_u, f_v = 0.5 * high.lifted(N), low.lifted(N)
    change = 0.01 * EYE + f_v.T @ f_v
    hessian = P.T @ P + f_u.T @ f_u + change
    expected = np.linalg.solve(hessian, change + P.T @ (P - P0))
    law = NormOptimalIlc.dynamic(
        MODEL, N, r=0.01, input_filter=high, input_weight=0.25, change_filter=low
    )
    np.testing.assert_allclose(iteration(law), expected, rtol=0, atol=1e-9)
    found = analyze(law, PLANT)
    assert found.spectral_radius == pytest.approx(np.abs(np.linalg.eigvals(expected)).max(), 1e-6)
    assert found.monotonic_factor == pytest.approx(np.linalg.norm(expected, 2), rel=1e-6)
    # The exact model: symmetric with respect to H, so that every factor is between 0 and 1.
    exact = analyze(law, MODEL)
    assert 0.0 < exact.spectral_radius < 1.0


def test_adjoint() -> None:
    """``T = I - alpha P'P0``, alpha up to ``2 / |P|^2``."""
    law = AdjointIlc(MODEL, N)
    np.testing.assert_allclose(iteration(law), EYE - law.gain * P.T @ P0, rtol=0, atol=1e-9)
    assert law.gain_limit == pytest.approx(2.0 / np.linalg.norm(P, 2) ** 2, rel=2e-3)
    assert law.gain == pytest.approx(0.5 * law.gain_limit)


def test_pd() -> None:
    """The diagonal of T is ``1 - (kp + kd) p_1``; the last input acts on nothing within the run."""
    kp, kd = 0.8, 0.3
    first = P0[1, 0]
    t = iteration(PdIlc(kp=kp, kd=kd, lead_samples=1))
    np.testing.assert_allclose(np.diag(t)[:-1], 1.0 - (kp + kd) * first, rtol=0, atol=1e-12)
    assert np.abs(np.triu(t[:-1, :-1], 1)).max() < 1e-12
    found = analyze(PdIlc(kp=kp, kd=kd, lead_samples=1), PLANT, N)
    assert found.pd_factor == pytest.approx(1.0 - (kp + kd) * first)


def test_constrained() -> None:
    """With the exact model the error never grows, and the bounds are kept."""
    r = 0.01 * np.hanning(N)
    bound = 0.8 * np.abs(r).max()
    result = simulate(MODEL, ConstrainedIlc(MODEL, N, r=0.1, input_max=bound), r, trials=15)
    norms = np.linalg.norm(result.error[:, :, 0], axis=1)
    assert (np.diff(norms) <= 1e-12).all()
    assert np.abs(result.input).max() == pytest.approx(bound)


def test_point_to_point() -> None:
    """``T_s = I - alpha P0_s P_s' (P_s P_s' + r I)^-1``."""
    points, alpha, r = [10, 25, 39], 0.7, 0.02
    rows = P[points]
    gain = rows.T @ np.linalg.inv(rows @ rows.T + r * np.eye(3))
    law = PointToPointIlc(MODEL, N, points, gain=alpha, r=r)
    errors = simulate(PLANT, law, np.hanning(N), trials=3).error[:, points, 0]
    expected = np.eye(3) - alpha * P0[points] @ gain
    np.testing.assert_allclose(errors[1:], errors[:-1] @ expected.T, rtol=0, atol=1e-12)


def test_basis_functions() -> None:
    """``T_theta = I - (P Psi)^+ P0 Psi``."""
    r = np.hanning(N) ** 2

    def bend(reference, _dt_s):
        return reference**2

    psi = np.column_stack([r - r[0], r**2])
    law = BasisFunctions(MODEL, r, ["position", bend], lead_samples=0)
    inputs = simulate(PLANT, law, r, trials=5).input[1:, :, 0]
    theta = np.linalg.lstsq(psi, inputs.T, rcond=None)[0].T
    steps = np.diff(theta, axis=0)
    expected = np.eye(2) - np.linalg.pinv(P @ psi) @ P0 @ psi
    np.testing.assert_allclose(steps[1:], steps[:-1] @ expected.T, rtol=0, atol=1e-9)


def test_model_free() -> None:
    """Two runs measure ``P'e``, so that the update is that of the gradient."""
    r = np.hanning(N)
    gain = 1.0 / np.linalg.norm(P0, 2) ** 2
    result = simulate(PLANT, ModelFreeIlc(gain=gain), r, trials=3)
    first, next_input = result.error[0, :, 0], result.input[2, :, 0]
    np.testing.assert_allclose(next_input, gain * P0.T @ first, rtol=0, atol=1e-12)


def test_higher_order() -> None:
    """The error decays as the largest root of ``z^2 = lambda (w_0 z + w_1)``."""
    weights, kp = (1.5, -0.5), 0.4
    decay = np.abs(np.roots([1.0, *(-(1.0 - kp) * np.array(weights))])).max()
    law = HigherOrderIlc(PdIlc(kp=kp, lead_samples=0), weights)
    errors = simulate(lambda u: u, law, np.ones(5), trials=40).error[:, 0, 0]
    assert abs(errors[30]) == pytest.approx(0.0, abs=20.0 * decay**30)
    # A decay that is faster by a tenth would not be enough.
    assert np.abs(errors[20:40]).max() > (0.9 * decay) ** 40


def test_ladder() -> None:
    """A step is ``I - g (I - T)``."""
    law = Ladder(NormOptimalIlc(MODEL, N, r=0.1), repeats=1)
    assert law.gain == 1.0
    inner = iteration(NormOptimalIlc(MODEL, N, r=0.1))
    np.testing.assert_allclose(iteration(law), EYE - law.gain * (EYE - inner), rtol=0, atol=1e-9)


def test_zero_phase_error_tracking() -> None:
    """``L P = |Bu|^2 / Bu(1)^2``: seen inside the run, for a zero at 1.5."""
    plant = from_transfer_function([1.0, -1.5], [1.0, -1.2, 0.4], DT_S)
    law = StableInverseIlc(plant, 200, gain=1.0, method="zpetc")
    e = plant.simulate(np.where(np.arange(200) == 100, 1.0, 0.0))
    found = law.update(np.zeros(200), e)[97:104]
    # (z - 1.5)(1/z - 1.5) / 0.25
    np.testing.assert_allclose(found, [0, 0, -6.0, 13.0, -6.0, 0, 0], rtol=0, atol=1e-6)
