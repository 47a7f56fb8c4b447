"""Ctrl-C ends a native call that would take minutes, with `KeyboardInterrupt`."""

import signal
import subprocess
import sys
import time

import pytest

#: Names that every call may use.
SET_UP = """
import numpy as np
from ilc_rt import PdIlc, StateSpace, analyze, discretize, second_order, tune
from ilc_rt.fits import fit_second_order

axis = discretize(second_order(60.0, 0.6), 0.001)
full = np.full((600, 600), 1e-3)
wide = StateSpace(full, np.ones((600, 1)), np.ones((1, 600)), [[0.0]], 0.001)
frequency_hz = np.linspace(1.0, 400.0, 3_000_000)
response = 1.0 / (1.0 + 1j * frequency_hz / 20.0) ** 2
try:
    print("begun", flush=True)
    CALL
except KeyboardInterrupt:
    print("interrupted", flush=True)
else:
    print("finished", flush=True)
print(axis.simulate(np.ones(3)).shape)
"""

#: Calls that take minutes.
CALLS = {
    "simulate": "wide.simulate(np.ones(5_000_000))",
    "analyze": "analyze(PdIlc(0.01, 0.0), wide, 200_000)",
    "tune": "tune(axis, 200_000, noise_std=1e-6, reference=np.ones(200_000), n_runs=10_000)",
    "identify": "fit_second_order(frequency_hz, response, dt_s=0.001)",
}


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_ends_a_long_call(name):
    text = SET_UP.replace("CALL", CALLS[name])
    with subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "begun\n"
        # Into the call; before it, the interpreter would see to the signal alone.
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        said, _ = child.communicate(timeout=60)
    assert said == "interrupted\n(3,)\n"
    assert child.returncode == 0
