"""A number that carries where it comes from and how well it is known."""

from typing import Literal, Self

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
