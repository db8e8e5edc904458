"""Inputs of a derivation: keys of the profile and sourced constants, each with its grade."""

from typing import Final, NamedTuple

from busplan.sourced import Sourced


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


class GivenTable(tuple[float, ...]):  # noqa: SLOT001 - a tuple's subclass with slots holds no attribute
    """Entries of a table in a profile, as one input of a derivation."""

    given: Input


def constant(number: Sourced) -> Input:
    """Make an input from a sourced constant; without a symbol, formulas show its value.

    Examples
    --------
    >>> from busplan.buses.ieee1394.constants import DATA_END_US
    >>> constant(DATA_END_US)[:4]
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
