"""Errors for the user, with and without a place in a file."""

import re
from collections.abc import Callable, Iterable, Mapping
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


class ArgumentError(BusplanError):
    """A wrong argument of a question: each problem begins with the argument's name, then its value or a colon.

    A second argument may follow after "and", before the colon.
    """

    def typed(self, options: Iterable[str]) -> BusplanError:
        """The error of a command with some options: it names the one that gives the argument, as typed."""
        names = {option.lstrip("-").replace("-", "_"): option for option in options}
        return BusplanError(*(_typed(problem, names) for problem in self.problems))


def _typed(problem: str, names: Mapping[str, str]) -> str:
    def option(match: re.Match[str]) -> str:
        # An argument may end in its unit, which is typed with the value of an option.
        given = (option for name, option in names.items() if f"{match[0]}_".startswith(f"{name}_"))
        return next(given, match[0])

    arguments, colon, why = problem.partition(":")
    return f"{re.sub(_ARGUMENTS, option, arguments)}{colon}{why}"


_ARGUMENTS: Final = re.compile(r"^\w+|(?<= and )\w+(?= |$)")


class WorkerLostError(BusplanError):
    """A worker process ended in the middle of its work."""


ProblemKind = Literal[
    "syntax", "unknown-key", "missing-key", "wrong-type", "out-of-range", "inconsistent", "execution-unknown"
]
"""Kinds of problems; each has a rule of the gate."""


_MOST_SHOWN: Final = 50


class PlacedProblem(NamedTuple):
    """A problem at a place in a file; lines and columns count from 1."""

    line: int
    column: int
    kind: ProblemKind
    message: str
    key: str = ""
    """Dotted key of the problem; empty without one."""
    marked: tuple[int, int] | None = None
    """First column of the mark, and the column after its last; None if it has no end."""


class PlacedError(BusplanError):
    """An invalid file, with all its problems and their places.

    Problems are at least one, in the order of their places. Of very many only the first are listed; `hidden` is the
    number of the others.
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
