"""Write the answer of a command: in the requested form, to standard output or a file."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from busplan.cli.options import form_of_file
from busplan.cli.output import emit_document, emit_pages, is_styled, refuse_terminal, say
from busplan.errors import BusplanError
from busplan.files import document_bytes, new_file
from busplan.forms import ENDINGS, Form, render
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.forms.blocks import Report


_PROFILE: Final = ".toml"


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
    asked = {option: path for option, path in outputs.items() if path is not None}
    if not asked:
        return
    read = {_identity(path): "standard input" if str(path) == "-" else path for path in inputs}
    written: dict[object, str] = {}
    for option, path in asked.items():
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


_NARROWEST: Final = 40
"""Least width to lay out for; a narrower terminal breaks the lines itself."""
NOTHING_REFUSED: Final[Mapping[Form, str]] = MappingProxyType({})


@contextmanager
def answer(
    form: Form | None,
    output: Path | None,
    *,
    inputs: Iterable[Path] = (),
    changes: KeyChanges = NO_CHANGES,
    is_whole: bool = False,
    default: Form = "table",
    refused: Mapping[Form, str] = NOTHING_REFUSED,
) -> "Iterator[Callable[[Report], None]]":
    """Open the destination of an answer before the work, so that a path that cannot be written fails at once.

    Parameters
    ----------
    form
        Value of --format.
    output
        Value of --output.
    inputs
        Files that the command reads.
    changes
        Changes of the profile; the answer names those made by --set.
    is_whole
        Value of --all.
    default
        Form on standard output without --format.
    refused
        Forms that this command does not have, with the reason.

    Yields
    ------
    Callable
        Writes a report to the destination, in the chosen form.

    Raises
    ------
    BusplanError
        The file cannot be written or is an input, the form is refused, or the file name has no known ending; a page of
        HTML would go to a terminal.
    """
    chosen = form_of_file(form, output, forms=ENDINGS, default=default)
    if chosen in refused:
        raise BusplanError(f"--format {chosen}: {refused[chosen]}")
    if output is None:
        if chosen == "html":
            refuse_terminal(chosen)
        yield lambda report: give(_completed(report, changes, is_whole=is_whole), chosen)
        return
    require_apart({"--output": output}, inputs=inputs)
    with new_file(output, overwrite=True) as file:
        yield lambda report: _write(file.write, _completed(report, changes, is_whole=is_whole), chosen)
    say(f"wrote {output}")


def _completed(report: "Report", changes: KeyChanges, *, is_whole: bool) -> "Report":
    """The report with the --set options named, whole where --all asks for it."""
    return report_with(changes, report)._replace(is_whole=is_whole or report.is_whole)


def report_with(changes: KeyChanges, report: "Report") -> "Report":
    """Name the --set options in an answer: in a sentence at its top, and in its JSON document."""
    if not changes.by_set:
        return report
    from busplan.questions.base.sentences import changed_report

    return changed_report(report, changes)


def _write(write: Callable[[bytes], object], report: "Report", form: Form) -> None:
    write(document_bytes(render(report, form)))


def give(report: "Report", form: Form) -> None:
    """Write an answer to standard output, on a terminal in its width and colours."""
    if form == "table":
        from busplan.forms import terminal

        emit_pages(terminal.text(report, width=terminal_width(), height=terminal_height(), styled=is_styled()))
    else:
        emit_document(render(report, form))


def terminal_width() -> int | None:
    """Width of the terminal, by COLUMNS if set; None if standard output is no terminal."""
    if not sys.stdout.isatty():
        return None
    from shutil import get_terminal_size

    return max(get_terminal_size().columns, _NARROWEST)


def terminal_height() -> int | None:
    """Lines of the terminal, by LINES if set; None if standard output is no terminal."""
    if not sys.stdout.isatty():
        return None
    from shutil import get_terminal_size

    return get_terminal_size().lines


def columns() -> int:
    """Width of documents that always have one: the terminal's, or the default."""
    from busplan.forms.terminal import WIDTH

    return terminal_width() or WIDTH
