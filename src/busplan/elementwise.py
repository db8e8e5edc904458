"""Numbers of the equations: floats, arrays and traced numbers, and functions that work on all of them.

A bus writes its equations with operators and these functions. Then the same equation serves all three. A traced
number records how it was computed, so that a line of a derivation shows what was executed. numpy loads only where
arrays are.
"""

import operator
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import wraps
from itertools import repeat
from math import ceil, floor, inf, isinf, sqrt
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple, ParamSpec, TypeAlias

from busplan.sourced import Input, Sourced, constants_looked_up, input_of, short

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Number: TypeAlias = float | Any  # a float to those who read it; arrays and traced numbers stand in for one
else:
    Number: TypeAlias = object  # only type checkers ask what it is, and numpy stays unloaded
"""A plain number, an array, or a `Traced` number. Booleans count as numbers."""

FIT_ROUNDING: Final = 1e-12
"""Relative allowance for the rounding of floats where a number is held against a limit: what is exactly at the limit
keeps it. It is far below the tolerance of any clock and buys no time."""
_PLAIN: Final = (int, float)


class _Operation(NamedTuple):
    sign: str
    rank: int
    """Operator precedence; that of a function is the highest."""
    compute: Callable[..., float]
    array: str = ""
    """Name of the function of arrays, where it is no operator."""


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
        "larger": _Operation("max", FUNCTION, max, "maximum"),
        "smaller": _Operation("min", FUNCTION, min, "minimum"),
        "rounded_up": _Operation("ceil", FUNCTION, ceil, "ceil"),
        "rounded_down": _Operation("floor", FUNCTION, floor, "floor"),
    }
)
CHOSEN: Final = "chosen"
"""An operation whose value is its first part; the other parts are the conditions."""
_NEUTRAL: Final = MappingProxyType({"add": 0, "sub": 0, "mul": 1, "truediv": 1})


class GivenTable(tuple[float, ...]):  # noqa: SLOT001 - a tuple's subclass with slots holds no attribute
    """Entries of a table in a profile, as a single input of a derivation."""

    given: Input


_Operator: TypeAlias = "Callable[[Traced, Any], Traced]"


def _operators(name: str) -> tuple[_Operator, _Operator]:
    """An operator of traced numbers, and its form for a number on the left."""
    return lambda left, right: _computed(name, left, right), lambda right, left: _computed(name, left, right)


class Traced:
    """A number, or a word that follows from numbers, with its expression.

    Parameters
    ----------
    value
        The number itself.
    operation
        Name of the operation on `parts`, if one of `OPERATIONS` computed it.
    parts
        Operands, or other numbers that it depends on.
    formula, numbers
        The computation in symbols and in numbers, if no operation computed it.
    given
        The input, if it is one.
    """

    __slots__ = ("formula", "given", "key", "numbers", "operation", "parts", "reference", "symbol", "value")

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
        self.reference = ""

    def named(self, key: str, symbol: str, reference: str = "") -> "Traced":
        """Name a number, unless it has a name: it becomes a line of its own, with its source where it differs."""
        if not self.symbol:
            self.key, self.symbol, self.reference = key, symbol, reference
        return self

    __add__, __radd__ = _operators("add")
    __sub__, __rsub__ = _operators("sub")
    __mul__, __rmul__ = _operators("mul")
    __truediv__, __rtruediv__ = _operators("truediv")
    __pow__ = _operators("pow")[0]
    __lt__ = _operators("lt")[0]
    __le__ = _operators("le")[0]
    __gt__ = _operators("gt")[0]
    __ge__ = _operators("ge")[0]

    # == gives a traced truth value, so that the hash is the identity.
    __hash__ = object.__hash__

    def __eq__(self, other: object) -> Any:
        return _computed("eq", self, other)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __float__(self) -> float:
        if not self.is_constant:
            raise TypeError("a traced number as a plain one has lost its expression")
        return float(self.value)

    def __int__(self) -> int:
        return int(float(self))

    @property
    def is_constant(self) -> bool:
        """Whether no input of the profile is in it."""
        return not self.given and all(part.is_constant for part in self.parts if isinstance(part, Traced))


