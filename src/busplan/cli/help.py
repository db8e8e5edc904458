"""How --help reads: arguments by plain names, commands in whole sentences, and what the exit codes mean."""

from typing import Any, Final

from typer.core import TyperCommand, TyperGroup

FAILURES: Final = "Exits 2 when it could not do its job and says why on standard error, 130 when interrupted."
"""What holds for every command, and stands at the end of its help."""
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

    def get_short_help_str(self, limit: int = 0) -> str:  # noqa: ARG002 - the signature is typer's
        """First paragraph of the help, whole: typer would cut it at the end of a line."""
        return " ".join((self.help or "").partition("\n\n")[0].split())

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Pieces of the usage line, without the braces that typer puts around what is required."""
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options."""
        _write_parameters(self, ctx, formatter)


class PlainGroup(TyperGroup):
    """The program's help: its commands first."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Options, those of typer's completion in words of ours: it adds them behind our back."""
        params: list[Any] = super().get_params(ctx)
        for param in params:
            param.help = _COMPLETION.get(param.name, param.help)
        return params

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write commands and options."""
        self.format_commands(ctx, formatter)
        _write_parameters(self, ctx, formatter)


def _write_parameters(command: TyperCommand | TyperGroup, ctx: Any, formatter: Any) -> None:
    for kind in ("argument", "option"):
        records = (param.get_help_record(ctx) for param in _of_kind(command.get_params(ctx), kind))
        # Typer names a Python type behind an argument.
        rows = [(row[0].partition(" <")[0] if kind == "argument" else row[0], row[1]) for row in records if row]
        if rows:
            with formatter.section(f"{kind.capitalize()}s"):
                formatter.write_dl(rows)


def _of_kind(params: list[Any], kind: str) -> list[Any]:
    return [param for param in params if param.param_type_name == kind]
