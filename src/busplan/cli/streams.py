"""Standard streams that write everything or fail with a message."""

import codecs
import io
import os
import sys
from pathlib import Path
from typing import Any

from busplan.errors import BusplanError


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
    from busplan.printable import json_escape  # loaded only if needed

    return json_escape(error.object[error.start : error.end]), error.end
