"""Numbers and equations with their sources, numbers with a grade of certainty, and inputs of a derivation."""

import re
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from functools import lru_cache, wraps
from importlib.resources import files
from math import nan
from threading import Lock
from types import MappingProxyType, SimpleNamespace
from typing import Any, Final, Literal, NamedTuple, ParamSpec, Self, TypeAlias, TypeVar, cast

Grade = Literal["published", "derived", "recalled", "measured", "calibrated", "assumed"]
"""Grade of a number: how well it is known.

published: read in a public source; derived: computed from published figures; recalled: general knowledge
that no source opened so far confirms; measured: taken on a machine; calibrated: fitted so that the model meets
published figures; assumed: chosen.
"""


class Sourced(float):
    """A float with its unit, grade and source; arithmetic gives plain floats (or arrays).

    Parameters
    ----------
    value
        The number, in `unit`.
    unit
        The unit in words, or "1" for a plain number.
    grade
        How well the number is known.
    source
        Where it stands: equation, table, document.
    meaning
        What the number is, in one line.
    symbol
        Symbol in formulas; without it, formulas show the value.
    name
        Name among the constants of its kind of bus; without it, the meaning.

    Examples
    --------
    >>> delay = Sourced(14, unit="ticks", grade="published", source="eqs (4)-(6)", meaning="delay of a node")
    >>> delay / 7
    2.0
    >>> delay.source
    'eqs (4)-(6)'
    """

    __slots__ = ("grade", "meaning", "name", "source", "symbol", "unit")

    unit: str
    grade: Grade
    source: str
    meaning: str
    symbol: str
    name: str

    def __new__(
        cls, value: float, *, unit: str, grade: Grade, source: str, meaning: str, symbol: str = "", name: str = ""
    ) -> Self:
        """Make the number; see the class."""
        number = super().__new__(cls, value)
        number.unit = unit
        number.grade = grade
        number.source = source
        number.meaning = meaning
        number.symbol = symbol
        number.name = name or meaning
        return number

    def __getnewargs_ex__(self) -> tuple[tuple[float], dict[str, str]]:
        # Pickle and copy make the number as any caller must, and then set its slots.
        words = {"unit": self.unit, "grade": self.grade, "source": self.source, "meaning": self.meaning}
        return (float(self),), words


def read_toml(package: str, name: str) -> dict[str, Any]:
    """Read a TOML file that lies in a package."""
    return tomllib.loads((files(package) / name).read_text(encoding="utf-8"))


ChangedConstants: TypeAlias = tuple[tuple[str, float], ...]
"""Other values of constants by name."""
_CHANGED: Final[ContextVar[ChangedConstants]] = ContextVar("changed constants", default=())


def changed_constants() -> ChangedConstants:
    """Other values of constants that hold where this is called."""
    return _CHANGED.get()


def constants_changed(changed: ChangedConstants) -> AbstractContextManager[None]:
    """Compute with these other values of constants, and no others; each thread has its own.

    Examples
    --------
    >>> paper = Constants("busplan.buses.ieee1394")
    >>> with constants_changed((("MAX_HOPS", 8.0),)):
    ...     paper.MAX_HOPS, paper.MAX_HOPS.grade
    (8.0, 'assumed')
    >>> paper.MAX_HOPS
    16.0
    """
    return _set(_CHANGED, changed)


_LOOKED_UP: Final[ContextVar[Callable[["Sourced"], Any] | None]] = ContextVar("constants looked up", default=None)


def constants_looked_up(form: Callable[[Sourced], Any] | None) -> AbstractContextManager[None]:
    """Give constants in another form where they are looked up, as traced numbers; None for plain constants."""
    return _set(_LOOKED_UP, form)


_LOCK: Final = Lock()
_OTHERS: Final[list[object]] = []
"""Other values and forms that hold now in any thread. Without any, a constant that was looked up is an attribute, which
is as fast as a name of a module."""
_ALL: Final[list["Constants"]] = []


@contextmanager
def _set(variable: ContextVar[Any], value: object) -> Iterator[None]:
    """Set a variable; while it has a value, all threads look constants up wherever they are used."""
    if value:
        with _LOCK:
            for constants in () if _OTHERS else _ALL:
                for name in constants:
                    vars(constants).pop(name, None)
            _OTHERS.append(value)
    token = variable.set(value)
    try:
        yield
    finally:
        variable.reset(token)
        if value:
            with _LOCK:
                _OTHERS.pop()


_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


