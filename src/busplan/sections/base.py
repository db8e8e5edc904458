"""Base of all sections of a profile: strictness, ranges, and error messages of our own."""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Annotated, Any, Final, Literal, NamedTuple, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from busplan.errors import ProblemKind
from busplan.servo.parameters import LARGEST, SHORTEST_STEP_US

# Bounds that no machine comes near; they keep every product of two quantities finite.
MAX_TIME_US: Final = LARGEST
MIN_STEP_US: Final = SHORTEST_STEP_US
MAX_COUNT: Final = 1_000_000
MAX_GROUPS: Final = 500
"""Most groups: each is counted beside all others."""

TimeUs = Annotated[float, Field(ge=0, le=MAX_TIME_US, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=MAX_COUNT)]
Bytes = Annotated[int, Field(ge=0, le=MAX_COUNT)]


def groups_field(most: float = MAX_GROUPS) -> Any:
    """An array of groups: strictness would refuse TOML's array for a tuple; the tables stay strict."""
    return Field(strict=False, max_length=int(most))


MISSING: Final = "Field required"
"""Message of a missing key; its reporter adds what the key is."""


class Problem(NamedTuple):
    """A problem of a profile."""

    message: str
    key: str | None = None
    """Dotted key of the problem, below the validated section; None for the section itself."""
    kind: ProblemKind = "out-of-range"


def refused(*problems: Problem) -> PydanticCustomError:
    """Error with our own words; a validator can report several problems, each with its own key."""
    return PydanticCustomError("busplan", "{text}", {"text": problems[0].message, "problems": problems})


def _title(section: type) -> str:
    """Title of a section: its class; for a section of a kind of bus, the section that it extends."""
    titles = (base.__name__.removesuffix("Section") for base in section.__mro__ if base.__name__.endswith("Section"))
    *_, title = (section.__name__, *filter(None, titles))
    return title


class Section(BaseModel):
    """Base of all sections of a profile."""

    model_config = ConfigDict(
        strict=True,
        frozen=True,
        extra="forbid",
        defer_build=True,
        # Editors show the title.
        model_title_generator=_title,
    )

    def _problems(self) -> Iterator[Problem]:
        """Conflicts between values that are each valid; a section that extends another adds its own."""
        yield from ()

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        for check in _checks(type(self)):
            if problems := tuple(check(self)):
                raise refused(*problems)
        return self


@cache
def _checks(section: type[Section]) -> tuple[Callable[[Section], Iterator[Problem]], ...]:
    """The checks of a class, behind those of the classes that it extends, on which they may rely."""
    return tuple(vars(each)["_problems"] for each in reversed(section.__mro__) if "_problems" in vars(each))


_Section = TypeVar("_Section", bound=Section)


def with_unchecked(section: _Section, key: str, value: object) -> _Section:
    """Copy of a section with one key replaced, unvalidated.

    The key is dotted and starts below the section; of several tables of a key, the table's name follows the key. The
    value is anything that computes like a number: an array, or a traced number.
    """
    return with_all_unchecked(section, {key: value})


def with_all_unchecked(section: _Section, values: Mapping[str, object]) -> _Section:
    """Copy of a section with several keys replaced, unvalidated; keys are those of `with_unchecked`."""
    new: dict[str, Any] = {}
    for name, below in _by_first_part(values).items():
        inner = getattr(section, name)
        if "" in below:
            new[name] = below[""]
        elif isinstance(inner, tuple):
            of_table = _by_first_part(below)
            new[name] = tuple(
                with_all_unchecked(table, of_table[table.name]) if table.name in of_table else table for table in inner
            )
        else:
            new[name] = with_all_unchecked(inner, below)
    return section.model_copy(update=new)


def _by_first_part(values: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """Values by first part of their key, then by the rest of it, which is empty at the end."""
    parts: dict[str, dict[str, object]] = {}
    for key, value in values.items():
        name, _, rest = key.partition(".")
        parts.setdefault(name, {})[rest] = value
    return parts


def value_at(section: Section, key: str) -> Any:
    """Value of a dotted key below a section, as `with_unchecked` takes it; None if it has no such key."""
    value: Any = section
    for part in key.split("."):
        value = _by_name(value).get(part) if isinstance(value, tuple) else getattr(value, part, None)
    return value


def beside(key: str, part: str) -> str:
    """Dotted key beside another one: its grade, its uncertainty, or the cycles of which it is the worst.

    Examples
    --------
    >>> beside("bus.master_jitter_us", "cycles"), beside("bus.host_us", "uncertainty_us")
    ('bus.master_jitter_cycles', 'bus.host_uncertainty_us')
    """
    return f"{key.removesuffix('_us')}_{part}"


_KEPT: Final = 8
"""Tuples of tables whose names are kept, at most."""
_named: Final[dict[int, tuple[tuple[Any, ...], dict[str, Any]]]] = {}
"""Tables of a tuple by name, for look-ups among thousands. The tuple is kept with them, so that its identity stays its
own.
"""


def _by_name(tables: tuple[Any, ...]) -> dict[str, Any]:
    if id(tables) not in _named:
        if len(_named) >= _KEPT:
            _named.clear()
        _named[id(tables)] = tables, {table.name: table for table in reversed(tables) if hasattr(table, "name")}
    return _named[id(tables)][1]


TransactionKind = Literal["read", "write"]
TRANSACTION_KINDS: Final[tuple[TransactionKind, ...]] = ("read", "write")
