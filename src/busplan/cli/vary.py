"""Parse `--vary KEY=VALUES`."""

from typing import TYPE_CHECKING

from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.analysis.sweep.grid import Values
    from busplan.sections.profile import Profile


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
    from busplan.analysis.sweep.axis_values import parse_values
    from busplan.profile.kinds import words_of

    axes: dict[str, Values] = {}
    for text in texts:
        key, equals, spec = (part.strip() for part in text.partition("="))
        if not equals or not key or not spec:
            raise BusplanError(f"--vary {text}: expected KEY=VALUES, as bus.nodes=1:62 or cycle.period_us=250,500,1000")
        if key in axes:
            raise BusplanError(f"--vary {text}: {key} is varied already; give all its values at once")
        axes[key] = parse_values(spec, name=f"--vary {text}", words=words_of(profile, key))
    return axes