class TracedConstant(Traced):
    """A sourced constant as an input of a derivation."""

    __slots__ = ("constant",)

    def __init__(self, constant: Sourced) -> None:
        super().__init__(float(constant), given=input_of(constant))
        self.constant = constant

    @property
    def is_constant(self) -> bool:
        """True: it is one."""
        return True

    @property
    def meaning(self) -> str:
        """Meaning of the constant, in one line."""
        return self.constant.meaning


def are_plain(*numbers: Number) -> bool:
    """Whether all numbers are plain: no arrays, and none traced."""
    return all(isinstance(number, _PLAIN) for number in numbers)


def value_of(operand: Number) -> float:
    """Plain number of any operand; a word, which `==` compares, too, stays a word."""
    value: Any = operand.value if isinstance(operand, Traced) else operand
    return float(value) if isinstance(value, Sourced) else value


def _computed(name: str, *operands: Any) -> Traced:
    """Compute an operation; adding a plain 0 or multiplying by a plain 1 is not recorded."""
    if name in _NEUTRAL:
        left, right = operands
        if isinstance(left, Traced) and _is_switch(right, _NEUTRAL[name]):
            return left
        if isinstance(right, Traced) and name in ("add", "mul") and _is_switch(left, _NEUTRAL[name]):
            return right
    return Traced(OPERATIONS[name].compute(*map(value_of, operands)), operation=name, parts=operands)


def _is_switch(operand: Number, value: int) -> bool:
    return not isinstance(operand, (Traced, Sourced)) and operand == value


def _applied(name: str, *numbers: Number) -> Number:
    """An operation on numbers that are not all plain."""
    if any(isinstance(number, Traced) for number in numbers):
        return _computed(name, *numbers)
    import numpy as np

    result: Number = getattr(np, OPERATIONS[name].array)(*numbers)
    return result


def existing(number: Number) -> float | None:
    """A plain number; None for infinity, which stands for what does not exist.

    Examples
    --------
    >>> existing(2.5), existing(inf)
    (2.5, None)
    """
    return None if isinf(number) else number


def within(number: Number, most: Number) -> Number:
    """Whether a number is no larger than a limit, but for the rounding of floats: a truth, or an array of them.

    Examples
    --------
    >>> within(0.1 + 0.2, 0.3), within(0.3001, 0.3)
    (True, False)
    """
    bound: Number = most * (1 + FIT_ROUNDING)
    return number <= bound


def is_over(number: Number, most: Number) -> Number:
    """Whether a number is larger than a limit, but for the rounding of floats, so not `within` it."""
    bound: Number = most * (1 + FIT_ROUNDING)
    return number > bound


def larger(left: Number, right: Number) -> Number:
    """The larger of two numbers, the first of equals.

    Examples
    --------
    >>> larger(2, 3.0)
    3.0
    """
    if isinstance(left, _PLAIN) and isinstance(right, _PLAIN):
        return max(left, right)
    return _applied("larger", left, right)


def smaller(left: Number, right: Number) -> Number:
    """The smaller of two numbers, the first of equals.

    Examples
    --------
    >>> smaller(2, 3.0)
    2
    """
    if isinstance(left, _PLAIN) and isinstance(right, _PLAIN):
        return min(left, right)
    return _applied("smaller", left, right)


def is_off(number: Number) -> bool:
    """Whether a plain number is 0: what is off is left out of a computation.

    Examples
    --------
    >>> is_off(0.0), is_off(0.5)
    (True, False)
    """
    return isinstance(number, _PLAIN) and number == 0


def choose(condition: Number, yes: Number, no: Number) -> Number:
    """`yes` where the condition holds, else `no`.

    Examples
    --------
    >>> choose(2 > 3, 5, 7)
    7
    """
    if isinstance(condition, bool):
        return yes if condition else no
    if isinstance(condition, Traced) or isinstance(yes, Traced) or isinstance(no, Traced):
        won = yes if value_of(condition) else no
        return Traced(value_of(won), operation=CHOSEN, parts=(won, condition))
    import numpy as np

    return np.where(condition, yes, no)


