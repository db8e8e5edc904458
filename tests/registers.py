"""What there is of everything: the shipped profiles, and the commands."""

from pathlib import Path
from typing import Any, Final

from typer.main import get_command

from busplan.cli import app

SHIPPED_FOLDER: Final = Path(__file__).parents[1] / "profiles"
COMMAND_LINE: Final[Any] = get_command(app)
COMMANDS: Final[list[str]] = COMMAND_LINE.list_commands(None)
"""Names of the commands."""


def shipped_names() -> list[str]:
    """Names of the shipped profiles."""
    return sorted(path.stem for path in SHIPPED_FOLDER.glob("*.toml"))
