"""`busplan init`."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from busplan.cli.options import complete_profile
from busplan.cli.output import say, write_file
from busplan.errors import BusplanError


def init_command(
    name: Annotated[
        str,
        typer.Argument(help="Name of the new profile, or the path of its file; .toml is added where it is missing."),
    ] = "my-machine",
    source: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="SHIPPED",
            help="Name of the shipped profile to start from (see `busplan profiles`).",
            autocompletion=complete_profile,
        ),
    ] = "paper-4ms",
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is already there.")] = False,
) -> None:
    """Write a commented starter profile into the working directory.

    It is the shipped profile of --from under a name of its own, with its comments: edit it, then run `busplan capacity`
    on it. Exits 0 when the file is written; a file that is already there stays as it is, unless --force is given.

    Example: busplan init press-line --from paper-1ms
    """
    from busplan.profile.starter import starter_text

    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if not path.name.removesuffix(".toml").strip("."):
        raise BusplanError(f"{name!r}: no name for a profile; expected a name or a path, as press-line")
    write_file(path, starter_text(source, name=path.stem).encode(), overwrite=force)
    # A name that begins with a dash would be an option.
    shown = f"./{path}" if str(path).startswith("-") else str(path)
    say(f"wrote {path}; next: busplan capacity {shlex.quote(shown)}")
