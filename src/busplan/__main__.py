"""Entry of the program: `busplan` and `python -m busplan`."""

import atexit
import gc
import os


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
        from busplan.cli import run

        run()
    except KeyboardInterrupt:  # The command line could not yet catch it.
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
