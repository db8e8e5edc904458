"""All output: documents to stdout, messages and progress to stderr, streams that write everything, and signals."""

import codecs
import io
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from types import FrameType
from typing import TYPE_CHECKING, Any, Final

from busplan.errors import BusplanError
from busplan.files import NewFile, document_bytes

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from busplan.progress import Progress

_BY_OTHERS: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals of a service manager or a closing terminal; for Ctrl-C, Python raises KeyboardInterrupt."""
ENDING: Final = (signal.SIGINT, *_BY_OTHERS)
_SIGNALLED: Final = 128
"""Exit code of a signal minus its number, as in shells."""


@contextmanager
def signals_end_the_run() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the run like Ctrl-C; a second signal ends the process at once."""

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise SystemExit(_SIGNALLED + number)

    # A signal that is ignored (nohup) stays ignored.
    before = {number: signal.getsignal(number) for number in _BY_OTHERS}
    heard = {number: old for number, old in before.items() if old not in {signal.SIG_IGN, None}}
    for number in heard:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, old in heard.items():
            signal.signal(number, old)


class _WholeWriter(io.FileIO):
    """A file that writes all bytes or fails; FileIO itself may write only a part, or nothing if it would block."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "wb", closefd=False)

    def write(self, data: Any, /) -> int:
        rest = memoryview(data).cast("B")
        size = len(rest)
        while rest:
            taken = super().write(rest)
            if taken is None:  # a pipe that does not block, and is full
                from select import select

                select([], [self], [])
            else:
                rest = rest[taken:]
        return size


class _StandardOutput(_WholeWriter):
    """Standard output whose errors are messages for the user."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:  # the reader has closed the pipe: typer ends the run silently
            raise
        except OSError as error:
            raise BusplanError(f"standard output cannot be written: {error.strerror}") from None


class _ClosedOutput(io.RawIOBase):
    """Replacement for a standard output that the caller has closed."""

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:
        if data:
            raise BusplanError("standard output is closed")
        return 0


def mend_streams() -> None:
    """Replace closed standard streams, and escape characters that their encoding lacks."""
    codecs.register_error("busplan", _escaped)
    if sys.stdout is None:
        sys.stdout = _unbuffered(_ClosedOutput(), encoding="utf-8")
    else:
        sys.stdout = _mended(sys.stdout, _StandardOutput)
    if sys.stderr is None:
        # Messages are lost, but must not go to stdout.
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - open until the process ends
    else:
        sys.stderr = _mended(sys.stderr, _WholeWriter)


def _mended(stream: Any, writer: type[_WholeWriter]) -> Any:
    raw = getattr(stream.buffer, "raw", stream.buffer)
    if isinstance(raw, io.FileIO):
        return _unbuffered(writer(raw.fileno()), encoding=stream.encoding)
    stream.reconfigure(errors="busplan")  # in memory in a test, or a console without bytes
    return stream


def _unbuffered(raw: io.RawIOBase, *, encoding: str) -> io.TextIOWrapper:
    """Text stream without a buffer, so that no flush can fail at exit."""
    return io.TextIOWrapper(raw, encoding=encoding, errors="busplan", write_through=True)  # type: ignore[arg-type]


def _escaped(error: UnicodeError) -> tuple[str, int]:
    """Write characters that an encoding lacks as JSON escapes."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    from busplan.english import json_escape  # loaded only if needed

    return json_escape(error.object[error.start : error.end]), error.end


PLAN_FAILS: int = 1
"""Exit code if the answer is that the plan fails."""
CANNOT: int = 2
"""Exit code if the program could not do its job."""
PAGER: str = "PAGER"
"""Variable with the user's pager; none where it is empty or cat."""


class PlanFailsError(Exception):
    """The answer is written, and it is that the plan fails: exit with `PLAN_FAILS`."""


