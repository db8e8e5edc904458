"""The record of an answer as one JSON document."""

from collections.abc import Mapping

from busplan.forms.blocks import Report
from busplan.printable import json_text


def to_json(document: Mapping[str, object]) -> str:
    """Write one JSON document, indented, with a line end.

    Raises
    ------
    ValueError
        A number is not finite: such a document must not leave the program.
    """
    return json_text(document, indent=2) + "\n"


def text(report: Report) -> str:
    """Write the document of an answer."""
    return to_json(report.document())
