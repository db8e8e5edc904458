"""Numbers and equations that carry where they come from, and numbers how well they are known."""

import re
from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple, Self, TypeVar

Grade = Literal["published", "derived", "recalled", "measured", "calibrated", "assumed"]
"""How well a number is known.

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

    Examples
    --------
    >>> delay = Sourced(14, unit="ticks", grade="published", source="eqs (4)-(6)", meaning="PHY delay a hop")
    >>> delay / 7
    2.0
    >>> delay.source
    'eqs (4)-(6)'
    """

    __slots__ = ("grade", "meaning", "source", "unit")

    unit: str
    grade: Grade
    source: str
    meaning: str

    def __new__(cls, value: float, *, unit: str, grade: Grade, source: str, meaning: str) -> Self:
        """Make the number; see the class."""
        number = super().__new__(cls, value)
        number.unit = unit
        number.grade = grade
        number.source = source
        number.meaning = meaning
        return number


class Equation(NamedTuple):
    """A function that computes a published equation, or a part of one.

    Parameters
    ----------
    numbers
        Number of the equation; several where they share the part.
    symbol
        What it gives, as the source writes it.
    section
        Where it stands in the source.
    part
        What of the equation it is; empty for all of it.
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
        """Its numbers as a table shows them: (6) or (4)-(6)."""
        first, last = self.numbers[0], self.numbers[-1]
        return f"({first})" if first == last else f"({first})-({last})"

    @property
    def source(self) -> str:
        """Where it comes from, in words."""
        noun = "equation" if len(self.numbers) == 1 else "equations"
        whole = f"Paper, section {self.section}, {noun} {self.reference}"
        return f"{whole}; {self.part}" if self.part else whole


EQUATIONS: Final[dict[str, Equation]] = {}
"""Every function that computes an equation, by its name, in the order of the source."""

_Function = TypeVar("_Function", bound=Callable[..., Any])


def published(*numbers: int, symbol: str, section: str, part: str = "") -> Callable[[_Function], _Function]:
    """Enter a function into `EQUATIONS`, and its source into its docstring.

    Parameters
    ----------
    numbers, symbol, section, part
        As in `Equation`.

    Examples
    --------
    >>> equation = Equation((4, 5, 6), "hop", "III-E", "their bracket", float)
    >>> equation.reference, equation.source
    ('(4)-(6)', 'Paper, section III-E, equations (4)-(6); their bracket')
    """

    def enter(function: _Function) -> _Function:
        equation = Equation(numbers, symbol, section, part, function)
        EQUATIONS[function.__name__] = equation
        if function.__doc__:  # python -OO takes docstrings away
            before, indent, examples = re.split(r"(?m)^( *)(?=Examples\n)", function.__doc__, maxsplit=1)
            references = "".join(f"{indent}{line}\n" for line in ("References", "----------", f"{equation.source}."))
            function.__doc__ = f"{before}{references}\n{indent}{examples}"
        return function

    return enter
