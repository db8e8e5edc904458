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
    axes: dict[str, Values] = {}
    for text in texts:
        key, values = parse_axis(text, profile=profile, option="--vary")
        if key in axes:
            raise BusplanError(f"--vary {text}: {key} is varied already; give all its values at once")
        axes[key] = values
    return axes


def parse_axis(text: str, *, profile: "Profile", option: str) -> "tuple[str, Values]":
    """Parse one KEY=VALUES.

    Parameters
    ----------
    text
        Value of the option.
    profile
        As in `parse_axes`.
    option
        Name of the option.

    Raises
    ------
    BusplanError
        Not KEY=VALUES, or invalid values.
    """
    from busplan.profile.kinds import words_of
    from busplan.questions.sweep.values import parse_values

    key, equals, spec = (part.strip() for part in text.partition("="))
    if not equals or not key or not spec:
        raise BusplanError(f"{option} {text}: expected KEY=VALUES, as bus.nodes=1:62 or cycle.period_us=250,500,1000")
    return key, parse_values(spec, name=f"{option} {text}", words=words_of(profile, key))
