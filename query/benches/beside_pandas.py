"""Times queries of `tauscope query` beside the same done in Python: the reader `mcap` of PyPI, and pandas and DuckDB
over what it reads.

    pip install mcap mcap-ros2-support pandas duckdb pyarrow
    python3 query/benches/beside_pandas.py query/target/release/tauscope-query out/archive

The answers are compared. A ratio is the median of its runs, tauscope's time over Python's.
"""

import argparse
import glob
import json
import os
import pathlib
import statistics
import subprocess
import sys
import time

try:
    import duckdb
    import pandas
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
except ImportError as error:
    print(f"SKIPPED: {error}: pip install mcap mcap-ros2-support pandas duckdb pyarrow")
    sys.exit(0)

TOPIC = "/joint_states"
COLUMNS = ["recording", "topic", "log_ns", "joint", "position_rad", "velocity_rad_s", "effort"]


def frame(files, **within):
    """Joint states as the table `joints`; `within` bounds their log times."""
    rows = []
    for path in files:
        name = pathlib.Path(path).stem
        with open(path, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for _, _, message, state in reader.iter_decoded_messages([TOPIC], **within):
                at = message.log_time
                for joint, *values in zip(state.name, state.position, state.velocity, state.effort):
                    rows.append((name, TOPIC, at, joint, *values))
    return pandas.DataFrame(rows, columns=COLUMNS)


def tauscope(program, sql, files):
    command = [program, sql, *files, "--format", "json"]
    answer = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    return [json.loads(line) for line in answer.splitlines()]


def overview():
    """Everything is read."""
    sql = (
        "select joint, count(*) n, max(effort) highest from joints "
        f"where topic = '{TOPIC}' group by joint order by joint"
    )

    def in_pandas(files):
        groups = frame(files).groupby("joint")["effort"]
        return groups.agg(n="count", highest="max").reset_index().to_dict("records")

    def in_duckdb(files):
        joints = frame(files)  # noqa: F841: DuckDB finds it by its name
        return duckdb.sql(sql).df().to_dict("records")

    return sql, {"pandas": in_pandas, "DuckDB": in_duckdb}


def window(files):
    """One second of the archive: most files are opened only."""
    with open(files[0], "rb") as file:
        start_ns = make_reader(file).get_summary().statistics.message_start_time
    low, high = start_ns, start_ns + 1_000_000_000
    sql = (
        f"select count(*) n, max(effort) highest from joints where topic = '{TOPIC}' and log_ns between {low} and {high}"
    )

    def in_pandas(files):
        efforts = frame(files, starting_at=low, ending_at=high)["effort"]
        return [{"n": len(efforts), "highest": efforts.max()}]

    return sql, {"pandas": in_pandas}


def timed(work, runs):
    times = []
    for _ in range(runs):
        begun = time.perf_counter()
        answer = work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times), answer


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("archive")
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()
    files = sorted(glob.glob(os.path.join(args.archive, "**", "*.mcap"), recursive=True))
    size = sum(os.path.getsize(path) for path in files) * 1e-6
    print(f"{len(files)} recordings, {size:.0f} MB, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    for name, (sql, others) in {"all": overview(), "one second": window(files)}.items():
        own_s, own = timed(lambda: tauscope(args.program, sql, files), args.runs)
        print(f"{name}: tauscope query {own_s:.2f} s")
        for other, work in others.items():
            other_s, told = timed(lambda: work(files), args.runs)
            assert told == own, f"{name}: {other} says {told}, tauscope {own}"
            print(f"{name}: mcap and {other} {other_s:.2f} s, ratio {own_s / other_s:.3f}")


if __name__ == "__main__":
    main()
