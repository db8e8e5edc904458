"""Errors of the option parser in the form of the program's own: what, then what is wrong with it."""

from typing import Any

from busplan.errors import BusplanError
from busplan.nearest import did_you_mean


def usage_error(error: Any) -> BusplanError | None:
    """Write an error of the option parser as one of the program; None if it is none, but the help.

    Parameters
    ----------
    error
        What typer raised. Its classes are private: they are told apart by their names.
    """
    kind, context = type(error).__name__, error.ctx
    if kind == "NoArgsIsHelpError":
        return None
    command = "busplan" if context is None else context.command_path
    see = f"`{command} --help` says more"
    match kind:
        case "NoSuchOption":
            known = [] if context is None else [name for one in context.command.params for name in one.opts]
            words = f"{error.option_name}: no such option; {did_you_mean(error.option_name, known) or see}"
        case "MissingParameter":
            words = f"{_name(error)}: missing; {see}"
        case "BadParameter":
            words = f"{_name(error)}: {_reason(error.message)}"
        case "BadOptionUsage":
            words = f"{error.option_name}: needs a value"
        case _:
            words = f"{command}: {error.message[:1].lower()}{error.message[1:].rstrip('.')}; {see}"
    return BusplanError(words)


def unknown_command(name: str, known: list[str]) -> BusplanError:
    """The error of a command that does not exist.

    Parameters
    ----------
    name
        The command as typed.
    known
        Names of all commands.
    """
    return BusplanError(f"{name}: no such command; {did_you_mean(name, known) or '`busplan --help` lists them'}")


def _name(error: Any) -> str:
    """Name of the option or argument that an error is about."""
    param = error.param
    if param is None:
        return "the command line"
    return str(max(param.opts, key=len) if param.param_type_name == "option" else param.metavar or param.name.upper())


def _reason(message: str) -> str:
    """What is wrong with a value, in the words of the parser, as the end of a line."""
    reason = message.removeprefix("Value error, ").removesuffix(".").replace("Input should be", "must be")
    return f"{reason[:1].lower()}{reason[1:]}"
