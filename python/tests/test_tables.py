"""Recordings arrive as Arrow tables, without a copy."""

from pathlib import Path

import pandas
import pyarrow
import pytest

import tauscope



def test_a_recording_is_a_table_with_three_columns_a_joint(data: Path) -> None:
    recording = tauscope.read(data / "demo.mcap", topic="/joint_states")
    counted = {topic["name"]: topic["message_count"] for topic in tauscope.info(data / "demo.mcap")["topics"]}
    frame = pyarrow.table(recording).to_pandas()
    assert len(frame) == len(recording) == counted["/joint_states"] > 1000
    assert len(recording.joints) == 7
    joint = recording.joints[0]
    assert list(frame.columns[:4]) == ["stamp_ns", f"{joint}.position", f"{joint}.velocity", f"{joint}.effort"]
    assert frame["stamp_ns"].is_monotonic_increasing
    joint = recording.joints[1]
    position, velocity = frame[f"{joint}.position"], frame[f"{joint}.velocity"]
    derived = position.diff() / (frame["stamp_ns"].diff() * 1e-9)
    assert derived.corr(velocity) > 0.95
    assert recording.lost == ()


def test_the_data_are_handed_over_without_a_copy(data: Path) -> None:
    recording = tauscope.read(data / "demo.mcap", topic="/joint_states")
    first, second = pyarrow.table(recording), pyarrow.table(recording)
    for column in first.column_names:
        ours, theirs = (table[column].chunk(0).buffers()[1] for table in (first, second))
        assert ours.address == theirs.address, column


def test_the_data_outlive_the_recording(data: Path) -> None:
    recording = tauscope.read(data / "demo.mcap", topic="/joint_states")
    table = pyarrow.table(recording)
    before = table["stamp_ns"].to_pylist()
    del recording
    assert table["stamp_ns"].to_pylist() == before


def test_pandas_takes_it_by_itself(data: Path) -> None:
    recording = tauscope.read(data / "demo.mcap", topic="/joint_states")
    assert pandas.DataFrame.from_arrow(recording).shape == (len(recording), 22)


def test_a_value_that_a_message_does_not_have_is_null(tmp_path: Path) -> None:
    table = tmp_path / "positions.csv"
    table.write_text("0.0,0.1,0.2\n0.1,0.3,0.4\n")
    (tmp_path / "positions.columns.yaml").write_text(
        "{time: {number: 1}, position: {first: 2}, joints: [shoulder, elbow]}"
    )
    read = pyarrow.table(tauscope.read(table))
    assert read["shoulder.position"].to_pylist() == [0.1, 0.3]
    assert read["elbow.effort"].to_pylist() == [None, None]


def test_a_torn_recording_is_read_up_to_the_tear_and_says_so(data: Path, tmp_path: Path) -> None:
    whole = (data / "demo.mcap").read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole[: len(whole) // 2])
    recording = tauscope.read(torn, topic="/joint_states")
    assert 0 < len(recording) < len(tauscope.read(data / "demo.mcap", topic="/joint_states"))
    assert recording.lost and str(torn) in recording.lost[0]


def test_a_missing_file_and_a_missing_topic_are_input_errors(data: Path, tmp_path: Path) -> None:
    with pytest.raises(tauscope.InputError) as caught:
        tauscope.read(tmp_path / "none.mcap")
    assert caught.value.file == str(tmp_path / "none.mcap")
    with pytest.raises(tauscope.InputError, match="/nothing"):
        tauscope.read(data / "demo.mcap", topic="/nothing")


def test_a_broken_line_of_a_table_is_named(tmp_path: Path) -> None:
    table = tmp_path / "broken.csv"
    # As the RTDE recorder of Universal Robots writes it.
    quantities = ("actual_q", "actual_qd", "actual_current")
    header = " ".join(["timestamp", *(f"{name}_{joint}" for name in quantities for joint in range(6))])
    values = " ".join(["0.5"] * 17)
    table.write_text(f"{header}\n0.0 0.5 {values}\n0.1 x {values}\n")
    with pytest.raises(tauscope.InputError) as caught:
        tauscope.read(table)
    assert (caught.value.file, caught.value.line) == (str(table), 3)
