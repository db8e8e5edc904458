"""The few functions that are no operators, for every sort of number.

What a bus computes it writes with operators and with these. Then one function serves plain numbers, arrays,
traced numbers, and polynomials of the number of nodes. numpy loads only where arrays are.
"""

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import repeat
from math import ceil, floor, inf, isinf, sqrt
from typing import TYPE_CHECKING, Any, Final, TypeAlias

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Number: TypeAlias = "float | NDArray[Any] | SpecialNumber"
else:
    Number: TypeAlias = object  # only type checkers ask what it is, and numpy stays unloaded
"""A plain number, an array, or a `SpecialNumber`. Truths are numbers, too."""

FIT_ROUNDING: Final = 1e-12
"""Relative allowance for the rounding of floats where a number is held against a limit: what is exactly at the limit
keeps it. It is far below the tolerance of any clock and buys no time."""
_PLAIN: Final = (int, float)


class SpecialNumber(ABC):
    """A number that is neither plain nor an array: it says itself what the functions of this module give."""

    __slots__ = ()

    @abstractmethod
    def __add__(self, other: Number) -> Number: ...

    @abstractmethod
    def __radd__(self, other: Number) -> Number: ...

    @abstractmethod
    def __sub__(self, other: Number) -> Number: ...

    @abstractmethod
    def __rsub__(self, other: Number) -> Number: ...

    @abstractmethod
    def __mul__(self, other: Number) -> Number: ...

    @abstractmethod
    def __rmul__(self, other: Number) -> Number: ...

    @abstractmethod
    def __truediv__(self, other: Number) -> Number: ...

    @abstractmethod
    def __rtruediv__(self, other: Number) -> Number: ...

    @abstractmethod
    def __pow__(self, other: Number) -> Number: ...

    # With an array on the other side it is the array that compares.

    @abstractmethod
    def __lt__(self, other: "float | SpecialNumber") -> Number: ...

    @abstractmethod
    def __le__(self, other: "float | SpecialNumber") -> Number: ...

    @abstractmethod
    def __gt__(self, other: "float | SpecialNumber") -> Number: ...

    @abstractmethod
    def __ge__(self, other: "float | SpecialNumber") -> Number: ...

    # What a sort may have.

    def __floordiv__(self, _other: Number) -> Number:
        raise TypeError(f"{type(self).__name__} has no //")

    def __neg__(self) -> Number:
        raise TypeError(f"{type(self).__name__} has no negative")

    def __float__(self) -> float:
        raise TypeError(f"{type(self).__name__} is no plain number")

    def __int__(self) -> int:
        raise TypeError(f"{type(self).__name__} is no plain number")

    @abstractmethod
    def larger_of(self, one: Number, other: Number) -> Number:
        """The larger of two numbers; this one is among them."""

    @abstractmethod
    def smaller_of(self, one: Number, other: Number) -> Number:
        """The smaller of two numbers; this one is among them."""

    @abstractmethod
    def chosen(self, condition: Number, yes: Number, no: Number) -> Number:
        """`yes` where the condition holds, else `no`; this one is among the three."""

    @abstractmethod
    def rounded_up(self) -> Number:
        """The next whole number."""

    @abstractmethod
    def rounded_down(self) -> Number:
        """The whole number before it, or itself."""

    @abstractmethod
    def entry(self, table: Sequence[float], *, words: str, sources: tuple[Number, ...]) -> Number:
        """The entry of a table at this place."""

    @abstractmethod
    def between(self, places: Sequence[float], values: Sequence[float], *, words: str) -> Number:
        """The value at this place, linear between points."""

    @abstractmethod
    def pointwise(self, function: Callable[..., float], numbers: tuple[Number, ...], *, words: str) -> Number:
        """What a function of plain numbers gives for some numbers; this one is among them."""

    @abstractmethod
    def is_one(self) -> Number:
        """Whether it is 1."""

    def named(self, _key: str, _symbol: str) -> Number:
        """Give the number a name."""
        return self

    def same_as(self, other: "SpecialNumber") -> bool:
        """Whether both have one value."""
        return self is other

    def constant(self, number: Number) -> Number:
        """Give a constant that computes with this number as a traced one, too."""
        return number

    def worded(self, _words: str) -> Number:
        """Say where the number comes from."""
        return self


