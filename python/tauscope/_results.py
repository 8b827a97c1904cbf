"""What the commands answer."""

from __future__ import annotations

import html
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypedDict

from ._errors import InputError
from ._process import PathLike, run
from ._tauscope import Table

Verdict = Literal["explained", "nothing_missing", "unknown_remains", "not_evaluated"]


Simulator = Literal["urdf", "mjcf", "sdf", "isaaclab", "drake"]
_SIMULATORS: dict[str, Simulator] = {".xml": "mjcf", ".urdf": "urdf", ".sdf": "sdf", ".py": "isaaclab"}


class Finding(TypedDict):
    """One effect that the twin leaves out, as `report.json` holds it."""

    effect: str
    joint: str | None
    link: str | None
    parameters: dict[str, float]
    intervals_95: dict[str, tuple[float, float]]
    confidence: float
    recording: str | None
    t_start: float | None
    t_end: float | None
    explains: float
    equivalent_to: list[dict[str, Any]]
    sentence: str


def _frame(page: Path) -> str | None:
    """The page in a frame of its own, so that its style and a notebook's do not meet."""
    try:
        text = page.read_text(encoding="utf-8")
    except OSError:
        return None
    source = html.escape(text, quote=True)
    return f'<iframe srcdoc="{source}" style="width: 100%; height: 40em; border: 1px solid #8888"></iframe>'


@dataclass(frozen=True)
class Result:
    """What every command answers."""

    lost: bool
    """Whether data was lost. The messages say which and how much."""
    messages: tuple[str, ...]
    """Warnings and notes, which the program writes to standard error."""


@dataclass(frozen=True)
class Explanation(Result):
    """Which physics the twin leaves out. In a notebook it shows its report."""

    folder: Path
    verdict: Verdict
    findings: list[Finding]
    report: dict[str, Any]
    """All of `report.json`."""

    @property
    def report_path(self) -> Path:
        """The page for people."""
        return self.folder / "report.html"

    @property
    def twin_path(self) -> Path:
        """The corrected twin."""
        return self.folder / "twin.yaml"

    @property
    def joint_table(self) -> Table:
        """By joint: RMS error on the held-out recordings before and after, and the noise floor, in the unit of effort."""
        columns = ["holdout_rms_before", "holdout_rms_after", "noise_floor"]
        joints = self.report["joints"]
        numbers = [self.report.get(column) or [None] * len(joints) for column in columns]
        return Table.of_numbers("joint", joints, columns, numbers)

    def write_model(
        self, out: PathLike, *, to: Simulator | None = None, model: PathLike | None = None, force: bool = False
    ) -> list[str]:
        """Writes the corrections into a simulator's own file: by default the robot that was explained, corrected.

        `to` follows from the ending of `out` if it is left out: `.xml` is MuJoCo's, `.urdf`, `.sdf`, and `.py` Isaac Lab's. Gives the
        lines that say what was written, and what the simulator cannot say.
        """
        name = to or _SIMULATORS.get(Path(out).suffix)
        if name is None:
            raise InputError(f"the ending of {os.fspath(out)} names no simulator: give `to`")
        options: list[PathLike] = ["--to", name, "--out", out]
        options += [] if model is None else ["--model", model]
        options += ["--force"] if force else []
        answer = run(["export", *options, "--", self.folder])
        return [line for line in answer.text.splitlines() if line]

    def __repr__(self) -> str:
        return f"<tauscope.Explanation: {self.verdict}, {len(self.findings)} findings, {self.report_path}>"

    def _repr_html_(self) -> str | None:
        return _frame(self.report_path)


@dataclass(frozen=True)
class ScoreTable:
    """One table of an evaluation. It is an Arrow table of text, as the paper's tables are printed."""

    title: str
    note: str
    table: Table

    def __arrow_c_schema__(self) -> object:
        return self.table.__arrow_c_schema__()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self.table.__arrow_c_stream__(requested_schema)


@dataclass(frozen=True)
class Evaluation(Result):
    """Detectors compared on a labelled set. In a notebook it shows its report."""

    folder: Path
    detectors: list[dict[str, Any]]
    """By detector and twin: `detector`, `twin`, `threshold`, and the numbers of each seed in `seeds`."""
    tables: list[ScoreTable]
    notes: list[str]
    files: list[Path]

    @property
    def report_path(self) -> Path | None:
        """The page for people."""
        pages = [file for file in self.files if file.suffix == ".html"]
        return pages[0] if pages else None

    def __repr__(self) -> str:
        return f"<tauscope.Evaluation: {len(self.detectors)} detectors, {self.report_path}>"

    def _repr_html_(self) -> str | None:
        return _frame(self.report_path) if self.report_path else None


@dataclass(frozen=True)
class Replay(Result):
    """A pipeline's stages run over recordings."""

    folder: Path
    recordings: list[dict[str, Any]]
    """By recording: what `tauscope replay --json` prints."""
    summary: Table
    """A row per recording, twin stage and joint, as in `summary.parquet`."""
    events: Table
    """A row per contact, as in `events.parquet`."""

    def __repr__(self) -> str:
        return f"<tauscope.Replay: {len(self.recordings)} recordings, {len(self.events)} events, {self.folder}>"


@dataclass(frozen=True)
class Simulation(Result):
    """Recordings of a simulated cell, and the files beside them; `None` where the scenario asks for none."""

    recordings: list[Path]
    labels: Path
    set: Path | None
    case: Path | None
    concealed: Path | None


@dataclass(frozen=True)
class InitResult(Result):
    """A folder with a running pipeline."""

    folder: Path
    page: str
    """What was found, in Markdown."""

    @property
    def pipeline_path(self) -> Path:
        """The pipeline file."""
        return self.folder / "pipeline.yaml"
