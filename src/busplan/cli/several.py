"""Common part of commands with several profiles: read them all."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from busplan.errors import BusplanError

if TYPE_CHECKING:
    from collections.abc import Callable

    from busplan.sections.profile import Profile


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
