"""What is text, and what commands a terminal: the one place that decides it, and writes the latter so that it is seen.

A file may be called anything. An escape sequence, a DEL, a C1 control or a mark that turns the direction of writing
would be obeyed by the terminal, the log or the editor that shows the name.
"""

from collections.abc import Callable


def commands(text: str) -> bool:
    r"""Tell whether a text holds anything but what is shown as itself: a control, a line end, a mark of direction.

    Examples
    --------
    >>> commands("p.toml"), commands("p\x9b2J.toml"), commands("p\u202e.toml")
    (False, True, True)
    """
    return not text.isprintable()


def _escape(character: str) -> str:
    return character.encode("unicode_escape").decode()


def json_escape(text: str) -> str:
    """Write every character of a text as JSON escapes it."""
    units = text.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2))


def printable(text: str, *, write: Callable[[str], str] = _escape) -> str:
    r"""Make one line that commands no terminal, whatever a file or key is called.

    Parameters
    ----------
    text
        Any text.
    write
        How to write a character that commands; without it, as Python escapes it.

    Examples
    --------
    >>> print(printable("p\x1b[2J.toml"))
    p\x1b[2J.toml
    """
    return "".join(write(one) if commands(one) else one for one in text) if commands(text) else text


def printable_lines(text: str, *, write: Callable[[str], str] = _escape) -> str:
    """Make lines that command no terminal: as `printable`, and line ends stay."""
    return "\n".join(printable(line, write=write) for line in text.split("\n"))


def json_text(value: object, *, indent: int | None = None) -> str:
    r"""Write a value as JSON that commands no terminal, and reads to the same value.

    Parameters
    ----------
    value
        Plain data.
    indent
        Blanks of each level; without it, all is one line.

    Raises
    ------
    ValueError
        A number is not finite: such a document must not leave the program.

    Examples
    --------
    >>> print(json_text("\x9b \u202e \u00e4"))
    "\u009b \u202e ä"
    """
    import json  # noqa: PLC0415 - most runs write none

    # Inside a text JSON escapes line ends itself: those that are left are the layout's.
    return printable_lines(json.dumps(value, indent=indent, allow_nan=False, ensure_ascii=False), write=json_escape)
