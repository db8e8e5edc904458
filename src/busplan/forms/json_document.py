"""An answer as one JSON document."""

from collections.abc import Mapping

from busplan.forms.blocks import Report
from busplan.printable import json_text


def to_json(document: Mapping[str, object]) -> str:
    """Write a JSON document, indented, with a final newline.

    Raises
    ------
    ValueError
        A number is not finite.
    """
    return json_text(document, indent=2) + "\n"


def text(report: Report) -> str:
    """Write an answer as JSON."""
    return to_json(report.document())
