"""The commands as functions: results, errors, silence, Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pandas
import pandas.testing
import pyarrow
import pyarrow.parquet
import pytest

import tauscope


def test_check_gives_stages_and_links(data: Path) -> None:
    plan = tauscope.check(data.parents[1] / "pipeline.yaml")
    assert [stage["name"] for stage in plan["stages"]] == ["ingest", "twin", "detect", "record"]
    assert plan["errors"] == []


def test_an_error_names_file_line_and_column(tmp_path: Path) -> None:
    pipeline = tmp_path / "pipeline.yaml"
    pipeline.write_text("version: 1\ncells: {}\nstagse: []\n")
    with pytest.raises(tauscope.InputError) as caught:
        tauscope.check(pipeline)
    error = caught.value
    places = {problem.message: (problem.file, problem.line, problem.column) for problem in error.problems}
    assert places["unknown key `stagse`"] == (str(pipeline), 3, 1)
    assert (error.file, error.line, error.column) in places.values()
    assert "stagse" in str(error)
    with pytest.raises(tauscope.InputError) as caught:
        tauscope.replay("none.mcap", pipeline=pipeline, out=tmp_path / "out")
    assert [(problem.line, problem.column) for problem in caught.value.problems] == [(1, 1), (3, 1)]


def test_replay_gives_the_tables_that_it_wrote(data: Path, tmp_path: Path) -> None:
    result = tauscope.replay(data / "demo.mcap", pipeline=data.parents[1] / "pipeline.yaml", out=tmp_path)
    events = pyarrow.table(result.events)
    assert len(events) == len(result.events) == len(result.recordings[0]["detectors"][0]["events"]) > 0
    written = pyarrow.parquet.read_table(tmp_path / "events.parquet")
    pandas.testing.assert_frame_equal(events.to_pandas(), written.to_pandas())
    assert pyarrow.table(result.summary)["joint"].to_pylist() == result.recordings[0]["joints"]
    assert not result.lost
    with pytest.raises(tauscope.InputError, match="--force"):
        tauscope.replay(data / "demo.mcap", pipeline=data.parents[1] / "pipeline.yaml", out=tmp_path)


def test_nothing_is_printed(data: Path, capfd: pytest.CaptureFixture[str]) -> None:
    tauscope.check(data.parents[1] / "pipeline.yaml")
    with pytest.raises(tauscope.InputError):
        tauscope.info(data / "none.mcap")
    assert capfd.readouterr() == ("", "")


def test_other_threads_run_while_a_recording_is_read(data: Path) -> None:
    running = threading.Event()
    ran = threading.Event()

    def wait_and_run() -> None:
        running.wait()
        ran.set()

    thread = threading.Thread(target=wait_and_run)
    thread.start()
    # No switch is forced, so the thread runs only where the lock is released.
    before = sys.getswitchinterval()
    sys.setswitchinterval(60)
    try:
        running.set()
        tauscope.read(data / "demo.mcap", topic="/joint_states")
        seen = ran.is_set()
    finally:
        sys.setswitchinterval(before)
    thread.join()
    assert seen


def test_ctrl_c_ends_the_work_and_not_the_interpreter(concealed: tauscope.Simulation, tmp_path: Path) -> None:
    program = textwrap.dedent(
        """
        import itertools, signal, sys, tauscope
        # A shell that runs the tests in the background has made Python ignore Ctrl-C.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        print("begun", flush=True)
        try:
            # One may end before it is interrupted.
            for number in itertools.count():
                tauscope.explain(sys.argv[1], out=f"{sys.argv[2]}/{number}")
        except KeyboardInterrupt:
            print(number, len(tauscope.read(sys.argv[3])) > 0)
        """
    )
    out = tmp_path / "report"
    arguments = [concealed.case, out, concealed.recordings[0]]
    with subprocess.Popen(
        [sys.executable, "-c", program, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "begun\n"
            # The folder is made once the recordings are read.
            deadline = time.monotonic() + 60
            while not out.exists() and time.monotonic() < deadline:
                time.sleep(0.01)
            started = time.monotonic()
            os.kill(process.pid, signal.SIGINT)
            said, warned = process.communicate(timeout=60)
        finally:
            process.kill()
    number, _, could_read = said.partition(" ")
    assert (process.returncode, could_read, warned) == (0, "True\n", "")
    assert time.monotonic() - started < 10
    assert not (out / number / "report.json").exists()


def test_a_result_that_was_lossy_says_so(data: Path, tmp_path: Path) -> None:
    whole = (data / "demo.mcap").read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole[: len(whole) // 2])
    result = tauscope.replay(torn, pipeline=data.parents[1] / "pipeline.yaml", out=tmp_path / "out")
    assert result.lost


def test_explain_finds_what_was_concealed(concealed: tauscope.Simulation, tmp_path: Path) -> None:
    result = tauscope.explain(concealed.case, out=tmp_path)
    assert result.verdict == "explained"
    # The corrections in a simulator's own file, by its ending.
    actuators = tmp_path / "actuators.py"
    assert result.write_model(actuators)[-1] == f"wrote {actuators}"
    assert actuators.read_text().startswith("# Corrected by tauscope.")
    with pytest.raises(tauscope.InputError, match="names no simulator"):
        result.write_model(tmp_path / "model.step")
    assert concealed.concealed is not None
    hidden = json.loads(concealed.concealed.read_text())
    assert result.findings[0]["effect"] in json.dumps(hidden)
    table = pyarrow.table(result.joint_table)
    assert table.column_names == ["joint", "holdout_rms_before", "holdout_rms_after", "noise_floor"]
    assert sum(table["holdout_rms_after"].to_pylist()) < sum(table["holdout_rms_before"].to_pylist())
    page = result._repr_html_()
    assert page is not None and page.startswith("<iframe srcdoc=") and "<html" not in page
    assert result.report_path.exists() and result.twin_path.exists()


def test_a_query_without_its_program_says_what_builds_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(tauscope.InputError, match="tauscope-query"):
        tauscope.query("select 1")
