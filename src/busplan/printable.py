"""Make text safe to show: escape control characters.

A file may have any name. A terminal, log or editor that shows the name would obey an escape sequence, a DEL, a C1
control or a mark of writing direction in it.
"""

from collections.abc import Callable


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
    """Write every character of a text as a JSON escape."""
    units = text.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2))


def printable(text: str, *, write: Callable[[str], str] = _escape) -> str:
    r"""Escape the control characters of a text; the result is one line.

    Parameters
    ----------
    text
        Any text.
    write
        Escape of a character; by default as Python does.

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
    """Escape the control characters of a text, as `printable`, but keep its line ends."""
    return "\n".join(printable(line, write=write) for line in text.split("\n"))


def json_text(value: object, *, indent: int | None = None) -> str:
    r"""Write a value as JSON without control characters; it parses to the same value.

    Parameters
    ----------
    value
        Plain data.
    indent
        Spaces of each level; by default, everything is on one line.

    Raises
    ------
    ValueError
        A number is not finite.

    Examples
    --------
    >>> print(json_text("\x9b \u202e \u00e4"))
    "\u009b \u202e ä"
    """
    import json  # noqa: PLC0415 - most runs write none

    # JSON escapes line ends inside strings; those that are left belong to the layout.
    return printable_lines(json.dumps(value, indent=indent, allow_nan=False, ensure_ascii=False), write=json_escape)


def to_json(document: object) -> str:
    """Write a JSON document: as `json_text`, indented, with a final newline."""
    return json_text(document, indent=2) + "\n"
