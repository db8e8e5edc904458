"""Signals that end a run: at once, after removing temporary files, or between two steps of a long run."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

_BY_OTHERS: Final = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals of a service manager or a closing terminal; for Ctrl-C, Python raises KeyboardInterrupt."""
ENDING: Final = (signal.SIGINT, *_BY_OTHERS)
_SIGNALLED: Final = 128
"""Exit code of a signal minus its number, as in shells."""


class StoppedError(SystemExit):
    """A run that ends between two steps: its partial output is valid and may be kept."""


def stopped_by(number: int) -> StoppedError:
    """Make the error for a signal."""
    return StoppedError(_SIGNALLED + number)


@contextmanager
def signals_end_the_run() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the run like Ctrl-C; a second signal ends the process at once."""

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
    """Defer signals: give a function that returns the number of the first one. A second one ends the run at once."""
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
    """Set a handler, except for signals that are ignored (nohup); return the former handlers."""
    before = {number: signal.getsignal(number) for number in numbers}
    listened: _Handlers = {number: old for number, old in before.items() if old not in {signal.SIG_IGN, None}}
    for number in listened:
        signal.signal(number, handler)
    return listened


def _restore(before: _Handlers) -> None:
    for number, handler in before.items():
        signal.signal(number, handler)
