"""Commands that are loaded when they are called, and the layout of their help: plain names, and exit codes."""

import re
import sys
from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException
from typer.main import get_command

from busplan.errors import BusplanError

FAILURES: Final = (
    "Exits 2 when it could not do its job and says why on standard error, 130 when interrupted, 143 when terminated, "
    "129 when hung up."
)
"""End of the help of every command."""
_OFFER: Final = 60
"""Most characters of help for a completion in the shell."""


_WRONG: Final = MappingProxyType(
    {
        "int_parsing": "expected a whole number",
        "float_parsing": "expected a number",
        "greater_than_equal": "must be {ge:,} or more",
        "less_than_equal": "must be {le:,} or less",
        "value_error": "{error}",
    }
)
"""What is said of a value that typer refuses, by pydantic's type of error."""
_UNIT: Final = re.compile(r"\[(kbit/s|bytes|%)\]")
"""Unit of an option in its help."""


def _in_words(error: Any) -> str:
    """An error of typer as the program's own, on one line: the option as typed, and what would be right."""
    from busplan.english import listed

    command = error.ctx.command_path if getattr(error, "ctx", None) else "busplan"
    words, hint = error.format_message().rstrip("."), f"`{command} --help` says more"
    if hasattr(error.__cause__, "errors"):  # a value that pydantic refused
        (refused, *_), param = error.__cause__.errors(), error.param
        choices = param.type_descriptor.choices
        if choices:
            right = f"expected {listed(choices, 'or')}"
        else:
            right = _WRONG.get(refused["type"], "{msg}").format(**{**refused, **refused.get("ctx", {})})
            unit = _UNIT.search(param.help or "")
            right += f", in {unit[1]}" if unit and refused["type"].endswith("_parsing") else ""
        is_of_environment = error.ctx.get_parameter_source(param.name).name == "ENVIRONMENT"
        typed = f"{param.envvar}=" if is_of_environment else f"{max(param.opts, key=len)} "
        return f"{typed}{refused['input'] or repr('')}: {right}; {hint}"
    if hasattr(error, "possibilities") and any("--set" in param.opts for param in error.cmd.params):
        # The beginning of an option of the command is more likely meant as that option.
        is_begun = any(option.startswith(f"{error.option_name}-") for option in error.possibilities or ())
        key = None if is_begun else _key_named(error.option_name.lstrip("-").replace("-", "_"))
        if key:
            words, hint = words.partition(" (")[0], f"--set {key}=... changes it for this run"
        if key == "node.axes":
            hint = "here --set bus.nodes=... (node.axes is the axes of one node); --axes is an option of plan"
    return f"{command}: {words[:1].lower()}{words[1:]}; {hint}"


def _key_named(name: str) -> str | None:
    """The first key of a profile that has a name apart from its unit; None without such a key."""
    from busplan.buses import kind_names
    from busplan.profile.kinds import profile_model, value_keys

    keys = (key for kind in kind_names() for key in value_keys(profile_model(kind), {}))
    return next((key for key in keys if f"{key.rpartition('.')[2]}_".startswith(f"{name}_")), None)


class PlainCommand(TyperCommand):
    """A command whose help has no Python types."""

    def __init__(self, name: str | None, **settings: Any) -> None:
        super().__init__(name, **settings)
        for param in self.params:
            if param.param_type_name == "argument":
                param.metavar = param.metavar or param.name.upper()

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line of the command."""
        try:
            return super().parse_args(ctx, args)
        except TyperException as error:
            error.__dict__.update(ctx=ctx, cmd=self)  # some have none
            raise

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Pieces of the usage line, without typer's braces around required arguments."""
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Complete options."""
        return _on_one_line(super().shell_complete(ctx, incomplete))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options."""
        _write_parameters(self, ctx, formatter)


def _write_parameters(command: Any, ctx: Any, formatter: Any) -> None:
    """Write arguments and options, each record of options below its title."""
    sections: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
    for param in command.get_params(ctx):
        names, words = param.get_help_record(ctx)
        if param.param_type_name == "argument":
            # Typer adds a Python type.
            sections["Arguments"].append((names.partition(" <")[0], words))
        else:
            sections.setdefault(param.rich_help_panel or "Options", []).append((names, words))
    for title, rows in sections.items():
        if rows:
            with formatter.section(title):
                formatter.write_dl(rows)


def _on_one_line(completions: list[Any]) -> list[Any]:
    """Shorten the help of completions: typer wraps long help, and fish takes each line for a completion."""
    from textwrap import shorten

    for completion in completions:
        completion.help = completion.help and shorten(completion.help, _OFFER, placeholder="...")
    return completions


SETTINGS: Final[dict[str, Any]] = {"help_option_names": ["-h", "--help"], "max_content_width": 100}
GROUPS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "Design": ("init", "import", "plan", "calibrate", "measured", "emulate", "map", "explore", "sweep", "compare"),
        "Analyse": ("capacity", "latency", "circle-test", "timeline", "explain", "report"),
        "Gate": ("check", "diff", "rule", "schema"),
        "Learn": ("manual", "profiles", "evidence", "paper"),
    }
)
"""In the order of the help."""
_MODULES: Final = {
    **{name: title.casefold() for title, names in GROUPS.items() for name in names},
    "init": "init",
    "sweep": "sweep",
}
"""Module of each command: one for each group, and two commands with their own."""
COMMANDS: Final = tuple(name for names in GROUPS.values() for name in names)


class LazyGroup(TyperGroup):
    """The program's group of commands, each loaded at its first use; its help lists them first."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002 - typer's signature
        """Load a command; None if there is no such command."""
        if cmd_name in COMMANDS and cmd_name not in self.commands:
            command = getattr(
                import_module(f"busplan.cli.{_MODULES[cmd_name]}"), f"{cmd_name.replace('-', '_')}_command"
            )
            single = typer.Typer(
                add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False, context_settings=SETTINGS
            )
            single.command(cmd_name, cls=PlainCommand, epilog=FAILURES)(command)
            self.commands[cmd_name] = get_command(single)
        return self.commands.get(cmd_name)

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - typer's signature
        """Names of all commands, without loading them."""
        return list(COMMANDS)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command of a command line."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-") and not ctx.resilient_parsing:
            from busplan.english import did_you_mean

            near = did_you_mean(args[0], list(COMMANDS)) or "`busplan --help` lists them"
            raise BusplanError(f"{args[0]}: no such command; {near}")
        return super().resolve_command(ctx, args)

    def main(self, args: Any = None, *arguments: Any, **settings: Any) -> Any:
        """Run the program and return its exit code; without any word typer shows the help."""
        if not (sys.argv[1:] if args is None else args):
            return super().main(args, *arguments, **settings)
        try:
            return super().main(args, *arguments, **{**settings, "standalone_mode": False})
        except TyperException as error:
            raise BusplanError(_in_words(error)) from None

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Complete commands and options."""
        return _on_one_line(super().shell_complete(ctx, incomplete))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each group of commands, each command with its whole first sentence, which typer would shorten."""
        for title, names in GROUPS.items():
            commands: list[Any] = [self.get_command(ctx, name) for name in names]
            with formatter.section(title):
                formatter.write_dl([(command.name, command.help.partition("\n\n")[0]) for command in commands])

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write commands and options."""
        self.format_commands(ctx, formatter)
        _write_parameters(self, ctx, formatter)
