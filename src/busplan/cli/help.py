"""Layout of --help: plain argument names, whole sentences for commands, and the exit codes."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any, Final

from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException

from busplan.errors import BusplanError

FAILURES: Final = (
    "Exits 2 when it could not do its job and says why on standard error, 130 when interrupted, 143 when terminated, "
    "129 when hung up."
)
"""End of the help of every command."""
_OFFER: Final = 60
"""Most characters of help for a completion in the shell."""
_COMPLETION: Final = {
    "install_completion": "Add completion by the Tab key to the start-up file of your shell, and exit.",
    "show_completion": "Print the script that does it, to look at or to place by hand, and exit.",
}


@contextmanager
def _usage_in_our_form(command: str, *, takes_set: bool = False) -> Iterator[None]:
    """Raise errors of the option parser as the program's own, on one line."""
    try:
        yield
    except TyperException as error:
        words = error.format_message().rstrip(".").replace("Value error, ", "").replace("Input should", "must")
        unknown = re.search(r"option: --([a-z-]+)", words) if takes_set else None
        key = _key_named(unknown[1].replace("-", "_")) if unknown else None
        hint = f"`{command} --help` says more"
        if key:
            words, hint = words.partition(" (")[0], f"--set {key}=... changes it for this run"
        raise BusplanError(f"{command}: {words[:1].lower()}{words[1:]}; {hint}") from None


def _key_named(name: str) -> str | None:
    """The key of a profile that has a name, but for its unit; the first one, or none."""
    from busplan.buses import kind_names
    from busplan.profile.kinds import profile_model, value_keys

    keys = (key for kind in kind_names() for key in value_keys(profile_model(kind), {}))
    return next((key for key in keys if f"{key.rpartition('.')[2]}_".startswith(f"{name}_")), None)


class PlainCommand(TyperCommand):
    """A command whose help has no Python types."""

    def __init__(self, name: str | None, **settings: Any) -> None:
        super().__init__(name, **settings)
        for param in _of_kind(self.params, "argument"):
            param.metavar = param.metavar or param.name.upper()

    def make_context(self, info_name: str | None, *arguments: Any, **settings: Any) -> Any:
        """Parse the command line of the command."""
        takes_set = any("--set" in param.opts for param in self.params)
        with _usage_in_our_form(f"busplan {info_name}", takes_set=takes_set):
            return super().make_context(info_name, *arguments, **settings)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Pieces of the usage line, without typer's braces around required arguments."""
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Complete options."""
        return _on_one_line(super().shell_complete(ctx, incomplete))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options."""
        _write_parameters(self, ctx, formatter)


class PlainGroup(TyperGroup):
    """The program; its help lists the commands first."""

    def make_context(self, info_name: str | None, args: list[str], *arguments: Any, **settings: Any) -> Any:
        """Parse the options before the command; without any word typer shows the help."""
        with _usage_in_our_form("busplan") if args else nullcontext():
            return super().make_context(info_name, args, *arguments, **settings)

    def invoke(self, ctx: Any) -> Any:
        """Parse the command line of a command and run it."""
        with _usage_in_our_form("busplan"):
            return super().invoke(ctx)

    def get_params(self, ctx: Any) -> list[Any]:
        """Options, with our own help for the completion options that typer adds."""
        params: list[Any] = super().get_params(ctx)
        for param in params:
            param.help = _COMPLETION.get(param.name, param.help)
        return params

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Complete commands and options."""
        return _on_one_line(super().shell_complete(ctx, incomplete))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each group of commands, each command with its whole first sentence, which typer would shorten."""
        for title, names in self.groups().items():
            commands: list[Any] = [self.get_command(ctx, name) for name in names]
            with formatter.section(title):
                formatter.write_dl([(one.name, one.help.partition("\n\n")[0]) for one in commands])

    def groups(self) -> Mapping[str, Sequence[str]]:
        """Names of the commands under the title of each group."""
        return {"Commands": list(self.commands)}

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write commands and options."""
        self.format_commands(ctx, formatter)
        _write_parameters(self, ctx, formatter)


def _write_parameters(command: TyperCommand | TyperGroup, ctx: Any, formatter: Any) -> None:
    for kind in ("argument", "option"):
        records = (param.get_help_record(ctx) for param in _of_kind(command.get_params(ctx), kind))
        # Typer adds a Python type to an argument.
        rows = [(row[0].partition(" <")[0] if kind == "argument" else row[0], row[1]) for row in records if row]
        if rows:
            with formatter.section(f"{kind.capitalize()}s"):
                formatter.write_dl(rows)


def _on_one_line(items: list[Any]) -> list[Any]:
    """Shorten the help of completions: typer wraps long help, and fish takes each line for a completion."""
    from textwrap import shorten

    for item in items:
        item.help = item.help and shorten(item.help, _OFFER, placeholder="...")
    return items


def _of_kind(params: list[Any], kind: str) -> list[Any]:
    return [param for param in params if param.param_type_name == kind]
