"""Numbers that remember how they were computed, so that a figure can show its own derivation.

The equations are operators only: given `Traced` numbers they compute what they always compute, and leave an expression
behind. What a line of a derivation shows is therefore what was executed, and not a second writing of it.
"""

import operator
from collections.abc import Callable, Iterator, Mapping
from inspect import signature
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from busplan.equations import SYMBOLS
from busplan.ieee1394 import CONSTANTS
from busplan.sourced import Equation, Sourced


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


_OPERATIONS: Final[Mapping[str, _Operation]] = MappingProxyType(
    {
        "add": _Operation("+", 1, operator.add),
        "sub": _Operation("-", 1, operator.sub),
        "mul": _Operation("*", 2, operator.mul),
        "truediv": _Operation("/", 2, operator.truediv),
        "pow": _Operation("^", 3, operator.pow),
    }
)
_ATOM: Final = 4

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
    compute = _OPERATIONS[name].compute
    return Traced(compute(value_of(left), value_of(right)), operation=name, parts=(left, right))


def _is_switch(operand: Operand, value: int) -> bool:
    return not isinstance(operand, (Traced, Sourced)) and operand == value


_DIGITS: Final = 7
_MOST_DIGITS: Final = 17
"""As many as tell every float from every other."""
_SUPPORTS: Final = 1e-4
"""Largest share of a result by which its line may miss it, for the digits that the line does not show."""


def against(left: float, sign: str, right: float) -> str:
    """Write a comparison with so many digits that it can be seen to hold.

    Examples
    --------
    >>> against(205.917, "<=", 2000.0), against(205.91746955, ">", 205.91746954)
    ('205.917 <= 2000', '205.91746955 > 205.91746954')
    """
    digits = _DIGITS
    while left != right and f"{left:.{digits}g}" == f"{right:.{digits}g}" and digits < _MOST_DIGITS:
        digits += 1
    return f"{left:.{digits}g} {sign} {right:.{digits}g}"


def less(left: float, right: float) -> str:
    """Write a difference with so many digits that the line gives its result.

    Examples
    --------
    >>> less(2000.0, 205.91747), less(320.00001432686, 320.0)
    ('2000 - 205.9175', '320.000014327 - 320')
    """
    digits = _DIGITS
    while digits < _MOST_DIGITS:
        seen = float(f"{left:.{digits}g}") - float(f"{right:.{digits}g}")
        if abs(seen - (left - right)) <= _SUPPORTS * abs(left - right):
            break
        digits += 1
    return f"{left:.{digits}g} - {right:.{digits}g}"


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
    return f"{value:.{_DIGITS}g}" if isinstance(value, (int, float)) else str(value)


def written(operand: Operand, *, in_numbers: bool) -> str:
    """Write the expression behind a number, down to what has a name.

    Parameters
    ----------
    operand
        A computed number.
    in_numbers
        Write the values of what has a name, instead of the symbols.

    Examples
    --------
    >>> hops = Traced(2, given=Input("H", "bus.nodes", 2, "hops", "given", "profile", "cable hops"))
    >>> delay = 0.25 * (hops + 1)
    >>> written(delay, in_numbers=False), written(delay, in_numbers=True), delay.value
    ('0.25 (H + 1)', '0.25 * (2 + 1)', 0.75)
    """
    if isinstance(operand, Traced) and not operand.operation:
        return operand.numbers if in_numbers else operand.formula
    if in_numbers and operand.operation == "sub" and all(_is_atom(part) for part in operand.parts):
        return less(*(float(value_of(part)) for part in operand.parts))
    return _written(operand, in_numbers=in_numbers, top=True)[0]


def _written(operand: Operand, *, in_numbers: bool, top: bool = False) -> tuple[str, int]:
    """Text of an operand, and how tightly it holds together."""
    if not isinstance(operand, Traced):
        return _atom(short(value_of(operand)))
    if not top and (operand.symbol or not operand.operation):
        return _atom(short(operand.value) if in_numbers or not operand.symbol else operand.symbol)
    operation = _OPERATIONS[operand.operation]
    (left, left_rank), (right, right_rank) = (_written(part, in_numbers=in_numbers) for part in operand.parts)
    left = f"({left})" if left_rank < operation.rank else left
    # What is taken off, divided by or raised to must hold together more tightly than what it is taken off.
    tighter = operation.rank + (operation.sign in "-/^")
    right = f"({right})" if right_rank < tighter else right
    if operation.sign == "*" and not in_numbers and not right[0].isdigit():
        return f"{left} {right}", operation.rank
    return f"{left} {operation.sign} {right}", operation.rank


def _is_atom(operand: Operand) -> bool:
    return not isinstance(operand, Traced) or bool(operand.symbol) or not operand.operation


def _atom(text: str) -> tuple[str, int]:
    rank = 1 if " + " in text or text.startswith("-") else 2 if " " in text else _ATOM
    return text, rank


def formula_of(equation: Equation) -> str:
    """Write an equation in symbols, by computing it with numbers that remember.

    Examples
    --------
    >>> from busplan.sourced import EQUATIONS
    >>> formula_of(EQUATIONS["acknowledge_phase_us"])
    '(0.023 L / 4.5 + 14 / C) H + 0.25'
    """
    names = list(signature(equation.function).parameters)
    # Any number but 0 and 1 will do: those are what a comparison gives.
    first, *others = (Traced(2.0, given=Input(SYMBOLS[name], name, 2.0, "", "given", "", "")) for name in names)
    found = equation.function(first, **dict(zip(names[1:], others, strict=True)))
    return found.symbol or written(found, in_numbers=False)


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
