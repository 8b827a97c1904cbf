"""Measured effort beside a digital twin's: recordings as Arrow tables, the commands of `tauscope` as functions.

    import tauscope
    table = tauscope.read("demo.mcap")
    result = tauscope.explain(robot="robot.urdf", fit=["free_1.mcap", "free_2.mcap"], out="report")

Recordings and results are tables in Arrow's memory layout. pyarrow, polars, pandas and duckdb take them without a copy.
Nothing is printed. Errors are exceptions: `InputError` names file, line and column where they are known.
"""

from ._commands import check, evaluate, explain, info, init, query, replay, simulate
from ._errors import InputError, Problem, TauscopeError
from ._recording import Recording, read
from ._results import Evaluation, Explanation, Finding, InitResult, Replay, ScoreTable, Simulation
from ._tauscope import Table, __version__

__all__ = [
    "Evaluation",
    "Explanation",
    "Finding",
    "InitResult",
    "InputError",
    "Problem",
    "Recording",
    "Replay",
    "ScoreTable",
    "Simulation",
    "Table",
    "TauscopeError",
    "__version__",
    "check",
    "evaluate",
    "explain",
    "info",
    "init",
    "query",
    "read",
    "replay",
    "simulate",
]
