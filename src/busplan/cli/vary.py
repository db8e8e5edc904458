"""Parse `KEY=VALUES`, as --vary has it."""

from typing import TYPE_CHECKING, Final

from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.questions.sweep.grid import Values
    from busplan.sections.profile import Profile

VALUES_HELP: Final = (
    "250,500,1000 or a range A:B (in steps of 1), A:B:STEP, A:B:*FACTOR, A:B:#COUNT (evenly, both ends). Words that "
    "the key takes, as optimal, may be among the values."
)


def parse_axes(texts: list[str], *, profile: "Profile") -> dict[str, "Values"]:
    """Parse all --vary options, in order.

    Parameters
    ----------
    texts
        Values of the options.
    profile
        The network, whose kind of bus defines the words allowed instead of numbers.

    Raises
    ------
    BusplanError
        No option, a repeated key, or invalid values.
    """
    if not texts:
        raise BusplanError("--vary: nothing to vary; give a key of the profile and its values, as bus.nodes=1:62")
    from busplan.questions.sweep import axis_values

    axes: dict[str, Values] = {}
    for text in texts:
        key, words = parse_axis(text, option="--vary")
        values = axis_values(profile, key, words, name="--vary")
        if key in axes:
            raise BusplanError(f"--vary {text}: {key} is varied already; give all its values at once")
        axes[key] = values
    return axes


def parse_axis(text: str, *, option: str) -> tuple[str, str]:
    """Parse one KEY=VALUES: the key, and the text of its values.

    Parameters
    ----------
    text
        Value of the option.
    option
        Name of the option.

    Raises
    ------
    BusplanError
        Not KEY=VALUES.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not equals or not key or not values:
        raise BusplanError(f"{option} {text}: expected KEY=VALUES, as bus.nodes=1:62 or cycle.period_us=250,500,1000")
    return key, values
