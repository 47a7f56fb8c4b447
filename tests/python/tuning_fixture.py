"""Random cells of simulated drives that differ from their models, by seed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ilc_rt import Campaign

GANTRY = Path("examples/01_gantry.toml")
RUNS = 10


def other_cell(seed):
    """Return a gantry with other masses, friction, modes, delays and noise, as TOML.

    The models are off by up to 10 % in frequency, 15 % in damping and a cycle or two in delay.
    """
    rng = np.random.default_rng(seed)
    head, first, second, tail = re.split(
        r"(?=\[\[axis\]\])|(?=\[tcp_encoder\])", GANTRY.read_text(encoding="utf-8")
    )
    axes = []
    for text in (first, second):
        mass_kg, frequency_hz = rng.uniform(10, 200), rng.uniform(9, 22)
        damping = rng.uniform(0.55, 1.1)
        # Friction, expressed as the error that it holds.
        stuck_m = rng.uniform(1e-5, 8e-5)
        coulomb_n = stuck_m * mass_kg * (2 * np.pi * frequency_hz) ** 2
        lines = [
            f"mass_kg = {mass_kg:.2f}",
            f"natural_frequency_hz = {frequency_hz:.3f}",
            f"damping = {damping:.3f}",
            f"coulomb_n = {coulomb_n:.2f}",
            f"static_n = {coulomb_n * rng.uniform(1.0, 1.7):.2f}",
        ]
        if rng.random() < 0.6:
            lines += [
                f"mode_mass_kg = {mass_kg * rng.uniform(0.05, 0.2):.2f}",
                f"mode_frequency_hz = {frequency_hz * rng.uniform(1.3, 2.5):.2f}",
                f"mode_damping = {rng.uniform(0.05, 0.15):.3f}",
            ]
        lines.append(re.search(r"position_start_m = .*", text).group())
        believed = [
            f"natural_frequency_hz = {frequency_hz * rng.uniform(0.9, 1.1):.3f}",
            f"damping = {damping * rng.uniform(0.85, 1.15):.3f}",
            f"delay_samples = {rng.integers(1, 5)}",
        ]
        limits = text[: text.index("[axis.model]")]
        axes.append(
            limits + "[axis.model]\n" + "\n".join(believed)
            + "\n\n[axis.simulation]\n" + "\n".join(lines) + "\n\n"
        )  # fmt: skip
    noise = f"encoder_noise_m = {rng.uniform(0, 1e-6):.3e}\nseed = {seed}\n"
    tail = tail.replace("[simulation]\n", "[simulation]\n" + noise)
    return head + "".join(axes) + tail


def learn(path, library, runs=RUNS):
    """Run a cell in lock-step; return contour and tracking error of each run, and the events."""
    campaign = Campaign(path, bus="loopback:", library=library)
    records = list(campaign.run(runs))
    contour = np.array([record.contour_inf_m for record in records])
    return contour, campaign
