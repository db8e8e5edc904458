"""Arguments of commands as a shell reads them."""

import os
import shlex
from collections.abc import Iterator

from busplan.printable import has_controls
from busplan.profile.changes import KeyChanges


def shell_word(text: str) -> str:
    """Quote an argument for a shell.

    Examples
    --------
    >>> shell_word("line 1.toml"), shell_word("-x.toml"), shell_word("-")
    ("'line 1.toml'", './-x.toml', '-')
    """
    if text.startswith("-") and text != "-":
        # The program would take it for an option, whatever the quotes.
        text = f"./{text}"
    if not has_controls(text):
        return shlex.quote(text)
    # Control characters need $'...', which bash, zsh and POSIX 2024 support.
    return f"$'{''.join(map(_escaped, os.fsencode(text)))}'"


def _escaped(byte: int) -> str:
    character = chr(byte)
    return character if character.isascii() and (character.isalnum() or character in "/._-+ ") else f"\\x{byte:02x}"


def period_option(period_us: float) -> tuple[str, str]:
    """The --period option for exactly this period.

    Examples
    --------
    >>> period_option(500.0), period_option(0.1)
    (('--period', '500us'), ('--period', '0.1us'))
    """
    return "--period", f"{repr(period_us).removesuffix('.0')}us"


def change_options(changes: KeyChanges, *, period_us: float) -> Iterator[str]:
    """Options of the changes, quoted for a shell; --period with the profile's period [us]."""
    for change in changes.each:
        yield from period_option(period_us) if change.option == "--period" else (change.option, shell_word(change.text))
