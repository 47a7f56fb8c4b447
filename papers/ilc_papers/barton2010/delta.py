"""Chapter 7: the delta mechanism, its kinematics, its Jacobian, and one of its legs identified.

The print describes two mechanisms: (7.5) has rods of 125 mm and 20 mm from the rods to the tool's
centre; appendices C and F have rods of 145 mm and no such distance. Both are computed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_papers.barton2010 import delta_leg as leg
from ilc_papers.barton2010.delta_paths import HOME_RAD, PATHS, home_m, tool_path_m
from ilc_papers.barton2010.delta_pictures import PICTURES
from ilc_papers.paper import Claim, Figures, Tell
from ilc_rt.kinematics import Delta, KinematicsError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Base radius minus the distance of the rods from the tool's centre, crank, rod; metres.
GEOMETRIES = {"appendix C": (0.037, 0.060, 0.145), "table 7.1": (0.037 - 0.020, 0.060, 0.125)}
#: Jacobian (8.2) in m/rad: its first column determines the other two.
PRINTED_JACOBIAN_M = (
    np.array([[-44.71, 22.36, 22.36], [0.0, -38.72, 38.72], [14.56, 14.56, 14.56]]) * 1e-3
)
#: Steps of the finite difference that is compared with the analytic Jacobian.
STEPS_RAD = (0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5)
#: Peak torques of the swept sines.
AMPLITUDES_NM = (0.002, 0.005, 0.01)


def compute(reduced: bool, tell: Tell) -> Figures:  # noqa: FBT001 (as `Paper` says)
    """Return kinematics, Jacobians, references and the identified leg."""
    tell("delta: kinematics")
    figures: Figures = {
        "geometries": {
            name: _geometry(Delta(*lengths_m), 2_000 if reduced else 20_000)
            for name, lengths_m in GEOMETRIES.items()
        },
        "references": _references(Delta()),
    }
    tell("delta: identification of a leg")
    return {**figures, "identification": _identification(reduced=reduced)}


def finite_difference(delta: Delta, angle_rad: float, step_rad: float) -> Array:
    """Return the Jacobian as appendix F computes it: one step forward in each angle, in m/rad."""
    home = np.full(3, angle_rad)
    moved = [delta.forward(home + step_rad * row) - delta.forward(home) for row in np.eye(3)]
    return np.column_stack(moved) / step_rad


def printed_from(delta: Delta) -> tuple[float, float]:
    """Return home angle and step in rad whose finite difference is the printed Jacobian (8.2).

    Newton's method on the two numbers that the print is made of; the legs are alike.
    """

    def miss(point: Array) -> Array:
        found = finite_difference(delta, point[0], point[1])
        return (found - PRINTED_JACOBIAN_M)[[0, 2], 0]

    point = np.array([-0.2, 0.3])
    for _ in range(30):
        slope = np.column_stack([miss(point + h) - miss(point - h) for h in 1e-6 * np.eye(2)])
        point -= np.linalg.solve(slope / 2e-6, miss(point))
    return float(point[0]), float(point[1])


def _geometry(delta: Delta, n_poses: int) -> dict[str, Any]:
    """Round trips over the workspace, and the Jacobian beside its finite differences."""
    draws = np.random.default_rng(7).uniform(-0.8, 0.9, (n_poses, 3))
    angles, places = [], []
    for theta in draws:
        try:
            place = delta.forward(theta)
        except KinematicsError:
            continue
        if delta.in_workspace(place):
            angles.append(theta)
            places.append(place)
    theta, p = np.array(angles), np.array(places)
    home = np.full(3, HOME_RAD)
    analytic = delta.jacobian(home)
    size = float(np.linalg.norm(analytic))
    angle, step = printed_from(delta)
    return {
        "lengths_m": [delta.base_m, delta.crank_m, delta.rod_m],
        "n_poses": n_poses,
        "n_inside": len(theta),
        "angle_error_rad": float(np.abs(delta.inverse(p) - theta).max()),
        "position_error_m": float(np.abs(delta.forward(delta.inverse(p)) - p).max()),
        "reach_m": [p.min(axis=0).tolist(), p.max(axis=0).tolist()],
        "home_rad": HOME_RAD,
        "home_m": home_m(delta).tolist(),
        "jacobian_m_rad": analytic.tolist(),
        "condition": delta.condition(home),
        "finite_difference": {
            "step_rad": list(STEPS_RAD),
            "relative_error": [
                float(np.linalg.norm(finite_difference(delta, HOME_RAD, s) - analytic)) / size
                for s in STEPS_RAD
            ],
        },
        "printed_jacobian": {
            "home_rad": angle,
            "step_rad": step,
            "largest_difference_m": float(
                np.abs(finite_difference(delta, angle, step) - PRINTED_JACOBIAN_M).max()
            ),
            "over_analytic": float(
                np.linalg.norm(PRINTED_JACOBIAN_M)
                / np.linalg.norm(delta.jacobian(np.full(3, angle)))
            ),
        },
    }


def _references(delta: Delta) -> dict[str, Any]:
    """Send the plane references through a constant Jacobian (section 8.1.2)."""
    angle, step = printed_from(delta)
    home = np.full(3, angle)
    maps = {"printed": finite_difference(delta, angle, step), "analytic": delta.jacobian(home)}
    found: dict[str, Any] = {}
    for name in PATHS:
        wanted = tool_path_m(delta, name)
        centre = wanted - home_m(delta)
        shapes: dict[str, Any] = {"wanted_m": wanted.tolist()}
        for which, jacobian in maps.items():
            place = delta.forward(home + np.linalg.solve(jacobian, centre.T).T)
            moved = place - delta.forward(home)
            shapes[which] = {
                "tool_m": place.tolist(),
                "out_of_plane_m": float(np.ptp(moved[:, 2])),
                "extent_m": np.ptp(moved[:, :2], axis=0).tolist(),
                "distance_rms_m": float(np.sqrt(((moved - centre) ** 2).sum(axis=1).mean())),
            }
        found[name] = shapes
    return found


def _identification(*, reduced: bool) -> dict[str, Any]:
    """Legs of known parameters, identified; and the leg under its stabilising controller."""
    linear = leg.excite(leg.printed_model().simulate, AMPLITUDES_NM[-1], reduced=reduced)
    legs = [
        leg.excite(leg.pendulum(leg.RESOLUTION_RAD), amplitude, reduced=reduced)
        for amplitude in (AMPLITUDES_NM[:2] if reduced else AMPLITUDES_NM)
    ]
    natural_rad_s, damping = leg.stabilised_poles()
    return {
        "true": {
            "gain": leg.GAIN_RAD_NM,
            "natural_frequency_rad_s": leg.NATURAL_RAD_S,
            "damping": leg.DAMPING,
        },
        "linear": leg.described(linear),
        "pendulum": [leg.described(found) for found in legs],
        "bode": leg.bode_figures(legs[1]),
        # Stiffness by (7.17), -beta cos(theta), and by the derivative of the weight's torque.
        "stiffness_printed_nm_rad": -leg.WEIGHT_NM * float(np.cos(HOME_RAD)),
        "stiffness_nm_rad": -leg.WEIGHT_NM * float(np.sin(HOME_RAD)),
        "stabilised": {
            "natural_frequency_rad_s": natural_rad_s,
            "damping": damping,
            "largest_pole": float(np.abs(leg.stabilised().poles()).max()),
        },
    }


def claims(figures: Figures) -> list[Claim]:
    """Compare the statements of chapter 7 with the results."""
    shown = figures["geometries"]["appendix C"]
    printed, steps = shown["printed_jacobian"], shown["finite_difference"]
    identified, true = figures["identification"], figures["identification"]["true"]
    found = identified["pendulum"][1]
    spiral = figures["references"]["spiral"]["printed"]
    flat = spiral["out_of_plane_m"] / max(spiral["extent_m"])
    return [
        *(
            Claim(
                f"round trip of {each['n_inside']} poses, lengths of {name}",
                each["position_error_m"], unit="m", source="section 7.2",
                holds=each["position_error_m"] < 1e-12 and each["angle_error_rad"] < 1e-9,
                remark="tan(theta/b) of the print read as tan(theta/2); the two sets of lengths "
                "of table 7.1 and appendix C are two mechanisms",
            )
            for name, each in figures["geometries"].items()
        ),
        Claim(
            "the analytic Jacobian is the limit of the finite difference",
            steps["relative_error"][-1], source="section 7.2.3, appendix F",
            holds=steps["relative_error"][-1] < 1e-4,
            remark="error relative to the Jacobian, at a step of 10 microrad",
        ),
        Claim(
            "Jacobian (8.2), largest difference of an entry", printed["largest_difference_m"],
            unit="m", source="eq. (8.2)", holds=printed["largest_difference_m"] < 1e-5,
            remark=f"it is a forward difference over {np.degrees(printed['step_rad']):.1f} degrees "
            f"from {np.degrees(printed['home_rad']):.1f} degrees, found from two of its numbers; "
            f"{printed['over_analytic']:.2f} times the Jacobian there",
        ),
        Claim(
            "movement along z over that in the plane, spiral through a constant Jacobian", flat,
            source="figures 8.4 and 8.7", holds=flat < 0.1,
            remark="the z movement is much smaller than that of x and y; with inverse "
            "kinematics, as elsewhere here, there is none",
        ),
        *(
            Claim(
                f"identified leg: {what}", found[key], true[key], unit, "section 7.3.3, eq. (7.19)",
                holds=abs(found[key] / true[key] - 1.0) < 0.03,
                remark=f"swept sine of {found['amplitude'] * 1e3:.0f} mN m on a simulated leg "
                "whose linearisation is the printed model; with less the encoder's steps show, "
                "with more the curve of the leg's weight",
            )
            for what, key, unit in (
                ("gain", "gain", "rad/(N m)"),
                ("natural frequency", "natural_frequency_rad_s", "rad/s"),
                ("damping", "damping", ""),
            )
        ),
        Claim(
            "stiffness of the linearised leg by (7.17)", identified["stiffness_printed_nm_rad"],
            unit="N m/rad", source="eq. (7.16), (7.17)", holds=False,
            remark="negative, so (7.16) would be unstable, while the identified (7.19) is stable; "
            "the derivative of the weight's torque is "
            f"{identified['stiffness_nm_rad']:.3f} N m/rad",
        ),
        Claim(
            "the controller (8.3) with table 8.1 stabilises the leg (7.19): largest pole",
            identified["stabilised"]["largest_pole"], source="section 8.1.1",
            holds=identified["stabilised"]["largest_pole"] < 1.0,
        ),
    ]  # fmt: skip


__all__ = ["PICTURES", "claims", "compute", "finite_difference", "printed_from"]