def plain(number: Number) -> float:
    """The very number, where it must be a plain one.

    Raises
    ------
    TypeError
        It is of another sort.

    Examples
    --------
    >>> plain(3), plain(True)
    (3, True)
    """
    if isinstance(number, _PLAIN):
        return number
    raise TypeError(f"expected a plain number, got {type(number).__name__}")


def existing(number: Number) -> float | None:
    """A plain number; None for an infinite one, which stands for what does not exist.

    Examples
    --------
    >>> existing(2.5), existing(inf)
    (2.5, None)
    """
    found = plain(number)
    return None if isinf(found) else found


def within(number: Number, most: Number) -> Number:
    """Whether a number is no larger than a limit, but for the rounding of floats: a truth, or an array of them.

    Examples
    --------
    >>> within(0.1 + 0.2, 0.3), within(0.3001, 0.3)
    (True, False)
    """
    bound: Number = most * (1 + FIT_ROUNDING)
    return number <= bound


def larger(one: Number, other: Number) -> Number:
    """The larger of two numbers, the first of equals.

    Examples
    --------
    >>> larger(2, 3.0)
    3.0
    """
    if isinstance(one, _PLAIN) and isinstance(other, _PLAIN):
        return max(one, other)
    if isinstance(one, SpecialNumber):
        return one.larger_of(one, other)
    if isinstance(other, SpecialNumber):
        return other.larger_of(one, other)
    import numpy as np

    found: Number = np.maximum(one, other)
    return found


def smaller(one: Number, other: Number) -> Number:
    """The smaller of two numbers, the first of equals.

    Examples
    --------
    >>> smaller(2, 3.0)
    2
    """
    if isinstance(one, _PLAIN) and isinstance(other, _PLAIN):
        return min(one, other)
    if isinstance(one, SpecialNumber):
        return one.smaller_of(one, other)
    if isinstance(other, SpecialNumber):
        return other.smaller_of(one, other)
    import numpy as np

    found: Number = np.minimum(one, other)
    return found


def is_one(number: Number) -> Number:
    """Whether a number is 1: a truth, or an array of them.

    Examples
    --------
    >>> is_one(1), is_one(2)
    (True, False)
    """
    return number.is_one() if isinstance(number, SpecialNumber) else number == 1


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
    if isinstance(condition, SpecialNumber):
        return condition.chosen(condition, yes, no)
    if isinstance(yes, SpecialNumber):
        return yes.chosen(condition, yes, no)
    if isinstance(no, SpecialNumber):
        return no.chosen(condition, yes, no)
    import numpy as np

    return np.where(condition, yes, no)


def is_everywhere(condition: Number) -> bool:
    """Whether a condition holds, at each point of an array.

    Examples
    --------
    >>> is_everywhere(2 > 3)
    False
    """
    return bool(getattr(condition, "all", lambda: condition)())


def square_root(number: Number) -> Number:
    """The square root of a number that is 0 or more, rounded alike for numbers of any sort.

    Examples
    --------
    >>> square_root(2.25)
    1.5
    """
    if isinstance(number, _PLAIN):
        return sqrt(number)
    if isinstance(number, SpecialNumber):
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
    if isinstance(number, _PLAIN):
        return ceil(number)
    if isinstance(number, SpecialNumber):
        return number.rounded_up()
    import numpy as np

    return np.ceil(number)


def rounded_down(number: Number) -> Number:
    """The whole number before a number, or itself.

    Examples
    --------
    >>> rounded_down(3.25), rounded_down(3)
    (3, 3)
    """
    if isinstance(number, _PLAIN):
        return floor(number)
    if isinstance(number, SpecialNumber):
        return number.rounded_down()
    import numpy as np

    return np.floor(number)


