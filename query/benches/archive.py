"""Makes an archive of short recordings of a simulated arm: what the queries of docs/query.md are timed on, and what
tests/archives/thousand.py replays.

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
seed: {seed}
rate_hz: {rate_hz}
sensors: {{velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}
recordings:
"""

MOTION = "motion: {fourier: {period_s: 4, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}"
# Recordings of one scenario: their samples count on, and so many of them keep the file and its labels small.
PART = 10_000


def scenario(numbers, seconds, rate_hz):
    """Every tenth recording has a contact, in its second half."""
    lines = [HEAD.format(robot=DATA / "demo_arm.urdf", seed=5 + numbers.start, rate_hz=rate_hz)]
    for number in numbers:
        lines.append(f"  - name: r{number:06}\n    duration_s: {seconds}\n    {MOTION}\n")
        if number % 10 == 0:
            on, off = 0.5 * seconds, 0.7 * seconds
            lines.append(f"    contacts: [{{link: link5, force_n: [24, 6, 0], t_on_s: {on}, t_off_s: {off}}}]\n")
    return "".join(lines)


def make(program, out, recordings, seconds, rate_hz):
    """Makes them, with `tauscope simulate`."""
    out.mkdir(parents=True)
    for begin in range(0, recordings, PART):
        part = out if recordings <= PART else out / f"part{begin // PART:02}"
        part.mkdir(exist_ok=True)
        path = part / "archive.scenario.yaml"
        path.write_text(scenario(range(begin, min(begin + PART, recordings)), seconds, rate_hz))
        subprocess.run([program, "simulate", path, "--out", part], check=True, stdout=subprocess.DEVNULL)


def main():
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tauscope", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--recordings", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rate-hz", type=float, default=100)
    args = parser.parse_args()
    make(args.tauscope, args.out, args.recordings, args.seconds, args.rate_hz)


if __name__ == "__main__":
    main()