def say(*messages: str) -> None:
    """Write messages to stderr, one on each line, without the middle of a very long one; a closed stderr is ignored."""
    from busplan.english import printable  # loaded only if there is a message

    with suppress(OSError):
        for message in messages:
            # Names and arguments may contain control characters.
            for line in _fitting(printable(_shortened(message))):
                print(line, file=sys.stderr, flush=True)  # noqa: T201 - the only place that prints


_LONGEST_MESSAGE: Final = 2000
_END_OF_MESSAGE: Final = 500
"""Characters of a very long message that are shown of its beginning and of its end, which says what would be right."""


def _shortened(message: str) -> str:
    if len(message) <= _LONGEST_MESSAGE:
        return message
    left_out = len(message) - 2 * _END_OF_MESSAGE
    return f"{message[:_END_OF_MESSAGE]} ... ({left_out:,} characters) ... {message[-_END_OF_MESSAGE:]}"


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


_PATIENCE_S: Final = 1.0
"""Work that takes no longer shows no progress."""


@contextmanager
def progress_bar(title: str, *, beside_stdout: bool = False) -> Iterator["Progress"]:
    """Give a function that takes the work done and the total work, and shows both if stderr is a terminal.

    `beside_stdout`: standard output is written meanwhile, so that a bar would stand among its lines on a terminal.
    """
    started = monotonic()
    is_seen = sys.stderr.isatty() and not (beside_stdout and sys.stdout.isatty())
    bar: Bar | None = None

    def report(done: int, total: int) -> None:
        nonlocal bar
        if bar is None:
            if not is_seen or monotonic() - started < _PATIENCE_S:
                return
            from rich.console import Console
            from rich.progress import Progress

            bar = Progress(console=Console(stderr=True), transient=True)
            bar.start()
            bar.add_task(title)
        bar.update(bar.task_ids[0], completed=done, total=total)

    try:
        yield report
    finally:
        if bar is not None:
            bar.stop()


_NARROWEST: Final = 40
"""Least width to lay out for; a narrower terminal breaks the lines itself."""


def terminal_size() -> tuple[int, int] | None:
    """Columns and lines of the terminal, by COLUMNS and LINES if set; None if standard output is no terminal."""
    if not sys.stdout.isatty():
        return None
    from shutil import get_terminal_size

    columns, lines = get_terminal_size()
    return max(columns, _NARROWEST), lines


def emit_text(text: str) -> None:
    """Write text for people to stdout, in the encoding of the terminal; characters that it lacks are escaped.

    BusplanError: stdout is closed or cannot be written.
    """
    sys.stdout.write(text)
    sys.stdout.flush()


def emit_pages(text: str) -> None:
    """Write text that is read from its top: by the user's pager where the terminal is too low for it, as git does.

    BusplanError: as `emit_text`.
    """
    is_read = sys.stdin is not None and sys.stdin.isatty() and sys.stdout.isatty()
    if is_read and os.environ.get(PAGER, "less") not in ("", "cat"):
        size = terminal_size()
        if size and text.count("\n") >= size[1]:
            from pydoc import pager

            os.environ.setdefault("LESS", "-FRX")
            pager(text)
            return
    emit_text(text)


def emit_document(document: str | bytes) -> None:
    """Write a document for programs to stdout; text is UTF-8, whatever the terminal's encoding.

    BusplanError: as `emit_text`.
    """
    sys.stdout.flush()
    sys.stdout.buffer.write(document_bytes(document))
    sys.stdout.buffer.flush()


def refuse_terminal(form: str) -> None:
    """Refuse to write binary data to a terminal.

    BusplanError: stdout is a terminal.
    """
    if sys.stdout.isatty():
        raise BusplanError(f"--format {form}: is not for a terminal; give -o FILE.{form}, or use a pipe")


def write_document(document: str | bytes, file: NewFile | None) -> None:
    """Write a document to an open file, or to stdout without one."""
    if file is None:
        emit_document(document)
    else:
        file.write(document_bytes(document))


def is_styled() -> bool:
    """Whether to write colours: on a terminal, or with FORCE_COLOR."""
    return os.environ.get("FORCE_COLOR", "0") not in ("", "0") or sys.stdout.isatty()
