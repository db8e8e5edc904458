"""What every answer of the Python interface can do."""

import json
from abc import ABC, abstractmethod
from html import escape
from typing import Any

from busplan.forms import render
from busplan.forms.blocks import Report
from busplan.forms.terminal import block_lines


class Answer(ABC):
    """A frozen answer: its figures as attributes, its report as text, its document as plain data."""

    __slots__ = ()

    def to_json(self) -> str:
        """Write the document of the command's `--format json`, as text with a line end."""
        return render(self._report(), "json")

    def to_dict(self) -> dict[str, Any]:
        """Give the document of the command's `--format json` as plain data, anew with each call."""
        # Through the text, so that both are the same whatever the figures are made of.
        document: dict[str, Any] = json.loads(self.to_json())
        return document

    @abstractmethod
    def _report(self) -> Report:
        """What the command answers."""

    def _headline(self) -> str:
        """The answer in one line."""
        return next(block_lines(self._report().blocks())).text

    def __str__(self) -> str:
        return render(self._report(), "table").removesuffix("\n")

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._headline()}>"

    def _repr_html_(self) -> str:
        # For notebooks, which would break the lines of a table; what a profile is called is text, never markup.
        return f"<pre>{escape(str(self))}</pre>"
