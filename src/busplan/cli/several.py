"""What commands of several profiles share: reading them all, and one progress over all of their work."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from busplan.errors import BusplanError
from busplan.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from busplan.sections.profile import Profile

_PARTS: Final = 1000
"""Parts of one piece of work that the whole's progress counts."""


def load_each(arguments: Iterable[str], load: "Callable[[str], Profile]") -> "list[Profile]":
    """Read every profile.

    Parameters
    ----------
    arguments
        PROFILE arguments; standard input may be one of them.
    load
        Reads one.

    Raises
    ------
    BusplanError
        Standard input more than once; or what is wrong with any of them, said of all together.
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
    """The progress of one of several pieces of work, each taken for as long as the others.

    Parameters
    ----------
    progress
        Of the whole.
    number
        Which piece, from 0.
    of
        How many there are.
    """

    def report(done: int, total: int) -> None:
        progress(number * _PARTS + done * _PARTS // total, of * _PARTS)

    return report
