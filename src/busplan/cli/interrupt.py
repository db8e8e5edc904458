"""Signals that end a run: at once, with all files closed and removed, or between two steps of a long one."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

_BY_OTHERS: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""What a service manager or a terminal that closes sends. Python raises KeyboardInterrupt for Ctrl-C by itself."""
ENDING: Final = (signal.SIGINT, *_BY_OTHERS)
_SIGNALLED: Final = 128
"""Added to a signal's number, it is the exit code, as shells have it."""


class StoppedError(SystemExit):
    """A run that ends between two steps: what stands in the file so far is whole in itself, and may be kept."""


def stopped_by(number: int) -> StoppedError:
    """Make the error for a signal that was noted."""
    return StoppedError(_SIGNALLED + number)


@contextmanager
def signals_end_the_run() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the run as Ctrl-C does; a second one ends the process at once."""

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise SystemExit(_SIGNALLED + number)

    before = _handled(_BY_OTHERS, end)
    try:
        yield
    finally:
        _restore(before)


@contextmanager
def signals_noted() -> Iterator[Callable[[], int | None]]:
    """Give a function that tells which signal has come that ends the run. A second one ends it at once."""
    noted: int | None = None

    def note(number: int, _frame: FrameType | None) -> None:
        nonlocal noted
        noted = number
        _restore(before)

    before = _handled(ENDING, note)
    try:
        yield lambda: noted
    finally:
        _restore(before)


_Handlers = dict[int, Callable[[int, FrameType | None], object] | int | None]


def _handled(numbers: tuple[int, ...], handler: Callable[[int, FrameType | None], None]) -> _Handlers:
    """Handle signals, but for those that nohup or a shell's background ignores; gives the handlers before."""
    before = {number: signal.getsignal(number) for number in numbers}
    listened: _Handlers = {number: old for number, old in before.items() if old not in {signal.SIG_IGN, None}}
    for number in listened:
        signal.signal(number, handler)
    return listened


def _restore(before: _Handlers) -> None:
    for number, handler in before.items():
        signal.signal(number, handler)