def from_table(table: Sequence[float], place: Number, *, words: str, sources: tuple[Number, ...] = ()) -> Number:
    """The entry of a table at a place from 0; beyond its end the last one.

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
    if isinstance(place, SpecialNumber):
        return place.entry(table, words=words, sources=sources)
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
    if isinstance(least, (*_PLAIN, SpecialNumber)):
        return pointwise(lambda one: next(iter(table[bisect_left(table, one) :]), inf), least, words=words)
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
    if isinstance(place, _PLAIN):
        return _between(places, values, place)
    if isinstance(place, SpecialNumber):
        return place.between(places, values, words=words)
    import numpy as np

    index = np.searchsorted(places, place)
    left = np.maximum(index - 1, 0)
    xs, ys = np.asarray(places, dtype=float), np.asarray(values, dtype=float)
    x0, y0, x1, y1 = xs[left], ys[left], xs[index], ys[index]
    return np.where(x1 == place, y1, y0 + (y1 - y0) * (place - x0) / np.where(x1 > x0, x1 - x0, 1))


def pointwise(function: Callable[..., float], *numbers: Number, words: str) -> Number:
    """What a function of plain numbers gives, point by point: for what only a search can tell.

    Parameters
    ----------
    function
        The function.
    numbers
        Its arguments; arrays broadcast.
    words
        What a derivation says of it.

    Examples
    --------
    >>> pointwise(lambda one, other: one // other, 7, 2, words="the quotient")
    3
    """
    special = next((one for one in numbers if isinstance(one, SpecialNumber)), None)
    if special is not None:
        return special.pointwise(function, numbers, words=words)
    if all(isinstance(one, _PLAIN) for one in numbers):
        return function(*numbers)
    import numpy as np

    # Plain numbers are repeated, and arrays read as they are asked for: neither their number nor their size is bounded.
    given: tuple[Any, ...] = numbers
    shape = np.broadcast_shapes(*map(np.shape, given))
    points = zip(*(_points(one, shape) for one in given), strict=False)
    return np.array([function(*point) for point in points], dtype=float).reshape(shape)


def _points(number: "float | NDArray[Any]", shape: tuple[int, ...]) -> Iterator[float]:
    """A number at each point of a shape; a plain one without end."""
    if isinstance(number, _PLAIN):
        return repeat(number)
    import numpy as np

    return (one.item() for one in np.broadcast_to(number, shape).flat)


def _between(places: Sequence[float], values: Sequence[float], place: float) -> float:
    index = bisect_left(places, place)
    if places[index] == place:
        return values[index]
    x0, y0, x1, y1 = places[index - 1], values[index - 1], places[index], values[index]
    return y0 + (y1 - y0) * (place - x0) / (x1 - x0)


def named(number: Number, key: str, symbol: str) -> Number:
    """Give a step of a computation its name, for a derivation; any other number stays as it is."""
    return number.named(key, symbol) if isinstance(number, SpecialNumber) else number


def worded(number: Number, words: str) -> Number:
    """Say in words where a number comes from, for a derivation; any other number stays as it is."""
    return number.worded(words) if isinstance(number, SpecialNumber) else number


def are_same(one: object, other: object) -> bool:
    """Whether two values of a profile are equal; arrays only where they are one.

    Examples
    --------
    >>> are_same(2, 2.0), are_same("split", "unified")
    (True, False)
    """
    if one is other:
        return True
    if isinstance(one, SpecialNumber) and isinstance(other, SpecialNumber):
        return one.same_as(other)
    return isinstance(one, _COMPARED) and isinstance(other, _COMPARED) and one == other


_COMPARED: Final = (*_PLAIN, str, tuple)


def alike(constant: Number, number: Number) -> Number:
    """A constant that is computed with other constants before it meets a number: of that number's sort."""
    return number.constant(constant) if isinstance(number, SpecialNumber) else constant


def total(parts: Iterable[Number]) -> Number:
    """The sum of some numbers; 0.0 of none.

    Examples
    --------
    >>> total([1.5, 2]), total([])
    (3.5, 0.0)
    """
    found: Number | None = None
    for one in parts:
        found = one if found is None else found + one
    return 0.0 if found is None else found
