"""Write the answer of a command: in the requested form, to standard output or a file."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from busplan.cli.destinations import require_apart
from busplan.cli.options import form_of_file
from busplan.cli.output import emit_document, emit_pages, is_styled, refuse_terminal, say
from busplan.errors import BusplanError
from busplan.files import document_bytes, new_file
from busplan.forms import ENDINGS, Form, render
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.forms.blocks import Report

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
    from busplan.questions.words.documents import changed_report

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
