#!/usr/bin/env python3
"""Makes small LeRobot data sets, as LeRobot writes them, in FOLDER.

    python lerobot_sets.py FOLDER

It needs pyarrow (seen with 26.0.1), and not LeRobot itself, which needs PyTorch. The layout follows the source of
LeRobot (https://github.com/huggingface/lerobot): `src/lerobot/datasets/` of version 3.0, `lerobot/common/datasets/` of
2.1. Features and names are those of published sets of each robot. Values are sines, so that a test can tell them.

| set | version | what is in it |
| --- | --- | --- |
| `aloha` | 2.1 | two episodes; `observation.effort`, names under `motors`, no velocities |
| `openarm` | 3.0 | three episodes in two files; `joint_1.pos`, `.vel` and `.torque` in the state, in degrees |
| `so101` | 3.0 | one episode; positions only, in degrees |
| `times` | 2.1 | a time that is NaN, times that run backwards, times that are off the grid |
| `encodings` | 2.1 | the rows of an episode in each way that pyarrow writes them, and in two that are not read |
"""

import json
import math
import pathlib
import sys

import pyarrow as pa
import pyarrow.parquet as pq

ALOHA = ["waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate", "gripper"]
SO101 = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
OPENARM = [f"joint_{n}" for n in range(1, 8)] + ["gripper"]


def value(episode: int, row: int, element: int) -> float:
    """What stands in an element: between -1 and 1."""
    return math.sin(0.1 * row + element + episode)


def features(own: dict) -> dict:
    """With those that every set has."""
    one = {"shape": [1], "names": None}
    all_sets = {name: {"dtype": "int64", **one} for name in ["frame_index", "episode_index", "index", "task_index"]}
    return {**own, "timestamp": {"dtype": "float32", **one}, **all_sets}


def feature(names, width: int) -> dict:
    return {"dtype": "float32", "shape": [width], "names": names}


def table(own: dict, episode: int, rows: int, fps: int, index: int, scale: dict) -> pa.Table:
    """The rows of an episode; `index` is the place of its first one among those of all episodes."""
    columns = {}
    for at, (name, about) in enumerate(own.items()):
        width = about["shape"][0]
        own_rows = [[scale.get(name, 1.0) * value(episode, row, 100 * at + e) for e in range(width)] for row in range(rows)]
        columns[name] = pa.array(own_rows, pa.list_(pa.float32(), width))
    columns["timestamp"] = pa.array([row / fps for row in range(rows)], pa.float32())
    columns["frame_index"] = pa.array(range(rows), pa.int64())
    columns["episode_index"] = pa.array([episode] * rows, pa.int64())
    columns["index"] = pa.array(range(index, index + rows), pa.int64())
    columns["task_index"] = pa.array([0] * rows, pa.int64())
    return pa.table(columns)


def info(root: pathlib.Path, version: str, robot: str, fps: int, own: dict, lengths: list) -> None:
    by_episode = version == "v2.1"
    text = {
        "codebase_version": version,
        "robot_type": robot,
        "total_episodes": len(lengths),
        "total_frames": sum(lengths),
        "total_tasks": 1,
        "chunks_size": 1000,
        "fps": fps,
        "splits": {"train": f"0:{len(lengths)}"},
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
        if by_episode
        else "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": features(own),
    }
    (root / "meta").mkdir(parents=True)
    (root / "data/chunk-000").mkdir(parents=True)
    (root / "meta/info.json").write_text(json.dumps(text, indent=1) + "\n")


def version_2(root: pathlib.Path, robot: str, fps: int, own: dict, lengths: list) -> None:
    """A file for each episode."""
    info(root, "v2.1", robot, fps, own, lengths)
    lines = []
    for episode, rows in enumerate(lengths):
        own_table = table(own, episode, rows, fps, sum(lengths[:episode]), {})
        pq.write_table(own_table, root / f"data/chunk-000/episode_{episode:06d}.parquet")
        lines.append(json.dumps({"episode_index": episode, "tasks": ["move"], "length": rows}))
    (root / "meta/episodes.jsonl").write_text("\n".join(lines) + "\n")


