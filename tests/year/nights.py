#!/usr/bin/env python3
"""Nights of a simulated arm, measured: whether errors are of the size that the intervals say, and whether they are white.

    python3 tests/year/nights.py [--tauscope PROGRAM] [--nights N] [--seed S] [--out DIR]

Each night `tauscope simulate` records the bundled arm anew, with friction that follows a made-up temperature and with
other motions, and `tauscope physics` measures it beside one twin, which has the friction of the first day. From the
truth of each night and the table the script prints, by quantity:

    coverage    share of the 95 % intervals that hold the truth
    scatter     standard deviation of (estimate - truth) over that of the interval; 1 is honest, more is too narrow
    lag 1       correlation of that error, less its mean over the nights, with the one of the night before; white errors
                have none. A constant error hides no change
    beyond 3 σ  share of nights with an error beyond 3 standard deviations; a normal variable has 0.3 %
    half width  median half width of the interval over the true value

The year of a hundred cells in condition/tests/year.rs uses errors of this kind. Then two changes are made, friction that
rises at joint3 and a mass on the tool, each for one night, and what the table says of them is printed. Exit code 1 if
less than 85 % of the intervals of friction hold, or if either change is told at another place.
"""

import argparse
import json
import math
import os
import random
import statistics
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
COULOMB = [0.9, 0.9, 0.6, 0.5, 0.25, 0.2, 0.1]
VISCOUS = [1.4, 1.5, 0.8, 0.7, 0.3, 0.25, 0.1]
PER_KELVIN = [-0.003, -0.01]
PAYLOAD = "{mass_kg: %g, com_x_m: 0.0, com_y_m: 0.0, com_z_m: 0.05, ixx_kgm2: 0.001, iyy_kgm2: 0.001, izz_kgm2: 0.001}"


def frictions(kelvins, joint=None, more=0.0):
    """By joint (Coulomb, viscous) in a night that is so much warmer than the first day."""
    all_of_them = []
    for at in range(7):
        warm = [math.exp(slope * kelvins) for slope in PER_KELVIN]
        worn = 1.0 + (more if at == joint else 0.0)
        all_of_them.append((COULOMB[at] * warm[0] * worn, VISCOUS[at] * warm[1]))
    return all_of_them


def scenario(seed, all_of_them, payload=0.0):
    """The scenario of a night: three recordings with other motions each night."""
    lines = [
        "version: 1", "name: night", f"robot: {ROOT}/tests/data/demo_arm.urdf", f"seed: {seed}", "rate_hz: 100", "physics:",
    ]
    for joint, (coulomb, viscous) in enumerate(all_of_them, 1):
        lines.append(f"  - {{effect: coulomb_friction, joint: joint{joint}, parameters: {{coulomb_nm: {coulomb:.6f}}}}}")
        lines.append(
            f"  - {{effect: viscous_friction, joint: joint{joint}, parameters: {{viscous_nms_per_rad: {viscous:.6f}}}}}"
        )
    if payload:
        lines.append(f"  - {{effect: payload, parameters: {PAYLOAD % payload}}}")
    lines += [
        "sensors: {position_noise_rad: 0.00001, velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}",
        "recordings:",
    ]
    fourier = "{fourier: {period_s: %d, harmonics: 4, speed: %.2f, acceleration_rad_s2: 3, range: 0.5}}"
    points = "{points: {speed: 0.4, acceleration_rad_s2: 2.5, rest_s: [0.2, 0.8], range: 0.5, min_height_m: 0.13}}"
    for at, motion in enumerate([fourier % (10, 0.4), points, fourier % (8, 0.5)]):
        lines.append(f"  - {{name: r{at}, duration_s: 16, motion: {motion}}}")
    return "\n".join(lines) + "\n"


