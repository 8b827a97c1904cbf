"""Makes an archive of short recordings of a simulated arm: what the queries of docs/query.md are timed on.

    python3 query/benches/archive.py target/release/tauscope out/archive --recordings 1000
    python3 query/benches/archive.py target/release/tauscope out/archive --recordings 100000 --seconds 1
"""

import argparse
import pathlib
import subprocess

DATA = pathlib.Path(__file__).resolve().parents[2] / "tests" / "data"

HEAD = """version: 1
name: archive
robot: {robot}
seed: 5
rate_hz: 100
sensors: {{velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}
recordings:
"""

MOTION = "motion: {fourier: {period_s: 4, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}"


def scenario(count, seconds):
    """Every tenth recording has a contact."""
    lines = [HEAD.format(robot=DATA / "demo_arm.urdf")]
    for number in range(count):
        lines.append(f"  - name: r{number:06}\n    duration_s: {seconds}\n    {MOTION}\n")
        if number % 10 == 0:
            lines.append("    contacts: [{link: link5, force_n: [24, 6, 0], t_on_s: 2.0, t_off_s: 2.8}]\n")
    return "".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tauscope", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--recordings", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=4.0)
    args = parser.parse_args()
    args.out.mkdir(parents=True)
    path = args.out / "archive.scenario.yaml"
    path.write_text(scenario(args.recordings, args.seconds))
    subprocess.run([args.tauscope, "simulate", path, "--out", args.out], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
