"""Ctrl-C that ends a long run between two of its steps, so that what it has written stays whole."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def ctrl_c_noted() -> Iterator[Callable[[], bool]]:
    """Give a function that tells whether Ctrl-C was pressed. Pressed a second time, it interrupts at once."""
    noted = False
    before = signal.getsignal(signal.SIGINT)

    def note(_signal: int, _frame: FrameType | None) -> None:
        nonlocal noted
        noted = True
        signal.signal(signal.SIGINT, before)

    if before in {signal.SIG_IGN, None}:  # run in the background: not ours to listen to
        yield lambda: False
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: noted
    finally:
        signal.signal(signal.SIGINT, before)
