"""Entry of the program: `busplan` and `python -m busplan`."""

import atexit
import gc
import os

_INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def main() -> None:
    """Run the command line, tuned for short runs.

    Collecting garbage at exit takes a sixth of a short run; frozen objects are not searched. A pydantic plugin of
    another package could change how profiles are validated. Nothing here is large enough for several threads of linear
    algebra, and starting them takes time.
    """
    atexit.register(gc.freeze)
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        import signal

        on_interrupt = signal.getsignal(signal.SIGINT)
        if on_interrupt is signal.default_int_handler:
            # Python may print, or even pass over, an exception that comes in the middle of an import.
            signal.signal(signal.SIGINT, lambda *_: os._exit(_INTERRUPTED))
        from busplan.cli import run

        signal.signal(signal.SIGINT, on_interrupt)
        run()
    except KeyboardInterrupt:  # The command line could not yet catch it, or no longer.
        raise SystemExit(_INTERRUPTED) from None


if __name__ == "__main__":
    main()
