"""Base class of the answers of the Python interface."""

import json
from abc import ABC, abstractmethod
from html import escape
from typing import Any

from busplan.forms import render
from busplan.forms.blocks import Report
from busplan.forms.terminal import block_lines


class Answer(ABC):
    """A frozen answer: figures are attributes, `str()` is the report, `to_dict()` the JSON document."""

    __slots__ = ()

    def to_json(self) -> str:
        """Return the document of the command's `--format json` as text."""
        return render(self._report(), "json")

    def to_dict(self) -> dict[str, Any]:
        """Return the document of the command's `--format json` as new plain data."""
        # Parse the text, so that both are equal whatever the types of the figures.
        document: dict[str, Any] = json.loads(self.to_json())
        return document

    @abstractmethod
    def _report(self) -> Report:
        """The report of the command."""

    def _headline(self) -> str:
        """The answer in one line."""
        return next(block_lines(self._report().blocks())).text

    def __str__(self) -> str:
        return render(self._report(), "table").removesuffix("\n")

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._headline()}>"

    def _repr_html_(self) -> str:
        # Notebooks would wrap the lines of a table without <pre>.
        return f"<pre>{escape(str(self))}</pre>"
