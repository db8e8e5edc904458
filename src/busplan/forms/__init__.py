"""Blocks of an answer, and one module for each form that writes them."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, assert_never

if TYPE_CHECKING:
    from busplan.forms.blocks import Report

Form = Literal["table", "markdown", "html", "csv", "json"]
RowsForm = Literal["csv", "json", "parquet"]
"""Forms with every row of a sweep."""
Picture = Literal["svg", "png"]
"""Forms of a picture in a file of its own. A PNG needs the extra `plot` (resvg-py)."""
ENDINGS: Final[Mapping[str, Form]] = MappingProxyType(
    {".txt": "table", ".md": "markdown", ".html": "html", ".csv": "csv", ".json": "json"}
)
ROWS_ENDINGS: Final[Mapping[str, RowsForm]] = MappingProxyType({".csv": "csv", ".json": "json", ".parquet": "parquet"})
PICTURES: Final[Mapping[str, Picture]] = MappingProxyType({".svg": "svg", ".png": "png"})
"""Forms of pictures by file name extension."""


def ending_expected(ending: str, endings: Iterable[str], *, otherwise: str = "") -> str:
    """Message on the endings that a file name may have instead of its own.

    Examples
    --------
    >>> ending_expected(".pdf", [".svg", ".png"])
    'expected a name ending in .svg, .png; for a PDF write .svg: a browser prints it'
    """
    endings = list(endings)
    pdf = "; for a PDF write .svg: a browser prints it" if ending == ".pdf" and ".svg" in endings else ""
    return f"expected a name ending in {', '.join(endings)}{otherwise}{pdf}"


def render(report: "Report", form: Form) -> str:
    """Write an answer in a form, loading only the module of that form.

    For the colours and width of a terminal, call `terminal.text`. An answer without this form raises BusplanError.
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
            from busplan.english import to_json

            return to_json(report.document)
        case _:
            assert_never(form)
