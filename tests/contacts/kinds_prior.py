"""Makes the prior of the detector `tauscope` about collisions and cooperations (stages/detect/src/tauscope/kinds.rs): simulates arms under
impedance control, lets the detector measure the contacts that it finds, and prints the means and the covariance as Rust.

    kinds_prior.py TAUSCOPE ROBOT.urdf OUT [SEED ...]

TAUSCOPE is the program, OUT a folder for about 1 GB of recordings that may be deleted afterwards. The robot is that of assembly.py.
"""
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import yaml

# Arms that nothing else was tuned or judged on.
SEEDS = range(701, 713)
# Recordings an arm. Only those that train are measured.
TRAIN, TEST = 26, 1


def run(*command, **options):
    subprocess.run([str(part) for part in command], check=True, **options)


def measured(tauscope, robot, out, seed):
    """Counts, means and covariance of the contacts of one arm; nothing where too few of a kind were found."""
    folder = out / str(seed)
    folder.mkdir(parents=True, exist_ok=True)
    scenario = folder / "scenario.yaml"
    with scenario.open("w") as file:
        run(sys.executable, Path(__file__).with_name("assembly.py"), robot, seed, TRAIN, TEST, stdout=file)
    run(tauscope, "simulate", scenario, "--force", "--out", folder / "set")
    run(tauscope, "evaluate", folder / "set" / "set.yaml", "--force", "--out", folder / "results", "--detectors", "tauscope", "--twin", "rigid")
    learnt = yaml.safe_load((folder / "results" / "learnt.yaml").read_text())
    return learnt["tauscope"]["tauscope"]["learnt"].get("kind_contacts")


def pooled(arms):
    """All contacts as of one arm: means by kind, and the covariance within a kind about the pooled means."""
    counts = np.array([arm["counts"] for arm in arms])
    means = np.array([arm["means"] for arm in arms])
    together = (counts[:, :, None] * means).sum(0) / counts.sum(0)[:, None]
    scatter = sum(np.array(arm["covariance"]) * sum(arm["counts"]) for arm in arms)
    for arm_counts, arm_means in zip(counts, means):
        for count, apart in zip(arm_counts, arm_means - together):
            scatter = scatter + count * np.outer(apart, apart)
    return counts.sum(0), together, scatter / counts.sum()


def main():
    tauscope, robot, out = (Path(argument).absolute() for argument in sys.argv[1:4])
    seeds = [int(seed) for seed in sys.argv[4:]] or list(SEEDS)
    arms = [arm for arm in (measured(tauscope, robot, out, seed) for seed in seeds) if arm]
    (out / "arms.json").write_text(json.dumps(arms))
    counts, means, covariance = pooled(arms)
    rows = lambda table: "".join("    [" + ", ".join(f"{value:.3f}" for value in row) + "],\n" for row in table)
    print(f"// {counts[0]:.0f} collisions and {counts[1]:.0f} cooperations of {len(arms)} arms.")
    print(f"const PRIOR_MEANS: [[f64; MEASURED]; 2] = [\n{rows(means)}];")
    print(f"const PRIOR_COVARIANCE: [[f64; MEASURED]; MEASURED] = [\n{rows(covariance)}];")


if __name__ == "__main__":
    main()
