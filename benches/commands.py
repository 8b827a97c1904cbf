"""How long `explain` and `init` compute on a plain case: a simulated arm of 7 joints with friction on every joint and a
payload, eight recordings of 20 s at 250 Hz.

    python3 benches/commands.py target/release/tauscope [--runs 3]

A floor stands beside each: `explain` cannot take less than reading what it explains, which `info` does. A figure is the
least of the runs; memory is the most of them.
"""

import argparse
import os
import pathlib
import subprocess
import tempfile
import time

DATA = pathlib.Path(__file__).resolve().parent.parent / "tests" / "data"
RECORDINGS = 8
SECONDS = 20
HEAD = """version: 1
name: plain
robot: {robot}
seed: 11
rate_hz: 250
sensors: {{velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}
physics:
{physics}
recordings:
{recordings}
"""
COULOMB_NM = [0.9, 0.9, 0.6, 0.5, 0.25, 0.2, 0.1]


def scenario():
    """The arm and its recordings."""
    payload = "{mass_kg: 1.2, com_x_m: 0.01, com_y_m: 0.0, com_z_m: 0.06}"
    physics = [f"- {{effect: payload, link: tool, parameters: {payload}}}"]
    for joint, coulomb in enumerate(COULOMB_NM, 1):
        physics.append(f"- {{effect: coulomb_friction, joint: joint{joint}, parameters: {{coulomb_nm: {coulomb}}}}}")
        viscous = f"{{viscous_nms_per_rad: {1.5 * coulomb:.3f}}}"
        physics.append(f"- {{effect: viscous_friction, joint: joint{joint}, parameters: {viscous}}}")
    motion = f"{{fourier: {{period_s: {SECONDS}, harmonics: 5, speed: 0.5, acceleration_rad_s2: 3, range: 0.6}}}}"
    recordings = [f"- {{name: r{n}, duration_s: {SECONDS}, motion: {motion}}}" for n in range(RECORDINGS)]
    return HEAD.format(robot=DATA / "demo_arm.urdf", physics="\n".join(physics), recordings="\n".join(recordings))


def measured(command, folder):
    """Wall time [s], computing time [s] and memory [MB] of one run."""
    begun = time.monotonic()
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(map(str, command[:3]))} failed: {said}")
    return time.monotonic() - begun, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main():
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()
    program = args.program.resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "plain.yaml").write_text(scenario())
        subprocess.run([program, "simulate", "plain.yaml", "--out", "made"], cwd=folder, check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        recordings = sorted((folder / "made").glob("*.mcap"))
        robot = ["--robot", DATA / "demo_arm.urdf"]
        info_each = 'for recording; do "$0" info "$recording" || exit; done'
        commands = {
            "`info`: each recording read once (floor)": ["sh", "-c", info_each, program, *recordings],
            "`explain`": [program, "explain", *recordings, *robot, "--out", "report", "--force"],
            "`init`": [program, "init", *recordings, *robot, "--out", "cell", "--force"],
        }
        print(f"{RECORDINGS} recordings of {SECONDS} s at 250 Hz, 7 joints; least of {args.runs}")
        print("| command | wall [s] | computing [s] | most memory [MB] |")
        print("| --- | --- | --- | --- |")
        for label, command in commands.items():
            runs = [measured(command, folder) for _ in range(args.runs)]
            wall, computing, memory = min(r[0] for r in runs), min(r[1] for r in runs), max(r[2] for r in runs)
            print(f"| {label} | {wall:.2f} | {computing:.2f} | {memory:.0f} |", flush=True)


if __name__ == "__main__":
    main()
