"""A polynomial of the number of nodes that goes through a cycle in the place of a number.

What comes out is the cycle for every number of nodes at once. A cycle that compares, rounds or looks up what depends on
the number of nodes is no polynomial, and says so. Whether there is one node alone is the one thing that a cycle may
ask: the polynomial is the cycle of two nodes or more.
"""

from itertools import zip_longest
from typing import Final, Never

from busplan.elementwise import Number, SpecialNumber, choose, larger


class NoPolynomialError(ArithmeticError):
    """What was computed is no polynomial of the number of nodes, or none whose root has a closed form."""


def _refuse(*_operands: object, **_words: object) -> Never:
    raise NoPolynomialError


class Polynomial(SpecialNumber):
    """c0 + c1 N + c2 N^2 + ...

    Parameters
    ----------
    *coefficients
        c0, c1, ...: plain numbers or arrays.

    Examples
    --------
    >>> ((NODES + 1) * NODES * 0.5).coefficients
    (0.0, 0.5, 0.5)
    """

    __slots__ = ("coefficients",)
    __array_ufunc__ = None  # an array leaves the operation to this class
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, *coefficients: Number) -> None:
        self.coefficients = coefficients

    def at(self, nodes: Number) -> Number:
        """Its value at a number of nodes (Horner)."""
        *others, found = self.coefficients
        for one in reversed(others):
            found = found * nodes + one
        return found

    def largest_within(self, most: Number) -> Number:
        """The largest whole number of nodes whose value is no more than a bound; 0 where there is none.

        The root is the answer but for rounding: the whole number next to it fits, or is one too many.

        Raises
        ------
        NoPolynomialError
            Of a higher degree than the second, or its value may fall with the nodes.
        """
        c0, c1, c2 = self._growing()
        spare = larger(most - c0, 0.0)
        # The form without cancellation. The power is an operator, and a root for arrays, too.
        root = 2 * spare / (c1 + (c1 * c1 + 4 * c2 * spare) ** 0.5)
        nearest = (root + 0.5) // 1
        return nearest - choose(self.at(nearest) > most, 1, 0) * choose(nearest > 0, 1, 0)

    def _growing(self) -> tuple[Number, Number, Number]:
        if len(self.coefficients) > _QUADRATIC:
            raise NoPolynomialError
        c0, c1, c2 = (*self.coefficients, 0.0, 0.0)[:_QUADRATIC]
        if not (least(c1) > 0 and least(c2) >= 0):
            raise NoPolynomialError
        return c0, c1, c2

    def __add__(self, other: Number) -> "Polynomial":
        own = other.coefficients if isinstance(other, Polynomial) else (other,)
        return Polynomial(*(one + two for one, two in zip_longest(self.coefficients, own, fillvalue=0)))

    __radd__ = __add__

    def __neg__(self) -> "Polynomial":
        return Polynomial(*(-one for one in self.coefficients))

    def __sub__(self, other: Number) -> "Polynomial":
        found: Polynomial = self + (-other)
        return found

    def __rsub__(self, other: Number) -> "Polynomial":
        found: Polynomial = -self + other
        return found

    def __mul__(self, other: Number) -> "Polynomial":
        if not isinstance(other, Polynomial):
            return Polynomial(*(one * other for one in self.coefficients))
        product: list[Number] = [0.0] * (len(self.coefficients) + len(other.coefficients) - 1)
        for power, one in enumerate(self.coefficients):
            for further, two in enumerate(other.coefficients):
                product[power + further] = product[power + further] + one * two
        return Polynomial(*product)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> "Polynomial":
        return _refuse() if isinstance(other, Polynomial) else Polynomial(*(one / other for one in self.coefficients))

    __rtruediv__ = __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = __pow__ = __rpow__ = _refuse
    __lt__ = __le__ = __gt__ = __ge__ = __bool__ = __float__ = __int__ = __index__ = __round__ = _refuse
    __eq__ = __ne__ = _refuse

    def is_one(self) -> bool:
        """It is a number of nodes from 2 on."""
        return False

    larger_of = smaller_of = chosen = rounded_up = rounded_down = entry = between = pointwise = _refuse


_QUADRATIC: Final = 3
"""Coefficients of the highest degree whose root has a closed form here."""
NODES: Final = Polynomial(0, 1)
"""N itself."""


def least(number: Number) -> float:
    """The least element of an array, or a plain number itself."""
    return float(number.min()) if hasattr(number, "min") else float(number)
