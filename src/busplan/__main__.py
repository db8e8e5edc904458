"""The program's entry: `busplan` and `python -m busplan`."""

import atexit
import gc


def main() -> None:
    """Run the command line with a garbage collector that stays out of the start-up's way.

    Imports make many objects that live as long as the process: collecting among them, and once more at exit, costs a
    fifth of a short run. The collector stays on for what a long run may leave behind.
    """
    gc.set_threshold(500_000)
    atexit.register(gc.freeze)
    try:
        from busplan.cli import run

        run()
    except KeyboardInterrupt:  # before the command line is there to catch it
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
