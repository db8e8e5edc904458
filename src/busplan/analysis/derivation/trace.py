"""Numbers that record how they were computed, so that a figure can show its derivation.

The equations consist of operators, so they accept `Traced` numbers and build an expression while they compute. A line
of a derivation therefore shows what was executed.
"""

import operator
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import ceil, floor, sqrt
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from busplan.analysis.derivation.origin import GivenTable, Input, constant, short
from busplan.elementwise import Number, SpecialNumber
from busplan.sourced import Sourced


class _Operation(NamedTuple):
    sign: str
    rank: int
    """Operator precedence; that of a function is the highest."""
    compute: Callable[..., float]


def _power(base: float, exponent: float) -> float:
    """A power; a root is rounded as that of a plain number."""
    return sqrt(base) if exponent == 0.5 else operator.pow(base, exponent)  # noqa: PLR2004 - the exponent of a root


COMPARISON: Final = 0
FUNCTION: Final = 4
OPERATIONS: Final[Mapping[str, _Operation]] = MappingProxyType(
    {
        "add": _Operation("+", 1, operator.add),
        "sub": _Operation("-", 1, operator.sub),
        "mul": _Operation("*", 2, operator.mul),
        "truediv": _Operation("/", 2, operator.truediv),
        "pow": _Operation("^", 3, _power),
        "lt": _Operation("<", COMPARISON, operator.lt),
        "le": _Operation("<=", COMPARISON, operator.le),
        "gt": _Operation(">", COMPARISON, operator.gt),
        "ge": _Operation(">=", COMPARISON, operator.ge),
        "eq": _Operation("=", COMPARISON, operator.eq),
        "larger": _Operation("max", FUNCTION, max),
        "smaller": _Operation("min", FUNCTION, min),
        "rounded_up": _Operation("ceil", FUNCTION, ceil),
        "rounded_down": _Operation("floor", FUNCTION, floor),
    }
)
CHOSEN: Final = "chosen"
"""An operation whose value is its first part; the other parts are the conditions."""


