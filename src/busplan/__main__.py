"""The program's entry: `busplan` and `python -m busplan`."""

import atexit
import gc
import os


def main() -> None:
    """Run the command line, tuned for short runs.

    Garbage collection during imports and at exit takes a fifth of a short run, so its threshold is raised; it stays on
    for long runs. Searching all installed packages for pydantic plugins takes as long as the calculation, and a plugin
    could change how profiles are validated, so plugins are disabled. Nothing here is large enough for several threads
    of linear algebra, and starting them takes time.
    """
    gc.set_threshold(500_000)
    atexit.register(gc.freeze)
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from busplan.cli import run

        run()
    except KeyboardInterrupt:  # before the command line can catch it
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
