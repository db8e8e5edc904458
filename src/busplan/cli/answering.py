"""How a command gives its answer: in the form that is asked for, on standard output or in a file."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from busplan.cli.destinations import require_apart
from busplan.cli.options import form_of_file
from busplan.cli.output import document_bytes, emit_document, emit_text, is_styled, new_file, say
from busplan.errors import BusplanError
from busplan.forms import ENDINGS, Form, render

if TYPE_CHECKING:
    from busplan.forms.blocks import Report

NOTHING_REFUSED: Final[Mapping[Form, str]] = MappingProxyType({})


@contextmanager
def answer(
    form: Form | None,
    output: Path | None,
    *,
    inputs: Iterable[Path] = (),
    default: Form = "table",
    refused: Mapping[Form, str] = NOTHING_REFUSED,
) -> "Iterator[Callable[[Report], None]]":
    """Open the destination of an answer before the work for it: a path that cannot be written is said at once.

    Parameters
    ----------
    form
        What --format says.
    output
        What --output says.
    inputs
        Files that the command reads.
    default
        The form on standard output, where none is asked for.
    refused
        Forms that make no sense for the question, with the reason.

    Raises
    ------
    BusplanError
        A file that cannot be written, or that is an input; a form that is refused; or a name that says no form.
    """
    chosen = form_of_file(form, output, forms=ENDINGS, default=default)
    if chosen in refused:
        raise BusplanError(f"--format {chosen}: {refused[chosen]}")
    if output is None:
        yield lambda report: give(report, chosen)
        return
    require_apart({"--output": output}, inputs=inputs)
    with new_file(output, overwrite=True) as file:
        yield lambda report: _write(file.write, report, chosen)
    say(f"wrote {output}")


def _write(write: Callable[[bytes], object], report: "Report", form: Form) -> None:
    write(document_bytes(render(report, form)))


def give(report: "Report", form: Form) -> None:
    """Write an answer to standard output: for a terminal in its width and colours."""
    if form == "table":
        from busplan.forms import terminal

        emit_text(terminal.text(report, width=columns(), styled=is_styled()))
    else:
        emit_document(render(report, form))


def columns() -> int:
    """Width of the terminal; in a pipe a drawing is the same wherever it runs."""
    from busplan.forms.terminal import WIDTH

    if not sys.stdout.isatty():
        return WIDTH
    from shutil import get_terminal_size

    return get_terminal_size((WIDTH, 24)).columns
