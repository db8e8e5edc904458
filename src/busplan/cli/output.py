"""All output: documents to stdout, messages to stderr."""

import os
import sys
from contextlib import suppress
from pathlib import Path

from busplan.errors import BusplanError
from busplan.files import document_bytes, write_file

PLAN_FAILS: int = 1
"""Exit code if the answer is that the plan fails."""
CANNOT: int = 2
"""Exit code if the program could not do its job."""
PAGER: str = "PAGER"
"""Variable with the user's pager; none where it is empty or cat."""


class PlanFailsError(Exception):
    """The answer is written, and it is that the plan fails: exit with `PLAN_FAILS`."""


def say(*messages: str) -> None:
    """Write messages to stderr, one on each line; a closed stderr is ignored."""
    from busplan.printable import printable  # loaded only if there is a message

    with suppress(OSError):
        for message in messages:
            # Names and arguments may contain control characters.
            for line in _fitting(printable(message)):
                print(line, file=sys.stderr, flush=True)  # noqa: T201 - the only place that prints


def _fitting(message: str) -> list[str]:
    """Lines of a message, which breaks at words on a terminal."""
    width = message_width()
    if width is None or len(message) <= width:
        return [message]
    from textwrap import wrap

    hang = " " * (len(message) - len(message.lstrip()))
    return wrap(message, width, subsequent_indent=hang, break_long_words=False, break_on_hyphens=False)


def message_width() -> int | None:
    """Width of the terminal that shows messages, in columns; None without one."""
    if not sys.stderr.isatty():
        return None
    from shutil import get_terminal_size

    return get_terminal_size().columns


def emit_text(text: str) -> None:
    """Write text for people to stdout, in the encoding of the terminal; characters that it lacks are escaped.

    Raises
    ------
    BusplanError
        stdout is closed or cannot be written.
    """
    sys.stdout.write(text)
    sys.stdout.flush()


def emit_pages(text: str) -> None:
    """Write text that is read from its top: by the user's pager where the terminal is too low for it, as git does.

    Raises
    ------
    BusplanError
        As `emit_text`.
    """
    is_read = sys.stdin is not None and sys.stdin.isatty() and sys.stdout.isatty()
    if is_read and os.environ.get(PAGER, "less") not in ("", "cat"):
        from shutil import get_terminal_size

        if text.count("\n") >= get_terminal_size().lines:
            from pydoc import pager

            os.environ.setdefault("LESS", "-FRX")
            pager(text)
            return
    emit_text(text)


def emit_document(document: str | bytes) -> None:
    """Write a document for programs to stdout; text is UTF-8, whatever the terminal's encoding.

    Raises
    ------
    BusplanError
        As `emit_text`.
    """
    sys.stdout.flush()
    sys.stdout.buffer.write(document_bytes(document))
    sys.stdout.buffer.flush()


def refuse_terminal(form: str) -> None:
    """Refuse to write binary data to a terminal.

    Raises
    ------
    BusplanError
        stdout is a terminal.
    """
    if sys.stdout.isatty():
        raise BusplanError(f"--format {form}: is not for a terminal; give -o FILE.{form}, or use a pipe")


def write_document(document: str | bytes, output: Path | None, *, quiet: bool = False) -> None:
    """Write a document to a file, with a message, or to stdout if `output` is None.

    Raises
    ------
    BusplanError
        It cannot be written.
    """
    if output is None:
        emit_document(document)
        return
    write_file(output, document_bytes(document), overwrite=True)
    if not quiet:
        say(f"wrote {output}")


def is_terminal() -> bool:
    """Whether a person at a terminal reads standard output."""
    return sys.stdout.isatty()


def is_styled() -> bool:
    """Whether to write colours: on a terminal, or with FORCE_COLOR."""
    return os.environ.get("FORCE_COLOR", "0") not in ("", "0") or is_terminal()
