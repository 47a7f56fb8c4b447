"""Wrong arguments for everything public in `ilc_rt`: no abort, hang, panic or false result.

Run it directly for any time, with any seed::

    python tests/fuzz/border.py --seconds 60 --seed 7

Calls are made in another process, with bounded memory, and watched. The arguments are drawn: mostly
valid ones, one or two of which are replaced. A call may succeed or raise `ValueError` (the base of
every error of the package), `TypeError`, `MemoryError` or `OSError`; its result holds no non-finite
number. Exits 1 with the calls that broke a rule.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

from ilc_rt.errors import CampaignError, SweepError

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))

MEMORY_MAX = 6 << 30
SILENCE_MAX_S = 60.0
ALLOWED = (ValueError, TypeError, MemoryError, OSError, CampaignError, SweepError)
# Runs machines, writes files to a given place, or is a result, which holds what it was given.
SKIPPED = {"Campaign", "Law", "CampaignResult", "TrialResult", "ManyResult", "IterationRecord",
           "Experiment", "Identification", "to_parquet", "swept_sine", "Library",
           "Cell", "Recommendation"}  # fmt: skip
# Figures that may be infinite by definition: unbounded growth, no limit, the deviation of a
# parameter that the measurement does not determine. `parameters` are as given.
UNBOUNDED = {"bandwidth_deviation_hz", "gain_deviation", "delay_deviation_s", "damping_deviation",
             "natural_frequency_deviation_hz",
             "transient_growth", "spectral_radius", "expected_rms", "growth", "limit",
             "uncertainty_allowed", "robust_factor", "contraction", "monotonic_factor",
             "expected_rms_limit", "robust_lifted", "ratio"}  # fmt: skip


def odd_values(rng: random.Random) -> list[object]:
    """Return invalid arguments of every kind."""
    from classes_fixture import axis

    shape = rng.choice([(0,), (1,), (3,), (60,), (60, 2), (2, 60), (0, 2), (3, 3), (2, 3, 2)])
    numbers = np.random.default_rng(rng.getrandbits(32)).normal(size=shape)
    holes = numbers.copy()
    if holes.size:
        holes.flat[0] = rng.choice([np.nan, np.inf, -np.inf])
    return [
        None, True, False, -1, 0, 1, 2, 2**31, 2**32, 2**63, 2**64, -(2**63), 10**30, 10**5, 10**7,
        10**10, 0.0, -0.0, 1.5, -2.5, float("nan"), float("inf"), -float("inf"), 1e200, -1e200,
        1e-200, 5e-324, 1e308, "", "x", "zoh", "\x00\x1b[2J", b"x", [], [1], [[1.0, 2.0], [3.0]],
        (), {}, {"q": 1.0}, object(), int, np.int64(5), np.uint8(200), np.bool_(True),
        np.float32(0.5), np.float64("nan"), np.datetime64(0, "s"), 1j, numbers, holes,
        numbers * 1e200, numbers * 1e-200, numbers.astype(np.float32), numbers.astype(complex),
        numbers.astype(object), numbers > 0, (numbers * 10).astype(np.int8), numbers.T,
        np.asfortranarray(numbers), numbers[::-1], np.array("x"), np.array(1.0), axis(),
        [axis(), axis()], lambda x: x, range(5),
    ]  # fmt: skip


def right_values() -> dict[str, object]:
    """Return a valid argument for each parameter name."""
    from classes_fixture import ERROR, N, U, axis, line, low_pass, response

    from ilc_rt import PdIlc, RelevanceWeights, identify, trajectory
    from ilc_rt.control import Pid

    f, h = response()
    move = trajectory.jerk_limited(
        [[0.0, 0.0], [0.1, 0.05]], feed_m_s=0.1, dt_s=0.002, velocity_max_m_s=0.5,
        acceleration_max_m_s2=2.0, jerk_max_m_s3=50.0,
    )  # fmt: skip
    return {
        "a": axis().a, "b": axis().b, "c": axis().c, "d": axis().d, "dt_s": 0.002, "model": axis(),
        "models": [axis(), axis()], "n_samples": N, "n": 20, "u": U, "e": ERROR, "y": ERROR,
        "x": ERROR, "x0": [0.0, 0.0], "q": 1.0, "s": 0.01, "r": 0.1, "rate": 0.3, "kp": 0.4,
        "kd": 0.1, "q_filter": low_pass(), "filter": low_pass(), "lead_samples": 2,
        "gain": 0.5,
        "gain_per_s": 0.5, "input_max": 0.4, "change_max": 0.4, "step_max": 0.4,
        "law": PdIlc(0.4, 0.0), "core": PdIlc(0.4, 0.0), "library": None,
        "weights": RelevanceWeights(), "repeats": 2, "patience": 2, "jacobian": np.eye(1),
        "order": 2, "cutoff_hz": 40.0, "bandwidth_hz": 20.0, "taps": [0.25, 0.5, 0.25],
        "cutoffs_hz": [10.0, 50.0], "starts": [0, 30], "blend": 8, "reference": ERROR,
        "low_hz": 5.0, "high_hz": 40.0, "threshold_hz": 10.0, "other": axis(), "next": axis(),
        "controller": Pid(2.0, dt_s=0.1), "w_rad_s": [1.0, 10.0], "num": [1.0],
        "den": [1.0, 2.0], "frequency_hz": f, "response": h, "coherence": np.ones(f.size),
        "measured": identify.FrequencyResponse(f, h), "position_gain_per_s": 20.0, "n_zeros": 1,
        "n_poles": 2, "amplitude": 1e-3, "from_hz": 1.0, "to_hz": 40.0, "period_s": 2.0,
        "periods": 2, "waveform": "multisine", "system": axis().simulate,
        "residual_rms": 0.1, "errors": np.stack([ERROR, U]), "points_m": line()[:5],
        "feed_m_s": 0.1, "velocity_max_m_s": 0.5, "acceleration_max_m_s2": 2.0,
        "jerk_max_m_s3": 50.0, "pitch_m": 0.01, "turns": 2.0, "width_m": 0.05, "rows": 3,
        "text": "G1 X1 F60", "start_m": [0.0, 0.0], "trajectory": move, "reference_m": line(),
        "actual_m": line() + 1e-4, "frequency_hz_": 5.0, "amplitude_m": 1e-3,
        "orthogonality_rad": 0.002, "axes_m": [0.1, 0.2], "theta_rad": [0.1, 0.2, 0.3],
        "p_m": [0.0, 0.0, -0.1], "from_m": [0.0, 0.0], "to_m": [1.0, 2.0], "centre_m": [0.0, 0.0],
        "sweep_rad": 1.0, "error": 0.1, "error_m": [0.0, 0.5], "gains": [0.0, 1.0],
        "position_gain_per_s_": 50.0, "velocity_gain_n_s_m": 100.0, "contour": 10.0,
        "segments": [(0, 1.0), (20, 2.0)], "n_agents": 2, "n_axes": 1, "positions_m": line(),
        "position_m": 0.0, "velocity_m_s": 0.0, "uncertainty": 0.2, "noise_std": 1e-3,
        "n_runs": 5, "method": "zoh", "e_m": line(), "errors_m": line(),
        "plant": axis(), "trials": 3, "disturbance": None, "initial_state": [0.0, 0.0],
        "points": [20, 59], "basis": ["velocity"], "function": float,
        "cases": [{"x": 1.0}], "ranges": {"a": (0.0, 1.0)},
    }  # fmt: skip


def signature(call: object) -> list[inspect.Parameter] | None:
    try:
        return [p for p in inspect.signature(call).parameters.values()
                if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]  # fmt: skip
    except (TypeError, ValueError):
        return None


def targets() -> list[tuple[str, object, list[inspect.Parameter]]]:
    """Return every callable: functions, classes, methods of examples."""
    from classes_fixture import EXAMPLES, MODULES

    found: dict[str, object] = {}
    for module in map(importlib.import_module, MODULES):
        for name in module.__all__:
            thing = getattr(module, name)
            is_error = inspect.isclass(thing) and issubclass(thing, BaseException)
            if callable(thing) and name not in SKIPPED and not is_error:
                found[f"{module.__name__}.{name}"] = thing
    for kind, (make, _) in EXAMPLES.items():
        if issubclass(kind, BaseException) or kind.__name__ in SKIPPED:
            continue
        for name in dir(kind):
            is_static = isinstance(inspect.getattr_static(kind, name), staticmethod)
            if not name.startswith("_") and callable(getattr(kind, name)):
                bound = getattr(kind, name) if is_static else getattr(make(), name)
                found[f"{kind.__name__}.{name}"] = bound
    with_parameters = ((name, call, signature(call)) for name, call in found.items())
    return [(name, call, given) for name, call, given in with_parameters if given]


def draw(rng: random.Random, given: list[inspect.Parameter], right: dict[str, object]):
    """Return arguments by name, one or two of them odd."""
    odd = odd_values(rng)
    arguments: dict[str, object] = {}
    for parameter in given:
        is_needed = parameter.default is inspect.Parameter.empty
        if is_needed or rng.random() < 0.3:
            default = None if is_needed else parameter.default
            arguments[parameter.name] = right.get(parameter.name, default)
    for parameter in rng.sample(given, min(len(given), rng.choice([0, 1, 1, 1, 2]))):
        arguments[parameter.name] = rng.choice(odd)
    return arguments


def told(name: str, arguments: dict[str, object]) -> str:
    def short(value: object) -> str:
        if isinstance(value, np.ndarray):
            head = np.array2string(value.ravel()[:3], threshold=3)
            return f"array(shape={value.shape}, dtype={value.dtype}, {head})"
        return repr(value)[:120]

    return f"{name}({', '.join(f'{k}={short(v)}' for k, v in arguments.items())})"


def not_finite(value: object, path: str = "", depth: int = 0) -> str | None:
    """Return the place of a non-finite number in a result."""
    if depth > 3 or path.rsplit(".", 1)[-1] in UNBOUNDED or path == ".parameters":
        return None
    if isinstance(value, np.ndarray) and value.dtype.kind in "fc":
        return None if np.isfinite(value).all() else path
    if isinstance(value, (float, complex)):
        return None if np.isfinite(value) else path
    if isinstance(value, (list, tuple)):
        parts = ((f"{path}[{i}]", part) for i, part in enumerate(value[:20]))
    elif isinstance(value, dict):
        parts = ((f"{path}[{key!r}]", part) for key, part in value.items())
    elif type(value).__module__.startswith("ilc_rt") and not isinstance(value, type):
        names = [n for n in dir(type(value))
                 if not n.startswith("_") and not callable(getattr(type(value), n))]  # fmt: skip
        parts = ((f"{path}.{name}", getattr(value, name, None)) for name in names)
    else:
        return None
    return next((at for at in (not_finite(v, p, depth + 1) for p, v in parts) if at), None)


def verdict(call: object, arguments: dict[str, object]) -> str | None:
    """Make one call; return the rule that it broke."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = call(**arguments)
    except ALLOWED as error:
        line = str(error)
        if not line.strip():
            return f"an empty {type(error).__name__}"
        if "panicked" in line or "integral type conversion" in line:
            return f"{type(error).__name__}: {line}"
        return None
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    at = not_finite(result)
    return None if at is None else f"a number that is not finite at result{at}"


