"""What goes wrong, as exceptions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong. `line` and `column` count from 1."""

    message: str
    file: str | None = None
    line: int | None = None
    column: int | None = None
    label: str | None = None
    help: str | None = None


class TauscopeError(Exception):
    """A command has failed on the way. `problems` has every error; `file`, `line`, `column` are the first one's."""

    def __init__(self, message: str, problems: Sequence[Problem] = ()) -> None:
        super().__init__(message)
        self.problems: tuple[Problem, ...] = tuple(problems)
        first = self.problems[0] if self.problems else Problem(message)
        self.file: str | None = first.file
        self.line: int | None = first.line
        self.column: int | None = first.column


class InputError(TauscopeError, ValueError):
    """Arguments or files are wrong. Nothing was started."""
