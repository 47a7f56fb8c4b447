"""Identify an axis on the real loop, and learn as fast as the identified uncertainty allows.

The axis is excited with all harmonics of a period at once (multisine) while the other holds still;
a model is fitted to its response, and the residual bounds the model's uncertainty. Run it with

    python examples/06_identify.py

It prints the model and the predicted convergence of norm-optimal ILC, and leaves a Bode plot in the
current folder.
"""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ilc_rt import Cell, NormOptimalIlc, analyze, discretize, identify, second_order

CELL = Path(__file__).parent / "01_gantry.toml"
N_SAMPLES = 400


def main() -> None:
    """Identify axis y, analyse two laws with its model, save the picture."""
    cell = Cell.load(CELL)
    # A band that ends early leaves room for an amplitude at which friction is small.
    found = identify.multisine(
        cell, axis="y", measure="encoder", bus="loopback:",
        from_hz=3.0, to_hz=20.0, amplitude=6e-4, periods=3,
    )  # fmt: skip
    if found.doubt is not None:
        raise SystemExit(found.doubt)
    for name, value, deviation in found.rows():
        print(f"{name:<24}{value:>10}{f'  +- {deviation}' if deviation else ''}")
    print(f"\n{found.section()}")

    described = found.described
    axis = second_order(2.0 * np.pi * described.natural_frequency_hz, described.damping)
    model = discretize(axis, cell.cycle_s).delayed(described.delay_samples)
    uncertainty = found.uncertainty_on_grid()
    for r in (0.01, 0.5):
        law = NormOptimalIlc(model, N_SAMPLES, r=r, s=0.1)
        analysis = analyze(law, model, uncertainty=uncertainty)
        print(
            f"r = {r}: a run leaves {analysis.monotonic_factor:.4f} of the distance at most, "
            f"{analysis.robust_factor:.4f} with what the model leaves over"
        )

    figure = found.figure()
    FigureCanvasAgg(figure)
    figure.savefig("06_identify.png", dpi=150)
    print("picture: 06_identify.png")


if __name__ == "__main__":
    main()
