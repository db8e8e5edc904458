"""Errors for the user, with and without a place in a file."""

from collections.abc import Callable
from typing import Final, Literal, NamedTuple


class BusplanError(Exception):
    """An error that the user can fix: bad input, bad usage, an unreadable file.

    Parameters
    ----------
    *problems
        One complete message each: what is wrong, where, the value, and what would be right.
        All problems of one input are reported together.
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class WorkerLostError(BusplanError):
    """A worker process ended in the middle of its work."""


ProblemKind = Literal[
    "syntax", "unknown-key", "missing-key", "wrong-type", "out-of-range", "inconsistent", "execution-unknown"
]
"""Kind of a problem; each has a rule of the gate."""


_MOST_SHOWN: Final = 50


class PlacedProblem(NamedTuple):
    """A problem at a place of a file; lines and columns count from 1."""

    line: int
    column: int
    kind: ProblemKind
    message: str
    key: str = ""
    """Dotted key; empty if the problem has none."""
    marked: tuple[int, int] | None = None
    """First column of what is wrong, and the column after its last; None if it has no end."""


class PlacedError(BusplanError):
    """An invalid file, with all its problems and their places.

    Parameters
    ----------
    name
        Name of the file.
    problems
        At least one, in the order of their places; of very many, only the first are listed.
    hidden
        Number of further problems that are not in `problems`.
    """

    def __init__(self, name: str, problems: tuple[PlacedProblem, ...], *, hidden: int = 0) -> None:
        hidden += len(problems[_MOST_SHOWN:])
        problems = problems[:_MOST_SHOWN]
        more = [f"{name}: and {hidden} more problems"] if hidden else []
        super().__init__(*(f"{name}:{problem.line}:{problem.column}: {problem.message}" for problem in problems), *more)
        self.name = name
        self.placed = problems
        self.hidden = hidden

    def __reduce__(self) -> tuple[Callable[..., "PlacedError"], tuple[object, ...]]:
        """Pickle with all arguments; by default, an exception is pickled with its message only."""
        return _remade, (self.name, self.placed, self.hidden)


def _remade(name: str, problems: tuple[PlacedProblem, ...], hidden: int) -> PlacedError:
    return PlacedError(name, problems, hidden=hidden)
