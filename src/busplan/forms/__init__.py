"""What an answer is made of, and one module for each form that it is written in."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, assert_never

if TYPE_CHECKING:
    from busplan.forms.blocks import Report

Form = Literal["table", "markdown", "html", "csv", "json"]
ENDINGS: Final[Mapping[str, Form]] = MappingProxyType(
    {".txt": "table", ".md": "markdown", ".html": "html", ".csv": "csv", ".json": "json"}
)
"""Forms by the ending of a file's name."""


def render(report: "Report", form: Form) -> str:
    """Write an answer in a form; only its own module is loaded.

    Parameters
    ----------
    report
        The answer.
    form
        Which form; a terminal's own colours and width are for `terminal.text`.

    Raises
    ------
    BusplanError
        The answer does not take this form.
    """
    match form:
        case "table":
            from busplan.forms import terminal

            return terminal.text(report)
        case "markdown":
            from busplan.forms import markdown

            return markdown.text(report)
        case "html":
            from busplan.forms import html

            return html.page(report)
        case "csv":
            from busplan.forms import csv_rows

            return csv_rows.text(report)
        case "json":
            from busplan.forms import json_document

            return json_document.text(report)
        case _:
            assert_never(form)
