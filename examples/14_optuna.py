"""Let Optuna choose the weights of a law, by ask and tell, on simulated machines that differ.

Each trial of the study is two campaigns of the real controller in lock-step: on the machine as it
is described, and on one whose x axis carries 40 kg more. The worse one counts, so that the weights
hold for both; a campaign whose error grew is a failed trial. With the extra ``optuna``, run it with

    python examples/14_optuna.py
"""

import sys
import tempfile
from pathlib import Path

import optuna

from ilc_rt import LearningError, simulate

CELL = Path(__file__).with_name("01_gantry.toml")
MACHINES = {"as described": "mass_kg = 150.0", "40 kg heavier": "mass_kg = 190.0"}
RUNS = 4
N_TRIALS = int(sys.argv[1]) if len(sys.argv) > 1 else 12


def left(rate: float, r: float, folder: Path) -> float:
    """Return the last contour error over the first, on the machine where it is larger."""
    worst = 0.0
    for mass in MACHINES.values():
        text = CELL.read_text(encoding="utf-8").replace("mass_kg = 150.0", mass)
        cell = folder / "cell.toml"
        cell.write_text(text.replace("rate = 6.0", f"rate = {rate}\nr = {r}"), encoding="utf-8")
        records = simulate(cell, trials=RUNS).records
        if any(record.rolled_back for record in records):
            message = "the error grew, and the best input was restored"
            raise LearningError(message)
        first, last = records[0].contour_rms_m, records[-1].contour_rms_m
        worst = max(worst, (last or 0.0) / (first or 1.0))
    return worst


def main() -> None:
    """Print each trial, and the weights for the cell description."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1, n_startup_trials=4))
    # A first guess, and a cautious one.
    study.enqueue_trial({"rate": 15.0, "r": 0.1})
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(N_TRIALS):
            trial = study.ask()
            rate = trial.suggest_float("rate", 2.0, 30.0, log=True)
            r = trial.suggest_float("r", 1e-6, 1.0, log=True)
            try:
                share = left(rate, r, Path(folder))
            except LearningError as error:
                study.tell(trial, state=optuna.trial.TrialState.FAIL)
                print(f"trial {trial.number:2d}  rate {rate:6.2f}  r {r:.1e}  {error}")
                continue
            study.tell(trial, share)
            print(f"trial {trial.number:2d}  rate {rate:6.2f}  r {r:.1e}  left {100 * share:.2f} %")
    best = study.best_trial
    print(
        f"\n[learning.norm_optimal]    # trial {best.number}, {100 * study.best_value:.2f} % left"
    )
    print(f"rate = {best.params['rate']:.3g}\nr = {best.params['r']:.2g}")


if __name__ == "__main__":
    main()
