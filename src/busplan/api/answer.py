"""Base class of the answers of the Python interface."""

import json
import os
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

from busplan.errors import BusplanError
from busplan.forms import ENDINGS, Form, render
from busplan.forms.blocks import Report
from busplan.forms.terminal import block_lines


class Answer(ABC):
    """A frozen answer: figures are attributes, `str()` is the report, `to_dict()` the JSON document.

    A notebook shows the tables and charts of `--format html`.
    """

    __slots__ = ()

    def to_json(self) -> str:
        """Return the document of the command's `--format json` as text."""
        return render(self._report(), "json")

    def to_dict(self) -> dict[str, Any]:
        """Return the document of the command's `--format json` as new plain data."""
        # Parse the text, so that both are equal whatever the types of the figures.
        document: dict[str, Any] = json.loads(self.to_json())
        return document

    @property
    def html(self) -> str:
        """The page of the command's `--format html`: one file without network or script."""
        return render(self._report(), "html")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the answer to a file in the form of its ending; an old file is replaced.

        Parameters
        ----------
        path
            A name ending in .html, .md, .txt, .json or .csv; .svg for an answer with a picture.

        Raises
        ------
        BusplanError
            Another ending, a form that the answer does not have, or the file cannot be written.
        """
        ending = Path(path).suffix.lower()
        svg = self._repr_svg_() if ending == ".svg" else None
        if svg is None and ending not in ENDINGS:
            picture = "; this answer has no picture" if ending == ".svg" else ""
            raise BusplanError(f"{path}: expected a name ending in {', '.join(ENDINGS)}{picture}")
        text = svg or self._text(ENDINGS[ending])
        try:
            # Bytes of a path that are not UTF-8 become escapes, as on the command line.
            Path(path).write_bytes(text.encode("utf-8", "backslashreplace"))
        except (OSError, ValueError) as error:  # ValueError: a NUL in the path
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise BusplanError(f"{path}: cannot be written: {reason}") from None

    def _text(self, form: Form) -> str:
        """The answer in a form."""
        return self.to_json() if form == "json" else render(self._report(), form)

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
        from busplan.forms.html import fragment

        return fragment(self._report())

    def _repr_svg_(self) -> str | None:
        from busplan.forms.picture import first_picture

        return first_picture(self._report().blocks())
