"""The program's entry: `busplan` and `python -m busplan`."""

import atexit
import gc
import os


def main() -> None:
    """Run the command line without what makes a short run slow.

    Imports make many objects that live as long as the process: collecting among them, and once more at exit, costs a
    fifth of a short run. The collector stays on for what a long run may leave behind. Looking through all installed
    packages for plugins of pydantic costs as much as the whole calculation; such a plugin could change what a profile
    is taken for, so none is loaded.
    """
    gc.set_threshold(500_000)
    atexit.register(gc.freeze)
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
    try:
        from busplan.cli import run

        run()
    except KeyboardInterrupt:  # before the command line is there to catch it
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
