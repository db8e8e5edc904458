"""The one exception that stops a run, and its form for what stands at a place of a file."""

from collections.abc import Callable
from typing import Final, Literal, NamedTuple


class BusplanError(Exception):
    """Something the user can mend: bad input, bad usage, an unreadable file.

    Parameters
    ----------
    *problems
        One complete message each: what was wrong, where, the value, and what would be right.
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
"""What is wrong with a file, in the terms of its gate."""


_MOST_SHOWN: Final = 50


class PlacedProblem(NamedTuple):
    """One thing that is wrong at one place of a file; lines and columns count from 1."""

    line: int
    column: int
    kind: ProblemKind
    message: str
    key: str = ""
    """Dotted key, where the problem has one."""


class PlacedError(BusplanError):
    """A file that is no profile, with the place of everything that is wrong in it.

    Parameters
    ----------
    name
        What the file is called.
    problems
        At least one, in the order of their places; the first ones of very many are listed.
    hidden
        How many further problems are not even given.
    """

    def __init__(self, name: str, problems: tuple[PlacedProblem, ...], *, hidden: int = 0) -> None:
        hidden += len(problems[_MOST_SHOWN:])
        problems = problems[:_MOST_SHOWN]
        more = [f"{name}: and {hidden} more problems"] if hidden else []
        super().__init__(*(f"{name}:{one.line}:{one.column}: {one.message}" for one in problems), *more)
        self.name = name
        self.placed = problems
        self.hidden = hidden

    def __reduce__(self) -> tuple[Callable[..., "PlacedError"], tuple[object, ...]]:
        """Travel between processes as what it was made of: an exception by itself travels as its message."""
        return _remade, (self.name, self.placed, self.hidden)


def _remade(name: str, problems: tuple[PlacedProblem, ...], hidden: int) -> PlacedError:
    return PlacedError(name, problems, hidden=hidden)
