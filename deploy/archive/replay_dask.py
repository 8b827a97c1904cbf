"""Replays an archive on a Dask cluster: each task is a shard. All workers share the archive and OUT, and have `tauscope`
on the PATH. A shard whose worker dies is done again by another, which goes on with what is not done.

    pip install "dask[distributed]"
    python3 deploy/archive/replay_dask.py MANIFEST PIPELINE OUT [--shards 16] [--scheduler tcp://HOST:8786]
"""

import argparse
import subprocess
import sys

from dask.distributed import Client, as_completed


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
    parser.add_argument("--scheduler", help="without it, a cluster on this machine")
    args = parser.parse_args()
    worst = 0
    with Client(args.scheduler) if args.scheduler else Client() as client:
        shards = [f"{index}/{args.shards}" for index in range(args.shards)]
        # Not pure: a second run must look again for what is missing.
        tasks = client.map(
            lambda shard: replay(args.manifest, args.pipeline, args.out, shard), shards, pure=False, retries=3
        )
        for task in as_completed(tasks):
            shard, code, said = task.result()
            # 3: done, but a recording had lost samples; the results say which.
            if code not in (0, 3):
                print(f"shard {shard} ended with exit code {code}:\n{said}", file=sys.stderr)
                worst = max(worst, code)
    return worst


if __name__ == "__main__":
    sys.exit(main())
