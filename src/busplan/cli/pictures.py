"""The form of an answer that may also be a picture, and the title of that."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from busplan.cli.options import AnyForm, form_of_file
from busplan.cli.output import refuse_terminal, write_document
from busplan.errors import BusplanError
from busplan.extras import require_resvg
from busplan.forms import PICTURES, Picture, ending_expected
from busplan.profile.changes import KeyChanges

if TYPE_CHECKING:
    from busplan.forms.blocks import Sentence


PICTURE_FORMAT_HELP: Final = (
    "Form of the answer; a table is text in lines. png is for a file or a pipe, and needs the extra plot "
    "(resvg-py).  [default: by the ending of --output, else table]"
)
"""Of --format, where an answer may also be SVG or PNG."""


def picture_form(given: AnyForm | None, output: Path | None, *, forms: Mapping[str, AnyForm]) -> AnyForm:
    """Choose the form by --format or by the ending of the file; a table without both.

    Parameters
    ----------
    given
        Value of --format.
    output
        Value of --output.
    forms
        Forms by ending; those with .txt and .png are among them.

    Raises
    ------
    BusplanError
        The ending is not known, or the form is png and resvg-py is missing or standard output is a terminal.
    """
    chosen = form_of_file(given, output, forms=forms, default=forms[".txt"])
    if chosen == forms[".png"]:
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


def write_picture(svg: str, form: Picture, output: Path | None) -> None:
    """Write a drawing to a file or to standard output.

    Raises
    ------
    BusplanError
        It cannot be written.
    """
    from busplan.forms.raster import picture

    write_document(picture(svg, form), output)


def picture_title(headline: "Sentence", changes: KeyChanges) -> str:
    """Title of a picture that is a file of its own: the headline of its answer, and what was set."""
    from busplan.forms.columns import sentence_text
    from busplan.questions.words.documents import changes_sentences

    return " ".join(map(sentence_text, (headline, *changes_sentences(changes))))
