"""Commands that are loaded when they are called; only --help loads all."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final

import typer
from typer.main import get_command

from busplan.cli.help import FAILURES, PlainCommand, PlainGroup

SETTINGS: Final[dict[str, Any]] = {"help_option_names": ["-h", "--help"], "max_content_width": 100}
GROUPS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "Design": ("init", "import", "plan", "calibrate", "map", "sweep", "compare"),
        "Analyse": ("capacity", "latency", "circle-test", "timeline", "explain", "report"),
        "Gate": ("check", "diff", "rule", "schema"),
        "Learn": ("manual", "profiles", "evidence", "paper"),
    }
)
"""In the order of the help."""
_MODULES: Final = {"circle-test": "circle", "import": "import_"}
"""Where a command is whose name no module has: `circle_test` would look like a test, `import` is a keyword."""
COMMANDS: Final = tuple(name for names in GROUPS.values() for name in names)


class LazyCommands(Mapping[str, Any]):
    """Commands by name, each created at first use."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in COMMANDS:
            raise KeyError(name)
        if name not in self._made:
            stem = name.replace("-", "_")
            module = import_module(f"busplan.cli.{_MODULES.get(name, stem)}")
            single = typer.Typer(
                add_completion=False,
                rich_markup_mode=None,
                pretty_exceptions_enable=False,
                context_settings=SETTINGS,
            )
            single.command(name, cls=PlainCommand, epilog=FAILURES)(getattr(module, f"{stem}_command"))
            self._made[name] = get_command(single)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class LazyGroup(PlainGroup):
    """The program's group of commands."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = LazyCommands()

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - typer's signature
        """Names of all commands, without loading them."""
        return list(COMMANDS)

    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """Names of the commands under the title of each group."""
        return GROUPS

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command of a command line."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-") and not ctx.resilient_parsing:
            from busplan.errors import BusplanError
            from busplan.nearest import did_you_mean

            near = did_you_mean(args[0], list(COMMANDS)) or "`busplan --help` lists them"
            raise BusplanError(f"{args[0]}: no such command; {near}")
        return super().resolve_command(ctx, args)
