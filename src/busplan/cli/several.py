"""Common parts of commands with several profiles: read them all, and show one progress."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from busplan.errors import BusplanError
from busplan.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from busplan.sections.profile import Profile

_PARTS: Final = 1000
"""Progress steps of one piece of work."""


def load_each(arguments: Iterable[str], load: "Callable[[str], Profile]") -> "list[Profile]":
    """Read every profile.

    Parameters
    ----------
    arguments
        PROFILE arguments; standard input may be one of them.
    load
        Function that reads one.

    Raises
    ------
    BusplanError
        Standard input more than once; or the problems of all profiles together.
    """
    plans: list[Profile] = []
    problems: list[str] = []
    asked = list(arguments)
    if asked.count("-") > 1:
        raise BusplanError("-: standard input can be read once; give files for the others")
    for argument in asked:
        try:
            plans.append(load(argument))
        except BusplanError as error:
            problems.extend(error.problems)
    if problems:
        raise BusplanError(*dict.fromkeys(problems))
    return plans


def part_of(progress: Progress, *, number: int, of: int) -> Progress:
    """Progress of one of several equal pieces of work.

    Parameters
    ----------
    progress
        Progress of all pieces.
    number
        Number of the piece, from 0.
    of
        Number of pieces.
    """

    def report(done: int, total: int) -> None:
        progress(number * _PARTS + done * _PARTS // total, of * _PARTS)

    return report
