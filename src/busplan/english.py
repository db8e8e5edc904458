"""English words: counts, lists, near names, and text that is safe to print."""

from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from typing import Final

_MOST_NEAR = 3
"""Near names in one question, at most."""


def did_you_mean(typed: str, names: Iterable[str], *, write: Callable[[str], str] = str) -> str:
    """Question about the nearest name, or about the names that begin as typed; empty if none is near.

    `write` writes each name.

    Examples
    --------
    >>> did_you_mean("capcity", ["capacity", "latency"]), did_you_mean("x", ["capacity"])
    ('did you mean capacity?', '')
    >>> did_you_mean("cap", ["capacity", "latency"]), did_you_mean("ma", ["manual", "map"])
    ('did you mean capacity?', 'did you mean manual or map?')
    """
    folded = {name.casefold(): name for name in names}
    begun = [name for name in folded if typed and name.startswith(typed.casefold())][:_MOST_NEAR]
    close = (
        [typed.casefold()] if typed.casefold() in folded else begun or get_close_matches(typed.casefold(), folded, 1)
    )
    return f"did you mean {listed([write(folded[name]) for name in close], 'or')}?" if close else ""


def has_controls(text: str) -> bool:
    r"""Whether a text has a control character, a line end or a mark of writing direction.

    Examples
    --------
    >>> has_controls("p.toml"), has_controls("p\x9b2J.toml"), has_controls("p\u202e.toml")
    (False, True, True)
    """
    return not text.isprintable()


def _escape(character: str) -> str:
    return character.encode("unicode_escape").decode()


def json_escape(text: str) -> str:
    """A text with every character as a JSON escape."""
    units = text.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2))


def printable(text: str, *, write: Callable[[str], str] = _escape) -> str:
    r"""A text in one line, its control characters escaped by `write`, by default as in Python.

    Examples
    --------
    >>> print(printable("p\x1b[2J.toml"))
    p\x1b[2J.toml
    """
    return (
        "".join(write(character) if has_controls(character) else character for character in text)
        if has_controls(text)
        else text
    )


def printable_lines(text: str, *, write: Callable[[str], str] = _escape) -> str:
    """A text with control characters escaped as by `printable`, but for its line ends."""
    return "\n".join(printable(line, write=write) for line in text.split("\n"))


def json_text(value: object, *, indent: int | None = None) -> str:
    r"""A value as JSON without control characters; it parses to the same value.

    `indent` is the number of spaces of a level; None writes one line. A number that is not finite raises ValueError.

    Examples
    --------
    >>> print(json_text("\x9b \u202e \u00e4"))
    "\u009b \u202e ä"
    """
    import json  # noqa: PLC0415 - most runs write none

    # JSON escapes line ends inside strings. Those that are left belong to the layout.
    return printable_lines(json.dumps(value, indent=indent, allow_nan=False, ensure_ascii=False), write=json_escape)


def to_json(document: object) -> str:
    """A JSON document: the text of `json_text`, indented, with a final newline."""
    return json_text(document, indent=2) + "\n"


def plural(number: int, noun: str) -> str:
    """A count with its noun.

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
    """A list in words.

    Examples
    --------
    >>> listed(("speed", "slice ratio", "period"), "or")
    'speed, slice ratio or period'
    """
    *before, end = words
    return f"{', '.join(before)} {last} {end}" if before else end


def first_of(words: Sequence[str], most: int, *, by: str = ", ") -> str:
    """First words of a list, and the number of the others.

    Examples
    --------
    >>> first_of("abcdefgh", 6), first_of("ab", 6)
    ('a, b, c, d, e, f and 2 more', 'a, b')
    """
    more = f" and {len(words) - most:,} more" if len(words) > most else ""
    return by.join(words[:most]) + more


_MOST_DECIMALS: Final = 9


def told_apart(first: float, second: float) -> tuple[str, str]:
    """Write two numbers with one decimal, or with as many as tell them apart.

    Examples
    --------
    >>> told_apart(348.461939453, 250.0), told_apart(250.0004, 250.0)
    (('348.5', '250.0'), ('250.0004', '250.0000'))
    """
    for decimals in range(1, _MOST_DECIMALS + 1):
        texts = f"{first:.{decimals}f}", f"{second:.{decimals}f}"
        if texts[0] != texts[1]:
            return texts
    return f"{first:.1f}", f"{second:.1f}"
