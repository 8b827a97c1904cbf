"""Replays an archive on a Ray cluster: each task is a shard. All nodes share the archive and OUT, and have `tauscope` on
the PATH. A shard whose node dies is done again by another, which goes on with what is not done.

    pip install ray
    python3 deploy/archive/replay_ray.py MANIFEST PIPELINE OUT [--shards 16] [--address auto]
"""

import argparse
import subprocess
import sys

import ray


@ray.remote(num_cpus=1, max_retries=3)
def replay(manifest, pipeline, out, shard):
    """The exit code of a shard, and what it said."""
    command = ["tauscope", "replay", "--manifest", manifest, "--pipeline", pipeline, "--out", out, "--shard", shard]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return shard, done.returncode, done.stdout


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("manifest", "pipeline", "out"):
        parser.add_argument(name)
    parser.add_argument("--shards", type=int, default=16)
    parser.add_argument("--address", help="without it, a cluster on this machine")
    args = parser.parse_args()
    ray.init(address=args.address)
    shards = [f"{index}/{args.shards}" for index in range(args.shards)]
    waiting = [replay.remote(args.manifest, args.pipeline, args.out, shard) for shard in shards]
    worst = 0
    while waiting:
        done, waiting = ray.wait(waiting)
        shard, code, said = ray.get(done[0])
        # 3: done, but a recording had lost samples; the results say which.
        if code not in (0, 3):
            print(f"shard {shard} ended with exit code {code}:\n{said}", file=sys.stderr)
            worst = max(worst, code)
    return worst


if __name__ == "__main__":
    sys.exit(main())
