"""Changes of a profile by options: `--set KEY=VALUE`, --period and the goal of `plan`; and how to write them again."""

import os
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import combinations
from string import ascii_letters, digits
from typing import TYPE_CHECKING, Final, NamedTuple

from busplan.english import has_controls, listed
from busplan.errors import BusplanError, PlacedError

if TYPE_CHECKING:
    from busplan.sections.profile import Profile
    from busplan.sourced import ChangedConstants

SET: Final = "--set"
CONSTANTS: Final = "constants"
"""Section of --set for constants of the model, as in constants.ARBITRATION_HOLD_US."""
_KEY: Final = re.compile(
    rf"[A-Za-z0-9_-]{{1,100}}(?:\.[A-Za-z0-9_-]{{1,100}}){{0,9}}|{CONSTANTS}\.[A-Za-z0-9_]{{1,100}}\[[A-Za-z0-9_-]{{1,100}}\]"
)
_WORD: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_VALUE: Final = "value"
UNITS: Final = {
    "us": {"us": 0, "ms": 3, "s": 6},
    "mm": {"um": -3, "mm": 0, "m": 3},
    "m": {"mm": -3, "m": 0},
    "kbit_s": {"kbit/s": 0, "Mbit/s": 3},
}
"""Units in which a value may be written, as powers of ten, by the unit at the end of its key."""
_WITH_UNIT: Final = re.compile(
    r"(?P<number>-?(?:[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]{1,3})?|\.[0-9]+))\s*(?P<unit>[a-zA-Z][a-zA-Z/]*)"
)
_MOST_SHOWN: Final = 100
"""Length up to which a message repeats an option in full [characters]."""


class KeyChange(NamedTuple):
    """A new value of one key, and the option that sets it."""

    key: str
    value: object
    option: str = SET
    text: str = ""
    """Value of the option as typed."""
    note: str = ""
    """The profile's value, where it differs from what was typed: ", in us 500.0"."""

    @property
    def typed(self) -> str:
        """The option with its value as typed, shortened if it is long."""
        text = self.text if len(self.text) <= _MOST_SHOWN else f"{self.text[:_MOST_SHOWN]}..."
        return f"{self.option} {text}"

    @property
    def sections(self) -> tuple[str, ...]:
        """Parts of the key."""
        return tuple(self.key.split("."))


@dataclass(frozen=True)
class KeyChanges:
    """Changes that are applied together, in any order.

    Two that set the same key, or a key and the table around it, raise BusplanError.
    """

    entries: tuple[KeyChange, ...] = ()

    def __post_init__(self) -> None:
        for first, second in combinations(self.entries, 2):
            require_separate(first, second.key, typed=second.typed)

    @property
    def values(self) -> dict[str, object]:
        """New value by dotted key of the profile."""
        return {change.key: change.value for change in self.of_profile.entries}

    @property
    def constants(self) -> tuple[KeyChange, ...]:
        """Changes of constants, which are no keys of a profile."""
        return tuple(change for change in self.entries if change.sections[0] == CONSTANTS)

    @property
    def changed_constants(self) -> "ChangedConstants":
        """Changed constants by name, those in force before included.

        An unknown constant, or a value that is no finite number, raises BusplanError.
        """
        from busplan.sourced import changed_constants  # noqa: PLC0415 - loads tomllib, which --help does not need

        if not self.constants:
            return changed_constants()
        from busplan.profile.constants import constants_of  # noqa: PLC0415 - loads all kinds of bus

        new = {change.key: change.value for change in self.constants}
        named = constants_of(new, None, {change.key: change.typed for change in self.constants})
        return tuple(sorted((dict(changed_constants()) | named).items()))

    @property
    def by_set(self) -> tuple[KeyChange, ...]:
        """Changes by --set. Every answer shows those by other options."""
        return tuple(change for change in self.entries if change.option == SET)

    @property
    def words(self) -> str:
        """The --set options as typed; empty without them."""
        return " and ".join(change.typed for change in self.by_set)

    @property
    def of_profile(self) -> "KeyChanges":
        """Changes of keys, without those of constants."""
        return KeyChanges(tuple(change for change in self.entries if change.sections[0] != CONSTANTS))

    def without(self, *, key: str) -> "KeyChanges":
        """Changes without that of a key."""
        return KeyChanges(tuple(change for change in self.entries if change.key != key))

    def applied(self, profile: "Profile") -> "Profile":
        """The profile with all changes, validated once.

        A change that the schema refuses raises BusplanError, which names its option; so does an unknown constant.
        """
        from busplan.profile.document import override  # noqa: PLC0415 - loads pydantic, which --help does not need

        return override(
            profile,
            {change.key: change.value for change in self.entries},
            origin={change.key: f"{change.typed}{change.note}" for change in self.entries},
        )


NO_CHANGES: Final = KeyChanges()


def require_separate(change: KeyChange, key: str, *, typed: str) -> None:
    """Raise BusplanError if a change sets the key of another option, a section of it or one around it.

    `typed` is the other option with its value.
    """
    parts, other_parts = change.sections, tuple(key.split("."))
    shared = min(len(parts), len(other_parts))
    if parts[:shared] != other_parts[:shared]:
        return
    inner, outer = (change.key, key) if len(parts) > len(other_parts) else (key, change.key)
    why = f"both set {key}" if parts == other_parts else f"{inner} is inside {outer}"
    raise BusplanError(f"{change.typed} and {typed}: {why}; give one of them")


