"""Write the answer of a command: in the requested form, to standard output or a file."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from busplan.cli.options import DrawnForm
from busplan.cli.output import emit_pages, is_styled, refuse_terminal, say, terminal_size, write_document
from busplan.errors import BusplanError
from busplan.extras import require_resvg
from busplan.files import NewFile, new_file
from busplan.forms import Form, render
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.forms.blocks import Report
    from busplan.questions.base.answer import Answer

_ALL_SHOWS: Final = "--all shows all."
_PROFILE: Final = ".toml"


@contextmanager
def answer(
    form: DrawnForm,
    output: Path | None,
    *,
    typed: str,
    inputs: Iterable[Path] = (),
    changes: KeyChanges = NO_CHANGES,
    is_whole: bool = False,
) -> "Iterator[Callable[[Answer | Report], None]]":
    """Open the destination of an answer before the work, so that a path that cannot be written fails at once.

    Parameters
    ----------
    form
        Form of the answer.
    output
        Value of --output.
    typed
        The option that chose the form.
    inputs
        Files that the command reads.
    changes
        Changes of the profile; the answer names those made by --set.
    is_whole
        Value of --all.

    Yields
    ------
    Callable
        Writes an answer, or its report, to the destination in the form.

    Raises
    ------
    BusplanError
        The file cannot be written or is an input; a page of HTML or a PNG would go to a terminal, or resvg-py is
        missing.
    """
    if output is None and form in ("html", "png"):
        refuse_terminal(form)
    if form == "png":
        require_resvg(typed)
    if output is not None:
        require_apart({"--output": output}, inputs=inputs)
    with ExitStack() as files:
        file = None if output is None else files.enter_context(new_file(output, overwrite=True))
        yield partial(_give, form=form, typed=typed, file=file, changes=changes, is_whole=is_whole)
    if output is not None:
        say(f"wrote {output}")


def _give(
    shown: "Answer | Report", *, form: DrawnForm, typed: str, file: NewFile | None, changes: KeyChanges, is_whole: bool
) -> None:
    """Write an answer as a picture or as a report, with the --set options named."""
    from busplan.forms.blocks import Report, first_drawing
    from busplan.questions.base.sentences import changed_report, changes_sentences

    match form:
        case "svg" | "png":
            from busplan.forms.numbers import sentence_text
            from busplan.forms.svg import content

            drawing = first_drawing(shown.blocks) if isinstance(shown, Report) else shown.drawing()
            if drawing is None:
                raise BusplanError(f"{typed}: there is nothing to draw")
            note = " ".join(map(sentence_text, changes_sentences(changes)))
            write_document(content(drawing, form, note=note), file)
        case _:
            report = changed_report(shown if isinstance(shown, Report) else shown.report(), changes)
            write_report(report._replace(is_whole=is_whole or report.is_whole), form, file)


def write_report(report: "Report", form: Form, file: NewFile | None) -> None:
    """Write a report to a file or standard output, on a terminal in its width and colours."""
    report = report._replace(whole_by=_ALL_SHOWS)
    if form == "table" and file is None:
        from busplan.forms import terminal

        width, _ = terminal_size() or (None, None)
        emit_pages(terminal.text(report, width=width, styled=is_styled()))
    else:
        write_document(render(report, form), file)


def require_apart(
    outputs: Mapping[str, Path | None], *, inputs: Iterable[Path] = (), of_profiles: bool = False
) -> None:
    """Refuse output paths that would destroy a file; call it before any work.

    Parameters
    ----------
    outputs
        Files to write, by option.
    inputs
        Files to read; "-" is standard input.
    of_profiles
        If True, the outputs are profiles; other outputs must not end in .toml.

    Raises
    ------
    BusplanError
        An output is an input or another output, also through a link, or has the name of a profile without being one.
    """
    given = {option: path for option, path in outputs.items() if path is not None}
    if not given:
        return
    read = {_identity(path): "standard input" if str(path) == "-" else path for path in inputs}
    written: dict[object, str] = {}
    for option, path in given.items():
        if str(path) == "-":
            raise BusplanError(f"{option} -: standard output has the document; give the name of a file")
        place = _identity(path)
        if place in read:
            raise BusplanError(f"{option} {path}: would overwrite {read[place]}, which is read; give another name")
        if place in written:
            raise BusplanError(f"{written[place]} and {option} {path}: the same file; give two names")
        if not of_profiles and any(name.lower().endswith(_PROFILE) for name in (path.name, _real(path).name)):
            raise BusplanError(f"{option} {path}: {_PROFILE} is a profile's name, and no profile is written there")
        written[place] = f"{option} {path}"


def profile_files(*arguments: str) -> Iterator[Path]:
    """Files of PROFILE arguments; invalid ones are left out: reading them will report the error."""
    from busplan.profile.sources import locate

    for argument in arguments:
        with suppress(BusplanError, ValueError):  # ValueError: a NUL in the path
            yield locate(argument)[0]


def _identity(path: Path) -> object:
    """Identity of a file, equal for all its names."""
    with suppress(OSError, ValueError, AttributeError):  # no such file, and so on; AttributeError: a closed input
        status = os.fstat(sys.stdin.fileno()) if str(path) == "-" else path.stat()
        return status.st_dev, status.st_ino
    # A new file: names that differ in case are one file on some systems.
    real = _real(path)
    return str(real.parent), real.name.casefold()


def _real(path: Path) -> Path:
    with suppress(ValueError):
        return Path(os.path.realpath(path))
    return path
