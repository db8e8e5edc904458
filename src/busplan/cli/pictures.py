"""An answer that may also be a picture: its form, and how it is written."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final, Literal, Protocol

import typer

from busplan.cli.answering import answer, require_apart
from busplan.cli.options import form_of_file, output_option
from busplan.cli.output import refuse_terminal, write_document
from busplan.errors import BusplanError
from busplan.extras import require_resvg
from busplan.forms import ENDINGS, PICTURES, Form, Picture, ending_expected
from busplan.profile.changes import KeyChanges

if TYPE_CHECKING:
    from busplan.forms.blocks import Report
    from busplan.forms.charts import Drawing


DrawnForm = Literal[Form, Picture]
_ENDINGS: Final[Mapping[str, DrawnForm]] = MappingProxyType({**ENDINGS, **PICTURES})
DrawnFormatOption = Annotated[
    DrawnForm | None,
    typer.Option(
        "--format",
        help="Form of the answer; a table is plain text. png goes to a file or a pipe, and needs the extra plot "
        "(resvg-py).  [default: by the ending of --output, else table]",
        show_default=False,
    ),
]
DrawnOutputOption = Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(_ENDINGS)}")]


def drawn_form(given: DrawnForm | None, output: Path | None) -> DrawnForm:
    """Choose the form by --format or by the ending of the file; a table without both.

    Raises
    ------
    BusplanError
        The ending is not known, or the form is png and resvg-py is missing or standard output is a terminal.
    """
    chosen = form_of_file(given, output, forms=_ENDINGS, default="table")
    if chosen == "png":
        if output is None:
            refuse_terminal(chosen)
        require_resvg(f"--format {chosen}")
    return chosen


def plot_form(path: Path) -> Picture:
    """Form of the picture of --plot, by the ending of its name.

    Raises
    ------
    BusplanError
        The ending is not known, or the form is png and resvg-py is missing.
    """
    ending = path.suffix.lower()
    if ending not in PICTURES:
        raise BusplanError(f"--plot {path}: {ending_expected(ending, PICTURES)}")
    if ending == ".png":
        require_resvg("--plot")
    return PICTURES[ending]


class Drawn(Protocol):
    """An answer that has a picture."""

    def report(self) -> "Report":
        """The answer in blocks."""

    def drawing(self) -> "Drawing":
        """The picture."""


def show_drawn(
    find: Callable[[], Drawn],
    form: DrawnForm,
    output: Path | None,
    *,
    inputs: Iterable[Path],
    changes: KeyChanges,
    is_whole: bool,
) -> None:
    """Write an answer, as a picture or as a report.

    Parameters
    ----------
    find
        Function that gives the answer.
    form
        As `picture_form` chose it.
    output, inputs, changes, is_whole
        As for `answer`.

    Raises
    ------
    BusplanError
        It cannot be written, or there is nothing to draw.
    """
    match form:
        case "svg" | "png":
            from busplan.forms.svg import content

            require_apart({"--output": output}, inputs=inputs)
            write_document(content(find().drawing(), form, note=_changes_words(changes)), output)
        case _:
            with answer(form, output, inputs=inputs, changes=changes, is_whole=is_whole) as give:
                give(find().report())


def _changes_words(changes: KeyChanges) -> str:
    """The --set options, for the title of a picture in a file of its own."""
    from busplan.forms.numbers import sentence_text
    from busplan.questions.base.sentences import changes_sentences

    return " ".join(map(sentence_text, changes_sentences(changes)))