def is_everywhere(condition: Number) -> bool:
    """Whether a condition holds, at each point of an array.

    Examples
    --------
    >>> is_everywhere(2 > 3)
    False
    """
    if isinstance(condition, bool):
        return condition
    return bool(condition.all() if hasattr(condition, "all") else condition)


def square_root(number: Number) -> Number:
    """The square root of a number that is 0 or more, rounded alike for numbers of any sort.

    Examples
    --------
    >>> square_root(2.25)
    1.5
    """
    if isinstance(number, _PLAIN):
        return sqrt(number)
    if isinstance(number, Traced):
        return number**0.5
    import numpy as np

    return np.sqrt(number)


def rounded_up(number: Number) -> Number:
    """The next whole number.

    Examples
    --------
    >>> rounded_up(3.25), rounded_up(3)
    (4, 3)
    """
    return ceil(number) if isinstance(number, _PLAIN) else _applied("rounded_up", number)


def rounded_down(number: Number) -> Number:
    """The whole number before a number, or itself.

    Examples
    --------
    >>> rounded_down(3.25), rounded_down(3)
    (3, 3)
    """
    return floor(number) if isinstance(number, _PLAIN) else _applied("rounded_down", number)


def from_table(table: Sequence[float], place: Number, *, words: str, sources: tuple[Number, ...] = ()) -> Number:
    """The entry of a table at a place from 0; beyond its end the last entry.

    Parameters
    ----------
    table
        The entries.
    place
        Which of them [1].
    words
        What a derivation says of it.
    sources
        Sourced numbers that the table goes with.

    Examples
    --------
    >>> from_table((5, 7, 8), 1, words="a table"), from_table((5, 7, 8), 9, words="a table")
    (7, 8)
    """
    if isinstance(place, _PLAIN):
        return table[min(int(place), len(table) - 1)]
    if isinstance(place, Traced):
        index = min(int(place.value), len(table) - 1)
        at = f"entry {index + 1} of {len(table)}"
        return Traced(table[index], formula=words, numbers=at, parts=(place, *sources))
    import numpy as np

    return np.asarray(table)[np.minimum(np.asarray(place, dtype=np.int64), len(table) - 1)]


def next_entry(table: Sequence[float], least: Number, *, words: str) -> Number:
    """The first entry of an ascending table that is no less than a number; infinite where none is.

    Parameters
    ----------
    table
        The entries.
    least
        The number.
    words
        What a derivation says of it.

    Examples
    --------
    >>> next_entry((5, 7, 8), 5.5, words="a table"), next_entry((5, 7, 8), 9, words="a table")
    (7, inf)
    """
    if isinstance(least, (*_PLAIN, Traced)):
        return pointwise(lambda number: next(iter(table[bisect_left(table, number) :]), inf), least, words=words)
    import numpy as np

    return np.append(np.asarray(table, dtype=float), inf)[np.searchsorted(table, least)]


def interpolated(places: Sequence[float], values: Sequence[float], place: Number, *, words: str) -> Number:
    """The value at a place inside some points, linear between them.

    Parameters
    ----------
    places, values
        The points, places ascending; one or more.
    place
        From the first of `places` to the last.
    words
        What a derivation calls the points.

    Examples
    --------
    >>> interpolated((4, 16), (36.0, 39.0), 8, words="table")
    37.0
    """
    if not isinstance(place, (*_PLAIN, Traced)):
        import numpy as np

        index = np.searchsorted(places, place)
        left = np.maximum(index - 1, 0)
        xs, ys = np.asarray(places, dtype=float), np.asarray(values, dtype=float)
        x0, y0, x1, y1 = xs[left], ys[left], xs[index], ys[index]
        return np.where(x1 == place, y1, y0 + (y1 - y0) * (place - x0) / np.where(x1 > x0, x1 - x0, 1))
    at = bisect_left(places, value_of(place))
    is_point, value = places[at] == value_of(place), values[at]
    between: Number = value
    if not is_point:
        between = values[at - 1] + (value - values[at - 1]) * (place - places[at - 1]) / (places[at] - places[at - 1])
    if not isinstance(place, Traced):
        return between
    sources = (Traced(values, given=values.given),) if isinstance(values, GivenTable) else ()
    if is_point:
        words, numbers = f"{words} at {place.symbol}", f"{words} at {short(place.value)}"
        return Traced(value, formula=words, numbers=numbers, parts=(place, *sources))
    return Traced(value_of(between), operation=CHOSEN, parts=(between, *sources))


