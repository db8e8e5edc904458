"""How --help reads: arguments by plain names, commands in whole sentences, and what the exit codes mean."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException

FAILURES: Final = (
    "Exits 2 when it could not do its job and says why on standard error, 130 when interrupted, 143 when terminated, "
    "129 when hung up."
)
"""What holds for every command, and stands at the end of its help."""
_OFFER: Final = 60
"""Characters of help beside an offer of the shell's completion."""
_COMPLETION: Final = {
    "install_completion": "Add completion by the Tab key to the start-up file of your shell, and exit.",
    "show_completion": "Print the script that does it, to look at or to place by hand, and exit.",
}


class PlainCommand(TyperCommand):
    """A command whose help says what a user needs, and nothing of types."""

    def __init__(self, name: str | None, **settings: Any) -> None:
        super().__init__(name, **settings)
        for param in _of_kind(self.params, "argument"):
            param.metavar = param.metavar or param.name.upper()

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Pieces of the usage line, without the braces that typer puts around what is required."""
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Options that begin as typed."""
        return _on_one_line(super().shell_complete(ctx, incomplete))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options."""
        _write_parameters(self, ctx, formatter)


class PlainGroup(TyperGroup):
    """The program's help: its commands first."""

    def make_context(self, *arguments: Any, **settings: Any) -> Any:
        """Read the options before the command."""
        with _usage_as_text():
            return super().make_context(*arguments, **settings)

    def invoke(self, ctx: Any) -> Any:
        """Read what follows, and run the command."""
        with _usage_as_text():
            return super().invoke(ctx)

    def get_params(self, ctx: Any) -> list[Any]:
        """Options, those of typer's completion in words of ours: it adds them behind our back."""
        params: list[Any] = super().get_params(ctx)
        for param in params:
            param.help = _COMPLETION.get(param.name, param.help)
        return params

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Commands and options that begin as typed."""
        return _on_one_line(super().shell_complete(ctx, incomplete))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each command with its first sentence, whole: typer would cut it at the end of a line."""
        commands: list[Any] = [self.get_command(ctx, name) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl([(one.name, one.help.partition("\n\n")[0]) for one in commands if not one.hidden])

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write commands and options."""
        self.format_commands(ctx, formatter)
        _write_parameters(self, ctx, formatter)


@contextmanager
def _usage_as_text() -> Iterator[None]:
    """Show what was typed as text: typer escapes control characters in its errors, and no marks of direction."""
    try:
        yield
    except TyperException as error:
        from busplan.printable import printable_lines

        error.message = printable_lines(error.message)
        raise


def _write_parameters(command: TyperCommand | TyperGroup, ctx: Any, formatter: Any) -> None:
    for kind in ("argument", "option"):
        records = (param.get_help_record(ctx) for param in _of_kind(command.get_params(ctx), kind))
        # Typer names a Python type behind an argument.
        rows = [(row[0].partition(" <")[0] if kind == "argument" else row[0], row[1]) for row in records if row]
        if rows:
            with formatter.section(f"{kind.capitalize()}s"):
                formatter.write_dl(rows)


def _on_one_line(items: list[Any]) -> list[Any]:
    """Shorten the help beside a shell's offers: typer breaks what is long, and to fish each line is another offer."""
    from textwrap import shorten

    for item in items:
        item.help = item.help and shorten(item.help, _OFFER, placeholder="...")
    return items


def _of_kind(params: list[Any], kind: str) -> list[Any]:
    return [param for param in params if param.param_type_name == kind]
