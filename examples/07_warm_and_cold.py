"""Learn with the temperature: what was learned cold and warm is recalled, not learned again.

The motor loses force and the tool's scale grows as the machine heats up. Norm-optimal learning
alone corrects the last run, and starts every change of temperature from the wrong one;
relevance-weighted learning (DPW-ILC) weights past runs by their temperature. Run it with

    python examples/07_warm_and_cold.py
"""

import tempfile
from pathlib import Path

from ilc_rt import Campaign

CELL = Path(__file__).with_suffix(".toml")
#: Temperature in kelvin, and the runs made at it.
SHIFTS = [(293.15, 4), (353.15, 4), (293.15, 2), (353.15, 2)]


def campaign(law: str, folder: Path) -> list[tuple[float, float]]:
    """Return the temperature and the RMS error of each run of a campaign resumed per shift."""
    runs: list[tuple[float, float]] = []
    for shift, (temperature_k, n_runs) in enumerate(SHIFTS):
        text = CELL.read_text(encoding="utf-8").replace('law = "relevance"', f'law = "{law}"')
        cell = folder / f"{law}.toml"
        cell.write_text(
            text + f"\n[simulation]\ntemperature_k = {temperature_k}\n", encoding="utf-8"
        )

        def thermometer(run: int, now_k: float = temperature_k) -> float:
            """Return the temperature before a run, as a sensor on the machine would."""
            del run
            return now_k

        learning = Campaign(
            cell, library=folder / f"{law}.db", resume=shift > 0, disturbance=thermometer
        )
        records = learning.run(len(runs) + n_runs)
        runs += [(temperature_k, record.tracking_rms_m) for record in records]
    return runs


def main() -> None:
    """Print the error of each run under both laws."""
    with tempfile.TemporaryDirectory() as folder:
        plain = campaign("norm_optimal", Path(folder))
        relevant = campaign("relevance", Path(folder))
    print("run  temperature   norm-optimal   with relevance")
    for run, ((temperature_k, plain_m), (_, relevant_m)) in enumerate(
        zip(plain, relevant, strict=True)
    ):
        print(
            f"{run:3d}  {temperature_k - 273.15:8.0f} °C"
            f"  {1e6 * plain_m:10.1f} µm  {1e6 * relevant_m:12.1f} µm"
        )


if __name__ == "__main__":
    main()
