#!/usr/bin/env python3
"""What the torque sensors of an arm say of its drives: torque constants and friction, by least squares.

    python3 tests/proof/torque_sensors.py RECORDING.mcap ... [--joints 4]

Each recording has motor currents in /joint_states and sensor torques in /joint_torque_sensors, sample by sample. The
current of a joint is fitted by its sensor's torque, the sign of the velocity, the sign times the torque's magnitude
(friction that grows with the load), velocity, acceleration and an offset, over all moving samples. Intervals hold 95 %
of 400 draws of blocks of one second.
"""
import argparse

import numpy as np

import record

# A joint that is slower does not count [rad/s]; the sign of the velocity is smooth below this [rad/s].
MOVING, SMOOTH = 0.05, 0.02
# Samples of the moving parabola whose slope is the acceleration.
WINDOW = 15


def slope(stamps, values):
    """Derivative by a parabola through WINDOW samples."""
    weights = np.arange(WINDOW) - WINDOW // 2
    kernel = weights / (weights ** 2).sum() / np.median(np.diff(stamps) * 1e-9)
    return np.apply_along_axis(lambda x: np.convolve(x, kernel[::-1], "same"), 0, values)


def fit(columns, current):
    """Torque constant [N m/A], Coulomb friction [N m], share of the load, viscous friction [N m s/rad]."""
    of_torque, sign, load, velocity = np.linalg.lstsq(columns, current, rcond=None)[0][:4]
    constant = 1 / abs(of_torque)
    return constant, sign * constant, load * constant, velocity * constant


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--joints", type=int, default=4, help="of the first so many joints")
    options = parser.parse_args()
    print("| joint | torque constant, N m/A | Coulomb friction, N m | by load | viscous friction, N m s/rad |")
    print("| --- | --- | --- | --- | --- |")
    recorded = [(record.read(path), record.read(path, "/joint_torque_sensors")[4]) for path in options.recordings]
    for joint in range(options.joints):
        rows, currents, blocks = [], [], []
        for i, ((names, stamps, _, velocity, current), torque) in enumerate(recorded):
            speed, torque = velocity[:, joint], torque[:, joint]
            sign = np.tanh(speed / SMOOTH)
            columns = np.c_[torque, sign, sign * np.abs(torque), speed, slope(stamps, velocity)[:, joint], np.ones(len(speed))]
            moving = np.abs(speed) > MOVING
            rows.append(columns[moving])
            currents.append(current[moving, joint])
            blocks.append(i * 10**6 + ((stamps - stamps[0]) // 10**9)[moving])
        rows, currents, blocks = map(np.concatenate, (rows, currents, blocks))
        members = [np.flatnonzero(blocks == block) for block in np.unique(blocks)]
        chance = np.random.default_rng(1)
        drawn = [np.concatenate([members[k] for k in chance.integers(0, len(members), len(members))]) for _ in range(400)]
        low, high = np.percentile([fit(rows[at], currents[at]) for at in drawn], (2.5, 97.5), axis=0)
        cells = [f"{value:.3g} ({a:.3g} to {b:.3g})" for value, a, b in zip(fit(rows, currents), low, high)]
        print(f"| {names[joint]} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
