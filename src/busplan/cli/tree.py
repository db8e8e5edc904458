"""The commands as pages of the manual: the only reader of typer's tree."""

import inspect
from collections.abc import Iterator
from typing import Any

from busplan import __version__
from busplan.answers.manual.closing import closing_sections
from busplan.answers.manual.pages import CommandPage, Entry, Manual

_EXAMPLE = "Example: "


def manual_of(root: Any) -> Manual:
    """Read the manual out of the program's commands, as their --help has it.

    Parameters
    ----------
    root
        The group of all commands.
    """
    top = _context(root, "busplan")
    contexts = [_context(command, name, parent=top) for name, command in _commands(root, top)]
    variables = [entry for context in contexts for entry in _variables(context)]
    return Manual(_page(top), __version__, tuple(map(_page, contexts)), closing_sections(variables))


def _context(command: Any, name: str, parent: Any = None) -> Any:
    return command.context_class(command, info_name=name, parent=parent, **command.context_settings)


def _commands(root: Any, top: Any) -> Iterator[tuple[str, Any]]:
    for name in root.list_commands(top):
        command = root.get_command(top, name)
        if not command.hidden:
            yield name, command


def _page(context: Any) -> CommandPage:
    command = context.command
    texts = [" ".join(text.split()) for text in inspect.cleandoc(command.help).split("\n\n")]
    is_group = context.parent is None
    # One --help stands for all of them.
    params = command.get_params(context) if is_group else command.params
    return CommandPage(
        name=context.info_name,
        called=context.command_path,
        usage=" ".join(command.collect_usage_pieces(context)),
        summary=texts[0],
        paragraphs=tuple(text for text in texts[1:] if not text.startswith(_EXAMPLE)),
        examples=tuple(text.removeprefix(_EXAMPLE) for text in texts if text.startswith(_EXAMPLE)),
        arguments=_entries(context, params, kind="argument"),
        options=_entries(context, params, kind="option"),
    )


def _entries(context: Any, params: list[Any], *, kind: str) -> tuple[Entry, ...]:
    return tuple(
        Entry(_names(param), _value(param, context), " ".join(record[1].split()))
        for param in params
        if param.param_type_name == kind and (record := param.get_help_record(context))
    )


def _names(param: Any) -> tuple[str, ...]:
    if param.param_type_name == "argument":
        return (param.metavar,)
    # In no order of typer's own: those of --help come out of a set.
    return (*sorted(param.opts, key=len), *param.secondary_opts)


def _value(param: Any, context: Any) -> str:
    """What stands for an option's value: its metavar, or its choices."""
    if param.param_type_name == "argument" or param.is_flag:
        return ""
    return str(param.display_type_rich(context)).strip("<>")


def _variables(context: Any) -> Iterator[Entry]:
    for param in context.command.params:
        if param.envvar:
            yield Entry(
                (param.envvar,),
                "",
                f"What `{context.command_path}` takes for {max(param.opts, key=len)}, where it is not given.",
            )