def version_3(root: pathlib.Path, robot: str, fps: int, own: dict, files: list, scale: dict) -> None:
    """Several episodes in a file, a row group each; a table that says where they are."""
    lengths = [rows for file in files for rows in file]
    info(root, "v3.0", robot, fps, own, lengths)
    where = {key: [] for key in ["episode_index", "tasks", "length", "data/chunk_index", "data/file_index"]}
    episode, index = 0, 0
    where["dataset_from_index"], where["dataset_to_index"] = [], []
    for number, file in enumerate(files):
        writer = None
        for rows in file:
            own_table = table(own, episode, rows, fps, index, scale)
            if writer is None:
                path = root / f"data/chunk-000/file-{number:03d}.parquet"
                writer = pq.ParquetWriter(path, own_table.schema, compression="snappy", use_dictionary=True)
            writer.write_table(own_table)
            own_row = [episode, ["move"], rows, 0, number, index, index + rows]
            for values, own_value in zip(where.values(), own_row):
                values.append(own_value)
            episode, index = episode + 1, index + rows
        writer.close()
    (root / "meta/episodes/chunk-000").mkdir(parents=True)
    pq.write_table(pa.table(where), root / "meta/episodes/chunk-000/file-000.parquet")


# By episode: how pyarrow is to write it.
ENCODINGS = [
    {"compression": "none", "use_dictionary": False},
    {"compression": "zstd", "data_page_version": "2.0"},
    {"compression": "snappy", "data_page_version": "2.0", "use_dictionary": False, "write_page_checksum": True},
    {"compression": "snappy", "data_page_size": 16, "write_batch_size": 3},
    {"compression": "zstd", "row_group_size": 7},
    {"compression": "gzip"},
    {"use_dictionary": False, "column_encoding": {"observation.state.list.element": "BYTE_STREAM_SPLIT"}},
]


def encodings(root: pathlib.Path) -> None:
    """All episodes have the same values: steps that a dictionary is good for, gaps in the effort, `float64`."""
    own = {name: feature(["a", "b"], 2) for name in ["observation.state", "observation.effort"]}
    rows = 40
    info(root, "v2.1", "two_joints", 50, own, [rows] * len(ENCODINGS))
    steps = pa.array([[row // 8 / 4, -(row // 5) / 8] for row in range(rows)], pa.list_(pa.float64()))
    gaps = pa.array([[row / 2, None if row % 3 == 0 else row / 4] for row in range(rows)], pa.list_(pa.float32()))
    for episode, options in enumerate(ENCODINGS):
        columns = {
            "observation.state": steps,
            "observation.effort": gaps,
            "timestamp": pa.array([row / 50 for row in range(rows)], pa.float64()),
            "episode_index": pa.array([episode] * rows, pa.int32()),
        }
        pq.write_table(pa.table(columns), root / f"data/chunk-000/episode_{episode:06d}.parquet", **options)


def times(root: pathlib.Path) -> None:
    own = {name: feature(["a", "b"], 2) for name in ["observation.state", "observation.effort"]}
    episodes = [[0.0, 0.02, math.nan, 0.06], [0.0, 0.04, 0.02, 0.06], [0.0, 0.025, 0.04, 0.0650001]]
    info(root, "v2.1", "two_joints", 50, own, [4] * len(episodes))
    for episode, own_times in enumerate(episodes):
        columns = {name: pa.array([[0.5, math.nan]] * 4, pa.list_(pa.float32())) for name in own}
        columns["timestamp"] = pa.array(own_times, pa.float32())
        pq.write_table(pa.table(columns), root / f"data/chunk-000/episode_{episode:06d}.parquet")


def main() -> None:
    folder = pathlib.Path(sys.argv[1])
    names = {"motors": [f"{arm}_{joint}" for arm in ("left", "right") for joint in ALOHA]}
    own = {name: feature(names, 14) for name in ["observation.state", "observation.effort", "action"]}
    version_2(folder / "aloha", "aloha", 50, own, [20, 12])

    names = [f"{joint}.{what}" for joint in OPENARM for what in ("pos", "vel", "torque")]
    own = {"observation.state": feature(names, 24), "action": feature(names[::3], 8)}
    version_3(folder / "openarm", "openarm_follower", 30, own, [[15, 9], [12]], {"observation.state": 90.0})

    own = {name: feature([f"{joint}.pos" for joint in SO101], 6) for name in ["action", "observation.state"]}
    version_3(folder / "so101", "so101_follower", 30, own, [[10]], {"observation.state": 60.0})

    encodings(folder / "encodings")
    times(folder / "times")


if __name__ == "__main__":
    main()
