"""`busplan import`."""

import shlex
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from busplan.cli.destinations import require_apart
from busplan.cli.options import STANDARD_OUTPUT
from busplan.cli.output import emit_document, say
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError
from busplan.files import new_file


def import_command(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE",
            help="Files of one machine, each recognised by its content; - is standard input.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="NEW.toml",
            help="Write the profile to a new file.  [default: standard output]",
            show_default=False,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Let -o overwrite a file that is already there.")] = False,
) -> None:
    """Make a profile from the files of a machine: ENI, a scan of its bus, DBC, EDS, a CAN log and others.

    Several files of one machine are merged: an ENI has the frames, the text of `ethercat slaves -v` the measured delays
    of devices, `ethercat pdos` their bytes; a CAN log has the messages of a network, a DBC their names. Each value has
    its grade, file and line in a comment; values in no file are assumed, and named at the end with the verdict.
    `busplan manual import` lists what each format gives.

    The profile goes to standard output or to the file of -o; an existing file stays, unless --force is given. Exits 0
    when the profile is written, with any verdict.

    Example: busplan import machine.xml slaves.txt -o machine.toml
    """
    if paths.count("-") > 1:
        raise BusplanError("-: only one FILE can be standard input")
    new = None if output == STANDARD_OUTPUT else output
    if new is not None and new.suffix.lower() != ".toml":
        raise BusplanError(f"--output {new}: expected a name ending in .toml, for it is a profile")
    inputs = [Path(path) for path in paths]
    require_apart({"--output": new}, inputs=inputs, of_profiles=True)
    with ExitStack() as files:
        # Opened before the work, so that a path that cannot be written fails at once.
        file = None if new is None else files.enter_context(new_file(new, overwrite=force))
        from busplan.questions.import_ import import_profile

        name = None if new is None else new.stem
        with progress_bar("recording") as progress:
            answer = import_profile(paths, name=name, progress=progress)
        sentences = answer.sentences()
        if file is None:
            emit_document(answer.text)
        else:
            file.write(answer.text.encode())
    say(*([f"wrote {new}"] if new else []), *sentences)
    if new:
        shown = shlex.quote(f"./{new}" if str(new).startswith("-") else str(new))
        say(f"next: busplan capacity {shown}")
