"""Runs a command in a process of its own.

A command computes for minutes and cannot be stopped in the middle of a step without ending its process. In a process of
its own, Ctrl-C ends it exactly as it ends the program, and the interpreter survives.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._errors import InputError, Problem, TauscopeError

PathLike = str | os.PathLike[str]

_CHILD = Path(__file__).with_name("_child.py")
_PATIENCE_S = 30
"""Time that an interrupted command has to bring to its end what it writes."""
_LOST = 3
_REJECTED = 2


@dataclass(frozen=True)
class Answer:
    """What a command that did its work answered."""

    text: str
    messages: tuple[str, ...]
    lost: bool

    def json(self) -> Any:
        return json.loads(self.text)


def run(arguments: Sequence[PathLike]) -> Answer:
    """Runs a command; raises where it does not do what was asked."""
    if not sys.executable:
        raise TauscopeError("tauscope starts a Python of its own for a command, and `sys.executable` names none")
    # In a session of its own: from a terminal it would receive Ctrl-C a second time, which ends it without order.
    process = subprocess.Popen(
        [sys.executable, os.fspath(_CHILD), *(os.fspath(argument) for argument in arguments)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        start_new_session=True,
    )
    try:
        written, warned = process.communicate()
    except BaseException:
        _end(process)
        raise
    return _judge(process.returncode, written, warned)


def _end(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.communicate(timeout=_PATIENCE_S)
    except BaseException as error:
        process.kill()
        process.communicate()
        if not isinstance(error, subprocess.TimeoutExpired):
            raise


def _judge(returncode: int, written: str, warned: str) -> Answer:
    try:
        code, text, said, errors = json.loads(written)
    except ValueError:
        how = f"signal {-returncode}" if returncode < 0 else f"exit code {returncode}"
        raise TauscopeError(warned.strip() or f"the command ended with {how} and said nothing") from None
    if code in (0, _LOST):
        lines = [line for line in (warned + said).splitlines() if line.strip()]
        return Answer(text, tuple(lines), code == _LOST)
    listed = errors["errors"] or _listed(text)
    problems = [Problem(**problem) for problem in listed]
    message = said.strip() or "\n".join(_line(problem) for problem in problems)
    kind = InputError if code == _REJECTED else TauscopeError
    raise kind(message or warned.strip(), problems)


def _listed(text: str) -> list[dict[str, Any]]:
    """The errors that `check` prints in place of its result."""
    try:
        listed: list[dict[str, Any]] = json.loads(text)["errors"]
    except (ValueError, KeyError, TypeError):
        return []
    return listed


def _line(problem: Problem) -> str:
    place = [str(part) for part in (problem.file, problem.line, problem.column) if part is not None]
    return ": ".join([":".join(place), problem.message] if place else [problem.message])