def cached(maxsize: int) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]:
    """Decorator as `lru_cache`, for a function that computes with constants: other values have other results."""

    def kept(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
        @lru_cache(maxsize)
        def of_constants(_: ChangedConstants, *given: Any, **named: Any) -> _Result:
            return function(*given, **named)

        @wraps(function)
        def of_these(*given: Any, **named: Any) -> _Result:
            if _LOOKED_UP.get():
                with constants_looked_up(None):
                    return of_these(*given, **named)
            return of_constants(_CHANGED.get(), *given, **named)

        return cast("Callable[_Parameters, _Result]", of_these)

    return kept


class Constants(Mapping[str, Sourced]):
    """Sourced constants of a kind of bus by name, in the order of their TOML files; attributes, too.

    A table `[NAME]` has the value and the words of one constant, `[NAME.KEY]` one of several by key; it is called
    NAME[KEY]. A table in small letters is a group. What stands in a group, or in `[NAME]` beside keys, holds for
    all of it. Python computes what has no value. A constant is looked up where it is used, for `constants_changed` may
    give it another value; one with `fixed`, the reason, keeps its own.

    Parameters
    ----------
    package
        The package that the files lie in; without it there are no constants.
    names
        Names of the files; `constants.toml` without any.
    beside
        Words of a table that are of no constant; `beside` has them, by the table's name.

    Examples
    --------
    >>> paper = Constants("busplan.buses.ieee1394")
    >>> paper.MAX_HOPS, paper.MAX_HOPS.source, paper.by_key("DATA_RATE_MBIT_S")["S100"].name
    (16.0, 'paper, section I; IEEE project page', 'DATA_RATE_MBIT_S[S100]')
    """

    def __init__(self, package: str = "", *names: str, beside: Collection[str] = ()) -> None:
        with _LOCK:
            _ALL.append(self)
        self.fixed: dict[str, str] = {}
        """Why a constant cannot be changed, by name."""
        self._own: dict[str, Sourced] = {}
        self._formulas: dict[str, Callable[[Any], float]] = {}
        self._versions: dict[ChangedConstants, dict[str, Sourced]] = {}
        self._tables: dict[tuple[ChangedConstants, str], Mapping[str, Sourced]] = {}
        self.beside: dict[str, dict[str, Any]] = {}
        for file in (names or ("constants.toml",)) if package else ():
            tables = read_toml(package, file)
            for name, table in tables.items() if beside else ():
                if found := {word: table.pop(word) for word in beside if word in table}:
                    self.beside[name] = found
            for name, words in _entries("", tables):
                if why := words.pop("fixed", ""):
                    self.fixed[name] = why
                self._own[name] = Sourced(**{"value": nan, **words}, name=name)

    def __getitem__(self, name: str) -> Sourced:
        return _in_form(self._numbers(_CHANGED.get())[name])

    def __getattr__(self, name: str) -> Sourced:
        # Reached only where the instance has no such attribute.
        changed = _CHANGED.get()
        try:
            number = (self._versions.get(changed) or self._numbers(changed))[name]
        except KeyError:
            raise AttributeError(f"no constant {name}") from None
        if not _OTHERS:
            with _LOCK:
                if not _OTHERS:
                    vars(self)[name] = number
        return _in_form(number)

    def __iter__(self) -> Iterator[str]:
        return iter(self._own)

    def __len__(self) -> int:
        return len(self._own)

    @property
    def unchanged(self) -> Mapping[str, Sourced]:
        """The constants as they are published, whatever is changed: for what holds of every call, as a schema does."""
        return MappingProxyType(self._numbers(()))

    def computed(self, name: str, formula: Callable[[Any], float]) -> None:
        """Give a constant the value that its file leaves to Python: a formula of the constants, by attribute."""
        self._formulas[name] = formula
        self._versions.clear()
        self._tables.clear()

    def by_key(self, name: str) -> Mapping[str, Sourced]:
        """Constants of one name by key."""
        changed = _CHANGED.get()
        table = self._tables.get((changed, name))
        if table is None:
            start, numbers = f"{name}[", self._numbers(changed)
            of_name = {key[len(start) : -1]: number for key, number in numbers.items() if key.startswith(start)}
            table = self._tables[changed, name] = MappingProxyType(of_name)
        return {key: _in_form(number) for key, number in table.items()} if _LOOKED_UP.get() else table

    def _numbers(self, changed: ChangedConstants) -> dict[str, Sourced]:
        """All constants with other values, and what is computed of these."""
        if changed in self._versions:
            return self._versions[changed]
        values = {name: value for name, value in changed if name not in self.fixed}
        numbers = {name: _as_changed(number, values.get(name)) for name, number in self._own.items()}
        for name, formula in self._formulas.items():
            value = formula(SimpleNamespace(**numbers))
            number = _with(self._own[name], value)
            if changed and value != (before := self._numbers(())[name]):
                number = _as_changed(_with(number, before), value)
            numbers[name] = _as_changed(number, values.get(name))
        if len(self._versions) >= _KEPT:
            self._versions.clear()
            self._tables.clear()
        self._versions[changed] = numbers
        return numbers


def _in_form(number: Sourced) -> Sourced:
    """A constant as it is asked for; see `constants_looked_up`."""
    form = _LOOKED_UP.get()
    return form(number) if form else number


_KEPT: Final = 64
"""Most sets of changed constants that are kept."""


def _with(number: Sourced, value: float, **other: str) -> Sourced:
    words = {slot: getattr(number, slot) for slot in Sourced.__slots__}
    return Sourced(value, **{**words, **other})


def _as_changed(number: Sourced, value: float | None) -> Sourced:
    """A constant, or with another value, which is assumed."""
    if value is None:
        return number
    return _with(number, value, grade="assumed", source=f"changed, was {number:g}: {number.source}")


def _entries(name: str, table: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and words of each constant in a table."""
    words = {key: value for key, value in table.items() if not isinstance(value, dict)}
    tables = {key: value for key, value in table.items() if key not in words}
    if not tables:
        yield name, words
    for key, entry in tables.items():
        yield from _entries(f"{name}[{key}]" if name.isupper() else key, {**words, **entry})


class Input(NamedTuple):
    """An input of a derivation.

    Parameters
    ----------
    symbol
        Symbol in formulas.
    name
        Its key in the profile, or its name among the constants.
    value
        The number, or the word.
    unit
        Unit in words; "1" for a plain number, empty for a word.
    grade
        How well it is known: a `Grade`, or "given" for a choice of the profile.
    source
        Where it stands.
    meaning
        What it is, in one line.
    """

    symbol: str
    name: str
    value: float | str
    unit: str
    grade: str
    source: str
    meaning: str


def input_of(number: Sourced) -> Input:
    """Make an input from a sourced constant; without a symbol, formulas show its value.

    Examples
    --------
    >>> from busplan.buses.ieee1394.constants import c
    >>> input_of(c.DATA_END_US)[:4]
    ('0.25', 'DATA_END_US', 0.25, 'us')
    """
    value = float(number)
    return Input(
        number.symbol or short(value), number.name, value, number.unit, number.grade, number.source, number.meaning
    )


DIGITS: Final = 7


def short(value: object) -> str:
    """Write a number with up to seven significant digits, enough to check it with a pocket calculator.

    Examples
    --------
    >>> short(393.216), short(4000.0), short(2.38808777), short(True), short("time"), short(None)
    ('393.216', '4000', '2.388088', 'yes', 'time', '-')
    """
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.{DIGITS}g}" if isinstance(value, (int, float)) else str(value)


class Equation(NamedTuple):
    """A function that computes a published equation, or a part of it.

    Parameters
    ----------
    numbers
        Number of the equation; several if they share the part.
    symbol
        Symbol of the result in the source.
    section
        Where it stands in the source.
    part
        Part of the equation; empty for all of it.
    function
        The function itself.
    """

    numbers: tuple[int, ...]
    symbol: str
    section: str
    part: str
    function: Callable[..., Any]

    @property
    def reference(self) -> str:
        """Numbers of the equation as in tables: (6) or (4)-(6)."""
        first, last = self.numbers[0], self.numbers[-1]
        return f"({first})" if first == last else f"({first})-({last})"

    @property
    def source(self) -> str:
        """Source in words."""
        noun = "equation" if len(self.numbers) == 1 else "equations"
        whole = f"Paper, section {self.section}, {noun} {self.reference}"
        return f"{whole}; {self.part}" if self.part else whole


EQUATIONS: Final[dict[str, Equation]] = {}
"""Equations by the name of their function; filled by `published`."""
SYMBOLS: Final[dict[str, str]] = {}
"""Symbols of quantities by parameter name; filled by the modules of equations."""

_Function = TypeVar("_Function", bound=Callable[..., object])


def published(*numbers: int, symbol: str, section: str, part: str = "") -> Callable[[_Function], _Function]:
    """Decorator that adds a function to `EQUATIONS`, and its source to its docstring.

    Parameters
    ----------
    numbers, symbol, section, part
        As in `Equation`.

    Examples
    --------
    >>> equation = Equation((4, 5, 6), "delay", "III-E", "their bracket", float)
    >>> equation.reference, equation.source
    ('(4)-(6)', 'Paper, section III-E, equations (4)-(6); their bracket')
    """

    def enter(function: _Function) -> _Function:
        equation = Equation(numbers, symbol, section, part, function)
        EQUATIONS[function.__name__] = equation
        if function.__doc__:  # python -OO removes docstrings
            before, indent, examples = re.split(r"(?m)^( *)(?=Examples\n)", function.__doc__, maxsplit=1)
            references = "".join(f"{indent}{line}\n" for line in ("References", "----------", f"{equation.source}."))
            function.__doc__ = f"{before}{references}\n{indent}{examples}"
        return function

    return enter
