"""Signals that end a run at once, after removing temporary files."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

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