def parse_set(texts: Sequence[str]) -> tuple[KeyChange, ...]:
    """Changes of --set options, each KEY=VALUE.

    Another form, or a value that is not TOML, raises BusplanError.

    Examples
    --------
    >>> [(change.key, change.value) for change in parse_set(["bus.speed=S200", "node.execution.time_us=[30, 40.5]"])]
    [('bus.speed', 'S200'), ('node.execution.time_us', [30, 40.5])]
    """
    return tuple(map(_parsed, texts))


def _parsed(text: str) -> KeyChange:
    key, equals, written = (part.strip() for part in text.partition("="))
    if not equals or not written or not _KEY.fullmatch(key):
        raise BusplanError(f"{SET} {text}: expected KEY=VALUE with a dotted key of the profile, as cycle.period_us=500")
    if with_unit := _WITH_UNIT.fullmatch(written):
        unit = _unit_of(key)
        value = in_unit(with_unit["number"], with_unit["unit"], unit)
        if value is not None:
            return KeyChange(key, value, text=f"{key}={written}", note=f", in {unit} {value:g}")
        if unit:
            raise BusplanError(f"{SET} {text}: expected a number in {listed([*UNITS[unit]], 'or')}")
        # The schema reports what would be right: another key, or a number alone.
        return KeyChange(key, written, text=f"{key}={written}")
    return KeyChange(key, _value(written, name=f"{SET} {text}"), text=f"{key}={written}")


def _unit_of(key: str) -> str:
    """Unit at the end of a key; empty for one that takes none."""
    return next((unit for unit in UNITS if key.endswith(f"_{unit}")), "")


def in_unit(number: str, written: str, unit: str) -> float | None:
    """Convert a number, as typed, from its written unit to a key of `UNITS`.

    The conversion is exact; a unit of another quantity gives None.

    Examples
    --------
    >>> in_unit("0.0003", "s", "us"), in_unit("1", "Mbit/s", "kbit_s"), in_unit("1", "m", "us")
    (300, 1000, None)
    """
    exponent = UNITS.get(unit, {}).get(written)
    if exponent is None:
        return None
    value = float(Decimal(number).scaleb(exponent))
    return int(value) if value.is_integer() else value


def without_units(values: str, *, key: str) -> str:
    """Values of a key as typed, each number with a unit converted to that of the key.

    A unit of another quantity stays.

    Examples
    --------
    >>> without_units("0.25ms:1ms:50us", key="cycle.period_us"), without_units("S200,S400", key="bus.speed")
    ('250:1000:50', 'S200,S400')
    """

    def converted(match: re.Match[str]) -> str:
        value = in_unit(match["number"], match["unit"], _unit_of(key))
        return match[0] if value is None else repr(value)

    return re.sub(rf"(?<![^,:\s]){_WITH_UNIT.pattern}(?![^,:\s])", converted, values)


def _value(written: str, *, name: str) -> object:
    """Parse a TOML value; a bare word is text."""
    from busplan.profile.document import Document, number_meant  # noqa: PLC0415 - as above

    try:
        data = Document(SET, f"{_VALUE} = {written}").data()
    except PlacedError:
        data = {}
    if set(data) == {_VALUE}:
        return data[_VALUE]
    if _WORD.fullmatch(written):
        return written
    if meant := number_meant(written):
        raise BusplanError(f"{name}: {written} is not a TOML value{meant}")
    raise BusplanError(
        f"{name}: {written} is not a TOML value; expected a number with or without its unit, true or false, a word, "
        'text in quotes, as "two words", an array, as [4, 16], or a table, as {kind = "linear", base_us = 30}'
    )


def shell_word(text: str) -> str:
    """Quote an argument for a shell.

    Examples
    --------
    >>> shell_word("line 1.toml"), shell_word("-x.toml"), shell_word("-")
    ("'line 1.toml'", './-x.toml', '-')
    """
    if text.startswith("-") and text != "-":
        # Quotes do not stop a program from taking it for an option.
        text = f"./{text}"
    if not has_controls(text):
        return shlex.quote(text)
    # Control characters need $'...', which bash, zsh and POSIX 2024 support.
    plain = f"{ascii_letters}{digits}/._-+ "
    escaped = (chr(byte) if chr(byte) in plain else f"\\x{byte:02x}" for byte in os.fsencode(text))
    return f"$'{''.join(escaped)}'"


def period_option(period_us: float) -> tuple[str, str]:
    """The --period option that gives exactly this period.

    Examples
    --------
    >>> period_option(500.0), period_option(0.1)
    (('--period', '500us'), ('--period', '0.1us'))
    """
    return "--period", f"{repr(period_us).removesuffix('.0')}us"


def change_options(changes: KeyChanges, *, period_us: float) -> Iterator[str]:
    """Options of the changes, quoted for a shell; --period with the profile's period [us]."""
    for change in changes.entries:
        yield from period_option(period_us) if change.option == "--period" else (change.option, shell_word(change.text))
