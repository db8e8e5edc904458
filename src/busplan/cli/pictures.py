"""Choose the form of an answer that may also be a picture."""

from collections.abc import Mapping
from pathlib import Path

from busplan.cli.options import AnyForm, form_of_file
from busplan.cli.output import refuse_terminal


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
        The ending is not known, or the form is png and matplotlib is missing or standard output is a terminal.
    """
    chosen = form_of_file(given, output, forms=forms, default=forms[".txt"])
    if chosen == forms[".png"]:
        if output is None:
            refuse_terminal(chosen)
        from busplan.drawings.circle_plot import require_matplotlib

        require_matplotlib(f"--format {chosen}")
    return chosen
