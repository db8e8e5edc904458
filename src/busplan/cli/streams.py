"""Standard streams that take everything or say that they cannot, whatever stands behind them."""

import codecs
import io
import os
import sys
from pathlib import Path
from typing import Any

from busplan.errors import BusplanError


class _WholeWriter(io.FileIO):
    """A descriptor that takes all bytes or fails. By itself it may take a part of them, or none for a while."""

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
    """Standard output, which says in the user's words what is wrong with it."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:  # the reader has seen enough: typer ends the run without a word
            raise
        except OSError as error:
            raise BusplanError(f"standard output cannot be written: {error.strerror}") from None


class _ClosedOutput(io.RawIOBase):
    """What stands for a standard output that the caller has closed."""

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:
        if data:
            raise BusplanError("standard output is closed")
        return 0


def mend_streams() -> None:
    """Make standard streams that can be written to, whatever the caller closed and whatever its encoding.

    A terminal without UTF-8 gets escapes instead of a failure.
    """
    codecs.register_error("busplan", _escaped)
    if sys.stdout is None:
        sys.stdout = _unbuffered(_ClosedOutput(), encoding="utf-8")
    else:
        sys.stdout = _mended(sys.stdout, _StandardOutput)
    if sys.stderr is None:
        # Errors have nowhere to go; they must not go to stdout.
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - open until the process ends
    else:
        sys.stderr = _mended(sys.stderr, _WholeWriter)


def _mended(stream: Any, writer: type[_WholeWriter]) -> Any:
    raw = getattr(stream.buffer, "raw", stream.buffer)
    if isinstance(raw, io.FileIO):
        return _unbuffered(writer(raw.fileno()), encoding=stream.encoding)
    stream.reconfigure(errors="busplan")  # held in memory by a test, or a console that takes no bytes
    return stream


def _unbuffered(raw: io.RawIOBase, *, encoding: str) -> io.TextIOWrapper:
    """Nothing is held back, so that nothing is left that could fail when Python flushes it at the end."""
    return io.TextIOWrapper(raw, encoding=encoding, errors="busplan", write_through=True)  # type: ignore[arg-type]


def _escaped(error: UnicodeError) -> tuple[str, int]:
    """Escape what an encoding lacks as JSON does."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    from busplan.printable import json_escape  # a stream that lacks nothing need not load it

    return json_escape(error.object[error.start : error.end]), error.end