def pointwise(function: Callable[..., Any], *numbers: Number, words: str) -> Any:
    """Result of a function of plain numbers, point by point: for results that only a search can tell.

    Parameters
    ----------
    function
        The function. It returns a number, or a tuple of several.
    numbers
        Its arguments; arrays broadcast.
    words
        What a derivation says of it.

    Examples
    --------
    >>> pointwise(lambda left, right: left // right, 7, 2, words="the quotient")
    3
    """
    if are_plain(*numbers):
        return function(*numbers)
    if any(isinstance(number, Traced) for number in numbers):
        with constants_looked_up(None):
            found = function(*map(value_of, numbers))
        of_each = [
            Traced(value, formula=words, numbers=short(value), parts=numbers)
            for value in (found if isinstance(found, tuple) else (found,))
        ]
        return tuple(of_each) if isinstance(found, tuple) else of_each[0]
    import numpy as np

    # Plain numbers are repeated, and arrays read as they are asked for: neither their number nor their size is bounded.
    given: tuple[Any, ...] = numbers
    shape = np.broadcast_shapes(*map(np.shape, given))
    points = zip(*(_points(number, shape) for number in given), strict=False)
    found = np.array([function(*point) for point in points], dtype=float)
    return tuple(column.reshape(shape) for column in found.T) if found.ndim > 1 else found.reshape(shape)


def _points(number: "float | NDArray[Any]", shape: tuple[int, ...]) -> Iterator[float]:
    """A number at each point of a shape; a plain number without end."""
    if isinstance(number, _PLAIN):
        return repeat(number)
    import numpy as np

    return (point.item() for point in np.broadcast_to(number, shape).flat)


def named(number: Number, key: str, symbol: str, reference: str = "") -> Number:
    """Give a step of a computation its name, for a derivation; any other number stays as it is.

    With `reference`, the source of this number, where it is not that of the figure with this key.
    """
    return number.named(key, symbol, reference) if isinstance(number, Traced) else number


_Parameters = ParamSpec("_Parameters")


def step(symbol: str, key: str = "") -> Callable[[Callable[_Parameters, Number]], Callable[_Parameters, Number]]:
    """Decorator of a function whose result is a step of a derivation: its key is the function's name, or given."""

    def of_function(function: Callable[_Parameters, Number]) -> Callable[_Parameters, Number]:
        key_or_name = key or function.__name__.lstrip("_")

        @wraps(function)
        def with_name(*given: _Parameters.args, **by_name: _Parameters.kwargs) -> Number:
            return named(function(*given, **by_name), key_or_name, symbol)

        return with_name

    return of_function


def worded(number: Number, words: str) -> Number:
    """Say in words where a number comes from, for a derivation; any other number stays as it is."""
    if not isinstance(number, Traced):
        return number
    return Traced(number.value, formula=words, numbers=short(number.value), parts=(number,))


def total(parts: Iterable[Number]) -> Number:
    """The sum of some numbers; 0.0 of none.

    Examples
    --------
    >>> total([1.5, 2]), total([])
    (3.5, 0.0)
    """
    sum_: Number | None = None
    for part in parts:
        sum_ = part if sum_ is None else sum_ + part
    return 0.0 if sum_ is None else sum_