class Traced(SpecialNumber):
    """A number, or a word that follows from numbers, with its expression.

    Parameters
    ----------
    value
        The number itself.
    operation
        Name of the operation on `parts`, if an operator computed it.
    parts
        Operands, or other numbers that it depends on.
    formula, numbers
        The computation in symbols and in numbers, if no operator computed it.
    given
        The input, if it is one.
    """

    __slots__ = ("formula", "given", "key", "numbers", "operation", "parts", "symbol", "value")

    def __init__(
        self,
        value: Any,
        *,
        operation: str = "",
        parts: tuple[Number, ...] = (),
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

    def same_as(self, other: SpecialNumber) -> bool:
        """Whether both have one value."""
        return isinstance(other, Traced) and bool(self.value == other.value)

    def named(self, key: str, symbol: str) -> "Traced":
        """Name a number, unless it has a name: it becomes a line of its own."""
        if not self.symbol:
            self.key, self.symbol = key, symbol
        return self

    def __add__(self, other: Number) -> "Traced":
        return _computed("add", self, other)

    def __radd__(self, other: Number) -> "Traced":
        return _computed("add", other, self)

    def __sub__(self, other: Number) -> "Traced":
        return _computed("sub", self, other)

    def __rsub__(self, other: Number) -> "Traced":
        return _computed("sub", other, self)

    def __mul__(self, other: Number) -> "Traced":
        return _computed("mul", self, other)

    def __rmul__(self, other: Number) -> "Traced":
        return _computed("mul", other, self)

    def __truediv__(self, other: Number) -> "Traced":
        return _computed("truediv", self, other)

    def __rtruediv__(self, other: Number) -> "Traced":
        return _computed("truediv", other, self)

    def __pow__(self, other: Number) -> "Traced":
        return _computed("pow", self, other)

    # == gives a traced truth value, so that the hash is the identity.
    __hash__ = object.__hash__

    def __eq__(self, other: object) -> Any:
        return _computed("eq", self, other)

    def __lt__(self, other: float | SpecialNumber) -> "Traced":
        return _computed("lt", self, other)

    def __le__(self, other: float | SpecialNumber) -> "Traced":
        return _computed("le", self, other)

    def __gt__(self, other: float | SpecialNumber) -> "Traced":
        return _computed("gt", self, other)

    def __ge__(self, other: float | SpecialNumber) -> "Traced":
        return _computed("ge", self, other)

    def __bool__(self) -> bool:
        return bool(self.value)

    def larger_of(self, one: Number, other: Number) -> "Traced":
        """The larger of two numbers."""
        return Traced(max(value_of(one), value_of(other)), operation="larger", parts=(one, other))

    def smaller_of(self, one: Number, other: Number) -> "Traced":
        """The smaller of two numbers."""
        return Traced(min(value_of(one), value_of(other)), operation="smaller", parts=(one, other))

    def chosen(self, condition: Number, yes: Number, no: Number) -> "Traced":
        """`yes` where the condition holds, else `no`."""
        won = yes if value_of(condition) else no
        return Traced(value_of(won), operation=CHOSEN, parts=(won, condition))

    def is_one(self) -> "Traced":
        """Whether it is 1."""
        return _computed("eq", self, 1)

    def rounded_up(self) -> "Traced":
        """The next whole number."""
        return Traced(ceil(self.value), operation="rounded_up", parts=(self,))

    def rounded_down(self) -> "Traced":
        """The whole number before it, or itself."""
        return Traced(floor(self.value), operation="rounded_down", parts=(self,))

    def entry(self, table: Sequence[float], *, words: str, sources: tuple[Number, ...]) -> "Traced":
        """The entry of a table at this place."""
        index = min(int(self.value), len(table) - 1)
        return Traced(table[index], formula=words, numbers=f"entry {index + 1} of {len(table)}", parts=(self, *sources))

    def between(self, places: Sequence[float], values: Sequence[float], *, words: str) -> "Traced":
        """The value at this place, linear between points."""
        index = bisect_left(places, self.value)
        sources = tuple(Traced(one, given=one.given) for one in (values,) if isinstance(one, GivenTable))
        if places[index] == self.value:
            at = f"{words} at {self.symbol}", f"{words} at {short(self.value)}"
            return Traced(values[index], formula=at[0], numbers=at[1], parts=(self, *sources))
        x0, y0, x1, y1 = places[index - 1], values[index - 1], places[index], values[index]
        found = y0 + (y1 - y0) * (self - x0) / (x1 - x0)
        return Traced(found.value, operation=CHOSEN, parts=(found, *sources))

    def pointwise(self, function: Callable[..., float], numbers: tuple[Number, ...], *, words: str) -> "Traced":
        """What a function of plain numbers gives: it has no steps."""
        value = function(*map(value_of, numbers))
        return Traced(value, formula=words, numbers=short(value), parts=numbers)

    def constant(self, number: Number) -> Number:
        """Make an input from a constant."""
        return Traced(float(number), given=constant(number)) if isinstance(number, Sourced) else number

    def worded(self, words: str) -> "Traced":
        """Describe in words where the number comes from."""
        return Traced(self.value, formula=words, numbers=short(self.value), parts=(self,))


def found(value: object, words: str, parts: Iterable[Number]) -> Traced:
    """A result without an equation, as of a search or a simulation: it has no steps, but all inputs of its parts.

    Parameters
    ----------
    value
        The result.
    words
        Its method.
    parts
        Numbers that it depends on.
    """
    leaves = inputs(Traced(value, parts=tuple(parts)))
    return Traced(value, formula=words, parts=tuple(Traced(leaf.value, given=leaf) for leaf in leaves))


def value_of(operand: Number) -> float:
    """Plain number of any operand; a word, which `==` compares, too, stays one."""
    value: Any = operand.value if isinstance(operand, Traced) else operand
    found: float = float(value) if isinstance(value, Sourced) else value
    return found


def _computed(name: str, left: Any, right: Any) -> Traced:
    """Compute an operation; adding a plain 0 or multiplying by a plain 1 is not recorded."""
    if isinstance(right, Traced) and name in ("add", "mul") and _is_switch(left, _NEUTRAL[name]):
        return right
    if isinstance(left, Traced) and name in _NEUTRAL and _is_switch(right, _NEUTRAL[name]):
        return left
    compute = OPERATIONS[name].compute
    return Traced(compute(value_of(left), value_of(right)), operation=name, parts=(left, right))


_NEUTRAL: Final = MappingProxyType({"add": 0, "sub": 0, "mul": 1, "truediv": 1})


def _is_switch(operand: Number, value: int) -> bool:
    return not isinstance(operand, (Traced, Sourced)) and operand == value


def lines(figure: Traced) -> Iterator[Traced]:
    """Every named number behind a figure, in the order of computation; the figure is last."""
    yield from (one for one in _visit(figure) if not one.given and (one.symbol or one is figure))


def inputs(figure: Traced) -> Iterator[Input]:
    """Inputs of a figure: keys of the profile and constants, each once."""
    found: dict[tuple[str, str], Input] = {}
    for one in _visit(figure):
        for leaf in (one.given, *(constant(part) for part in one.parts if isinstance(part, Sourced))):
            if leaf is not None:
                found.setdefault((leaf.name, leaf.symbol), leaf)
    yield from found.values()


def _visit(figure: Traced) -> Iterator[Traced]:
    """Every number behind a figure once, its parts before it; a sum of thousands is deeper than Python recurses."""
    seen: set[int] = set()
    waiting = [(figure, False)]
    while waiting:
        one, has_parts_behind = waiting.pop()
        if has_parts_behind:
            yield one
        elif id(one) not in seen:
            seen.add(id(one))
            waiting.append((one, True))
            waiting.extend((part, False) for part in reversed(one.parts) if isinstance(part, Traced))
