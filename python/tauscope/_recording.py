"""Recordings as tables."""

from __future__ import annotations

import os
from dataclasses import dataclass

from . import _tauscope
from ._errors import InputError, Problem


@dataclass(frozen=True)
class Recording:
    """The joint states of one topic. It is an Arrow table itself: `pyarrow.table(recording)`, `polars.DataFrame(...)`.

    A row is a message. The column `stamp_ns` is its stamp [ns since the epoch]; each joint has the columns
    `NAME.position` [rad or m], `NAME.velocity` [rad/s or m/s] and `NAME.effort` [N m, N or A, as recorded].
    A value that a message does not have is null. A value that is recorded as NaN stays NaN.
    """

    path: str
    topic: str
    table: _tauscope.Table
    lost: tuple[str, ...]
    """A sentence for each thing that could not be read; empty if nothing was lost."""

    @property
    def joints(self) -> list[str]:
        """Names of the joints, in the order in which they first appear."""
        ending = ".position"
        return [name[: -len(ending)] for name in self.table.column_names if name.endswith(ending)]

    def __len__(self) -> int:
        return self.table.num_rows

    def __arrow_c_schema__(self) -> object:
        return self.table.__arrow_c_schema__()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self.table.__arrow_c_stream__(requested_schema)


def read(path: str | os.PathLike[str], *, topic: str | None = None) -> Recording:
    """Reads the joint states of a recording: an MCAP file, a rosbag2 folder, a `.db3` bag, a ROS 1 bag, a `.csv`
    table, or an episode of a LeRobot data set (`DATASET/episode_000003`).

    Without `topic` the only topic with joint states is read; if there are several, `/joint_states`.
    """
    try:
        table, found, lost = _tauscope.read_joint_states(path, topic)
    except ValueError as error:
        if len(error.args) != 3:
            raise
        message, file, line = error.args
        raise InputError(message, [Problem(message, file=os.fspath(file), line=line)]) from None
    return Recording(os.fspath(path), found, table, tuple(lost))
