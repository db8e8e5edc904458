"""Counts and lists in English."""

from collections.abc import Sequence


def plural(number: int, noun: str) -> str:
    """Write a count with its noun.

    Examples
    --------
    >>> plural(1, "node"), plural(1200, "frame"), plural(8, "axis")
    ('1 node', '1,200 frames', '8 axes')
    """
    return f"{number:,} {nouns(number, noun)}"


def nouns(number: int, noun: str) -> str:
    """Singular or plural of a noun, by its count.

    Examples
    --------
    >>> nouns(1, "axis"), nouns(2, "axis")
    ('axis', 'axes')
    """
    if number == 1:
        return noun
    return f"{noun.removesuffix('is')}es" if noun.endswith("is") else f"{noun}s"


def listed(words: Sequence[str], last: str) -> str:
    """Write a list in words.

    Examples
    --------
    >>> listed(("speed", "slice ratio", "period"), "or")
    'speed, slice ratio or period'
    """
    *before, end = words
    return f"{', '.join(before)} {last} {end}" if before else end


def first_of(words: Sequence[str], most: int, *, by: str = ", ") -> str:
    """Write the first words of a list, and the number of the others.

    Examples
    --------
    >>> first_of("abcdefgh", 6), first_of("ab", 6)
    ('a, b, c, d, e, f and 2 more', 'a, b')
    """
    more = f" and {len(words) - most:,} more" if len(words) > most else ""
    return by.join(words[:most]) + more
