"""The commands of the program as functions. Arguments have the names of the program's options."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from ._errors import InputError
from ._process import PathLike, run
from ._results import Evaluation, Explanation, InitResult, Replay, ScoreTable, Simulation
from ._tauscope import Table, read_parquet


def _options(**values: object) -> list[str]:
    """`--name value` for every value that is given; a flag for True; several values for a list."""
    arguments: list[str] = []
    for name, value in values.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False or value == []:
            continue
        if value is True:
            arguments.append(option)
        elif isinstance(value, list):
            arguments += [option, *map(_text, value)]
        else:
            arguments.append(f"{option}={_text(value)}")
    return arguments


def _text(value: object) -> str:
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def _list(paths: PathLike | Sequence[PathLike]) -> list[PathLike]:
    return [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)


def check(pipeline: PathLike = "pipeline.yaml", *, host: str | None = None) -> dict[str, Any]:
    """Checks a pipeline file; its stages, hosts and links. Raises `InputError` with every error and its place."""
    answer: dict[str, Any] = run(["check", "--json", *_options(host=host), "--", pipeline]).json()
    return answer


def info(recording: PathLike) -> dict[str, Any]:
    """What is in a recording: topics and rates, gaps, joints and what is odd about them, damage."""
    answer: dict[str, Any] = run(["info", "--json", "--", recording]).json()
    return answer


def simulate(scenario: PathLike, *, out: PathLike, force: bool = False) -> Simulation:
    """Makes recordings of a simulated cell, with the physics and the contacts that a scenario file chooses."""
    answer = run(["simulate", "--json", *_options(out=out, force=force), "--", scenario])
    made = answer.json()
    path = {key: Path(made[key]) if made[key] else None for key in ("set", "case", "concealed")}
    recordings = [Path(recording) for recording in made["recordings"]]
    return Simulation(answer.lost, answer.messages, recordings, Path(made["labels"]), **path)


def replay(
    recordings: PathLike | Sequence[PathLike],
    *,
    out: PathLike,
    pipeline: PathLike = "pipeline.yaml",
    jobs: int | None = None,
    source: str | None = None,
    force: bool = False,
) -> Replay:
    """Runs a pipeline's stages over recordings; archives, `summary.parquet` and `events.parquet` go to `out`."""
    options = _options(out=out, pipeline=pipeline, jobs=jobs, source=source, force=force)
    answer = run(["replay", "--json", *options, "--", *_list(recordings)])
    folder = Path(out)
    summary, events = (read_parquet(folder / name) for name in ("summary.parquet", "events.parquet"))
    return Replay(answer.lost, answer.messages, folder, answer.json(), summary, events)


def query(sql: str, paths: PathLike | Sequence[PathLike] = ()) -> Table:
    """The answer to a query over recordings, manifests and folders of results; needs the program `tauscope-query`."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder, "answer.parquet")
        run(["query", sql, *_list(paths), f"--out={answer}", "--format=parquet"])
        return read_parquet(answer)


def explain(
    case: PathLike | None = None,
    *,
    out: PathLike,
    robot: PathLike | None = None,
    fit: PathLike | Sequence[PathLike] = (),
    holdout: PathLike | Sequence[PathLike] = (),
    effort_unit: Literal["Nm", "A"] | None = None,
    torque_constants_nm_per_a: Mapping[str, float] | None = None,
    twin: PathLike | None = None,
    twin_topic: str | None = None,
    state_topic: str | None = None,
    without: Sequence[str] = (),
    force: bool = False,
) -> Explanation:
    """Finds out which physics the twin leaves out: from a case file, or from a robot and recordings."""
    options = _options(
        out=out,
        robot=robot,
        fit=_list(fit),
        holdout=_list(holdout),
        effort_unit=effort_unit,
        twin=twin,
        twin_topic=twin_topic,
        state_topic=state_topic,
        force=force,
    )
    for joint, constant in (torque_constants_nm_per_a or {}).items():
        options += _options(torque_constant=f"{joint}={constant}")
    for effect in without:
        options += _options(without=effect)
    if case is None and not _list(fit):
        raise InputError("`explain` needs a case file, or `robot` and `fit`")
    answer = run(["explain", "--json", *options, *([] if case is None else ["--", case])])
    report = answer.json()
    return Explanation(answer.lost, answer.messages, Path(out), report["verdict"], report["findings"], report)


def evaluate(
    labelled_set: PathLike,
    *,
    out: PathLike,
    detectors: Sequence[str] = (),
    twins: PathLike | Sequence[PathLike] = (),
    velocity_cutoff_hz: float | None = None,
    effort_cutoff_hz: float | None = None,
    jobs: int | None = None,
    force: bool = False,
) -> Evaluation:
    """Trains, thresholds and scores detectors on a labelled set."""
    options = _options(
        out=out,
        detectors=",".join(detectors) or None,
        velocity_cutoff_hz=velocity_cutoff_hz,
        effort_cutoff_hz=effort_cutoff_hz,
        jobs=jobs,
        force=force,
    )
    for twin in _list(twins):
        options += _options(twin=twin)
    answer = run(["evaluate", "--json", *options, "--", labelled_set])
    found = answer.json()
    tables = [
        ScoreTable(
            table["title"],
            table["note"],
            Table.of_text(table["head"], [list(column) for column in zip(*table["rows"], strict=True)]),
        )
        for table in found["tables"]
        if table["rows"]
    ]
    files = [Path(file) for file in found["files"]]
    return Evaluation(
        answer.lost, answer.messages, Path(out), found["detectors"], tables, found["notes"], files
    )


def init(
    recordings: PathLike | Sequence[PathLike],
    *,
    robot: PathLike,
    out: PathLike = "cell",
    effort_unit: Literal["Nm", "A"] | None = None,
    state_topic: str | None = None,
    force: bool = False,
) -> InitResult:
    """Makes a folder with a running pipeline from contact-free recordings."""
    options = _options(robot=robot, out=out, effort_unit=effort_unit, state_topic=state_topic, force=force)
    answer = run(["init", *options, "--", *_list(recordings)])
    return InitResult(answer.lost, answer.messages, Path(out), answer.text)