def work(seed: int, first: int, seconds: float, calls: int) -> None:
    """Make calls, and report each on a line before and after it is made."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_MAX, MEMORY_MAX))
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    right, everything = right_values(), targets()
    ends = time.monotonic() + seconds
    for number in range(first, calls):
        if time.monotonic() >= ends:
            break
        rng = random.Random(f"{seed}/{number}")
        name, call, given = rng.choice(everything)
        arguments = draw(rng, given, right)
        line = told(name, arguments)
        out.write(json.dumps({"call": number, "is": line}) + "\n")
        wrong = verdict(call, arguments)
        out.write(json.dumps({"done": number, "wrong": wrong, "is": line}) + "\n")
    out.write(json.dumps({"over": True}) + "\n")


def watch(seed: int, seconds: float, calls: int) -> tuple[int, list[str]]:
    """Run workers until the calls or the time are used up; return their number and the failures."""
    broken: list[str] = []
    number, ends = 0, time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="ilc-border-") as folder:
        while number < calls and time.monotonic() < ends:
            command = [sys.executable, str(Path(__file__).resolve()), "--worker", str(number),
                       "--seed", str(seed), "--calls", str(calls),
                       "--seconds", str(ends - time.monotonic())]  # fmt: skip
            number, wrong, is_over = follow(command, folder, number)
            broken += wrong
            if is_over:
                break
    return number, broken


def follow(command: list[str], folder: str, number: int) -> tuple[int, list[str], bool]:
    """Follow one worker; return the next call, the failures, and whether it finished."""
    import selectors

    broken: list[str] = []
    current = "before the first call"
    # The same order of names in every process, so that a seed reproduces the calls.
    environment = {**os.environ, "PYTHONHASHSEED": "0"}
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, bufsize=0, env=environment
    ) as worker:
        assert worker.stdout is not None
        waiting = selectors.DefaultSelector()
        waiting.register(worker.stdout, selectors.EVENT_READ)
        while True:
            if not waiting.select(SILENCE_MAX_S):
                worker.kill()
                return number + 1, [*broken, f"hangs for {SILENCE_MAX_S:.0f} s: {current}"], False
            line = worker.stdout.readline()
            if not line:
                break
            said = json.loads(line)
            if "over" in said:
                return number, broken, True
            if "call" in said:
                number, current = said["call"], said["is"]
            else:
                number = said["done"] + 1
                if said["wrong"]:
                    broken.append(f"{said['wrong']}: {said['is']}")
    return (
        number + 1,
        [*broken, f"the interpreter ended with {worker.returncode}: {current}"],
        False,
    )


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("ILC_FUZZ_SEED", "1")))
    parser.add_argument("--calls", type=int, default=10**9)
    parser.add_argument("--worker", type=int, default=None, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker is not None:
        work(given.seed, given.worker, given.seconds, given.calls)
        return 0
    count, broken = watch(given.seed, given.seconds, given.calls)
    print(f"{count} calls with seed {given.seed}, {len(broken)} of them wrong")
    for line in broken:
        print(f"  {line}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
