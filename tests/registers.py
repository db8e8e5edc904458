"""What there is of everything: the shipped profiles, the commands, and how many random examples."""

from collections.abc import Iterable
from math import ceil
from pathlib import Path
from random import Random
from typing import Any, Final, TypeVar

from hypothesis import settings
from typer.main import get_command

from busplan.cli import app

SHIPPED_FOLDER: Final = Path(__file__).parents[1] / "profiles"
T = TypeVar("T")
COMMAND_LINE: Final[Any] = get_command(app)
COMMANDS: Final[list[str]] = COMMAND_LINE.list_commands(None)
"""Names of the commands."""

QUICK: Final = 10
"""Random examples of a test by default."""


def at_least(few: int, many: int = 0) -> int:
    """How many examples a test with few by default has: under a larger profile of hypothesis more, or `many`."""
    return few if settings().max_examples == QUICK else max(many, ceil(few * settings().max_examples / QUICK))


def some(values: Iterable[T], few: int) -> list[T]:
    """So many of some values, the same in each run; more under a larger profile of hypothesis."""
    found = list(values)
    return Random(0).sample(found, min(len(found), at_least(few)))


def shipped_names() -> list[str]:
    """Names of the shipped profiles."""
    return sorted(path.stem for path in SHIPPED_FOLDER.glob("*.toml"))


def shipped_of_each_kind() -> list[str]:
    """Names of shipped profiles, one of each kind and way to run a cycle; all under a larger profile of hypothesis."""
    ieee1394 = ("paper-1ms", "gantry-24", "dvrk")
    others = ("ethercat-servo-8", "sercos2-servo-8", "sercos3-servo-8", "profibus-drives-6")
    return shipped_names() if at_least(1) > 1 else [*ieee1394, "can-servo-8", "can-motors-8", *others]