def measured(tauscope, folder, text, twin):
    """Simulates and measures a night; by (joint, quantity): value, low, high."""
    os.makedirs(folder)
    path = os.path.join(folder, "night.scenario.yaml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    out = os.path.join(folder, "out")
    subprocess.run([tauscope, "simulate", path, "--out", out], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    recordings = [os.path.join(out, name) for name in sorted(os.listdir(out)) if name.endswith(".mcap")]
    done = subprocess.run(
        [tauscope, "physics", *recordings, "--robot", f"{ROOT}/tests/data/demo_arm.urdf", "--cell", "sim", "--json"]
        + ["--out", os.path.join(folder, "history")] + (["--twin", twin] if twin else []),
        check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )
    return {(row["joint"], row["quantity"]): (row["value"], row["low_95"], row["high_95"]) for row in json.loads(done.stdout)}


def truths(all_of_them, payload=0.0):
    """By (joint, quantity) what the simulated arm has."""
    truth = {(None, "mass_kg"): payload}
    for joint, (coulomb, viscous) in enumerate(all_of_them, 1):
        name = f"joint{joint}"
        truth |= {(name, "coulomb_nm"): coulomb, (name, "viscous_nms_per_rad"): viscous, (name, "gain"): 1.0, (name, "bias_nm"): 0.0}
    return truth


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--tauscope", default=f"{ROOT}/target/debug/tauscope")
    arguments.add_argument("--nights", type=int, default=12)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--out", default=None)
    asked = arguments.parse_args()
    chance = random.Random(asked.seed)
    errors, shares = {}, {}
    with tempfile.TemporaryDirectory() as temporary:
        work = asked.out or temporary
        for night in range(asked.nights):
            now = frictions(chance.uniform(-6.0, 6.0))
            seed = 10_000 * asked.seed + night
            found = measured(asked.tauscope, os.path.join(work, f"night{night:03}"), scenario(seed, now), None)
            for key, truth in truths(now).items():
                if key not in found:
                    continue
                value, low, high = found[key]
                deviation = (high - low) / 3.92
                errors.setdefault(key, []).append((value - truth) / deviation)
                shares.setdefault(key[1], []).append(1.96 * deviation / abs(truth) if truth else math.nan)
            print(f"night {night + 1} of {asked.nights}", file=sys.stderr)
        worn = measured(asked.tauscope, os.path.join(work, "worn"), scenario(10_000 * asked.seed + 9_001, frictions(0.0, 2, 0.3)), None)
        loaded = measured(asked.tauscope, os.path.join(work, "loaded"), scenario(10_000 * asked.seed + 9_002, frictions(0.0), 1.0), None)
    print("| quantity | nights x joints | coverage | scatter | lag 1 | beyond 3 σ | half width |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    ok = True
    for quantity in ["coulomb_nm", "viscous_nms_per_rad", "gain", "bias_nm", "mass_kg"]:
        series = [one for key, one in errors.items() if key[1] == quantity]
        every = [error for one in series for error in one]
        if not every:
            continue
        means = [statistics.mean(one) for one in series]
        centred = [[error - mean for error in one] for one, mean in zip(series, means)]
        pairs = [(a, b) for one in centred for a, b in zip(one, one[1:])]
        held = sum(abs(error) <= 1.96 for error in every) / len(every)
        square = sum(error * error for error in every) / len(every)
        spread = sum(error * error for one in centred for error in one) / len(every)
        lag = sum(a * b for a, b in pairs) / max(len(pairs), 1) / spread
        wild = sum(abs(error) > 3.0 * math.sqrt(square) for error in every) / len(every)
        share = [one for one in shares[quantity] if math.isfinite(one)]
        share = f"{100 * statistics.median(share):.1f} %" if share else "-"
        print(f"| {quantity} | {len(every)} | {100 * held:.0f} % | {math.sqrt(square):.2f} | {lag:+.2f} | {100 * wild:.1f} % | {share} |")
        ok &= held >= 0.85 or quantity not in ("coulomb_nm", "viscous_nms_per_rad")
    now = truths(frictions(0.0))
    worst = max((key for key in worn if key[1] == "coulomb_nm"), key=lambda key: abs(worn[key][0] / now[key] - 1.0))
    print(f"\njoint3's Coulomb friction 30 % higher: most changed {worst[0]}, {100 * (worn[worst][0] / now[worst] - 1):+.0f} %; payload "
          "{:.3f} kg ({:.3f} to {:.3f})".format(*worn[None, "mass_kg"]))
    print("1 kg on the tool: payload {:.3f} kg ({:.3f} to {:.3f})".format(*loaded[None, "mass_kg"]))
    for key in [key for key in loaded if key[1] == "coulomb_nm"]:
        print(f"  Coulomb friction of {key[0]}: {100 * (loaded[key][0] / now[key] - 1):+.1f} %")
    ok &= worst[0] == "joint3" and worn[None, "mass_kg"][1] <= 0.05 and loaded[None, "mass_kg"][1] > 0.5
    sys.exit(0 if ok else 1)


if __name__ == "__main__":
    main()
