"""Numbers that remember how they were computed, so that a figure can show its own derivation.

The equations are operators only: given `Traced` numbers they compute what they always compute, and leave an expression
behind. What a line of a derivation shows is therefore what was executed, and not a second writing of it.
"""

import operator
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from busplan.buses.ieee1394.constants import CONSTANTS
from busplan.sourced import Sourced


class Input(NamedTuple):
    """A number that a derivation starts from.

    Parameters
    ----------
    symbol
        What stands for it in formulas.
    name
        Its key in the profile, or its name among the constants.
    value
        The number, or the word.
    unit
        Unit in words; "1" for a plain number, empty for a word.
    grade
        How well it is known: a `Grade`; "given" for what the profile sets and nobody measures.
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


class _Operation(NamedTuple):
    sign: str
    rank: int
    compute: Callable[[Any, Any], Any]


OPERATIONS: Final[Mapping[str, _Operation]] = MappingProxyType(
    {
        "add": _Operation("+", 1, operator.add),
        "sub": _Operation("-", 1, operator.sub),
        "mul": _Operation("*", 2, operator.mul),
        "truediv": _Operation("/", 2, operator.truediv),
        "pow": _Operation("^", 3, operator.pow),
    }
)
Operand = Any
"""A `Traced` number, a `Sourced` one, or a plain one."""


class Traced:
    """A number, or the word that follows from numbers, with the expression it comes from.

    Parameters
    ----------
    value
        The number itself.
    operation
        Name of the operation, where it was computed from `parts`.
    parts
        Operands, or whatever else it was computed from.
    formula, numbers
        The same in words, where no operator computed it.
    given
        The input that it is.
    """

    __slots__ = ("formula", "given", "key", "numbers", "operation", "parts", "symbol", "value")

    def __init__(
        self,
        value: Any,
        *,
        operation: str = "",
        parts: tuple[Operand, ...] = (),
        formula: str = "",
        numbers: str = "",
        given: Input | None = None,
    ) -> None:
        self.value = value
        self.operation = operation
        self.parts = parts
        self.formula = formula
        self.numbers = numbers
        self.given = given
        self.key = ""
        self.symbol = given.symbol if given else ""

    def named(self, key: str, symbol: str) -> "Traced":
        """Give a computed number its name, once: from then on it is a line of its own."""
        if not self.symbol:
            self.key, self.symbol = key, symbol
        return self

    def __add__(self, other: Operand) -> Any:
        return _computed("add", self, other)

    def __radd__(self, other: Operand) -> Any:
        return _computed("add", other, self)

    def __sub__(self, other: Operand) -> Any:
        return _computed("sub", self, other)

    def __rsub__(self, other: Operand) -> Any:
        return _computed("sub", other, self)

    def __mul__(self, other: Operand) -> Any:
        return _computed("mul", self, other)

    def __rmul__(self, other: Operand) -> Any:
        return _computed("mul", other, self)

    def __truediv__(self, other: Operand) -> Any:
        return _computed("truediv", self, other)

    def __rtruediv__(self, other: Operand) -> Any:
        return _computed("truediv", other, self)

    def __pow__(self, other: Operand) -> Any:
        return _computed("pow", self, other)

    # Equal to what has its value, as a float is; found again by what it is, not by what it equals.
    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        return bool(self.value == value_of(other))

    def __lt__(self, other: Operand) -> bool:
        return bool(self.value < value_of(other))

    def __le__(self, other: Operand) -> bool:
        return bool(self.value <= value_of(other))

    def __gt__(self, other: Operand) -> bool:
        return bool(self.value > value_of(other))

    def __ge__(self, other: Operand) -> bool:
        return bool(self.value >= value_of(other))


def value_of(operand: Operand) -> Any:
    """Give the plain number behind any operand."""
    found = operand.value if isinstance(operand, Traced) else operand
    return float(found) if isinstance(found, Sourced) else found


def _computed(name: str, left: Operand, right: Operand) -> Any:
    """The result of an operation; a plain 0 or 1 that changes nothing, as a comparison gives it, leaves no trace."""
    for one, other in ((left, right), (right, left)):
        if _is_switch(one, 0) and name == "mul":
            return 0.0
        if (_is_switch(one, 0) and name == "add") or (_is_switch(one, 1) and name == "mul"):
            return other
    if _is_switch(right, 0 if name == "sub" else 1) and name in ("sub", "truediv"):
        return left
    compute = OPERATIONS[name].compute
    return Traced(compute(value_of(left), value_of(right)), operation=name, parts=(left, right))


def _is_switch(operand: Operand, value: int) -> bool:
    return not isinstance(operand, (Traced, Sourced)) and operand == value


DIGITS: Final = 7


def short(value: object) -> str:
    """Write a number with as many digits as a reader puts into a pocket calculator.

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


def lines(figure: Traced) -> Iterator[Traced]:
    """Every named number that a figure is computed from, before what is computed from it; the figure last."""
    yield from (one for one in _visit(figure, set()) if not one.given and (one.symbol or one is figure))


def inputs(figure: Traced) -> Iterator[Input]:
    """Everything that a figure's derivation starts from: of the profile and of the constants, each once."""
    found: dict[tuple[str, str], Input] = {}
    for one in _visit(figure, set()):
        for leaf in (one.given, *(constant(part) for part in one.parts if isinstance(part, Sourced))):
            if leaf is not None:
                found.setdefault((leaf.name, leaf.symbol), leaf)
    yield from found.values()


_NAMES: Final = {id(number): name for name, number in CONSTANTS.items()}


def constant(number: Sourced, *, symbol: str = "") -> Input:
    """Give a sourced constant as an input; without a symbol, formulas show its value.

    Examples
    --------
    >>> constant(CONSTANTS["DATA_END_US"])[:4]
    ('0.25', 'DATA_END_US', 0.25, 'us')
    """
    value = float(number)
    name = _NAMES.get(id(number), number.meaning)
    return Input(symbol or short(value), name, value, number.unit, number.grade, number.source, number.meaning)


def _visit(one: Traced, seen: set[int]) -> Iterator[Traced]:
    if id(one) in seen:
        return
    seen.add(id(one))
    for part in one.parts:
        if isinstance(part, Traced):
            yield from _visit(part, seen)
    yield one
