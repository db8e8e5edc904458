"""Base class of the answers of the Python interface."""

import json
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from busplan.errors import BusplanError
from busplan.extras import require_pyarrow, require_resvg
from busplan.files import document_bytes, write_file
from busplan.forms import ENDINGS, Form, ending_expected, render
from busplan.forms.blocks import Report, first_drawing
from busplan.forms.charts import Drawing
from busplan.forms.terminal import block_lines

_LIBRARIES: Final = MappingProxyType({".png": require_resvg, ".parquet": require_pyarrow})
"""Functions that refuse a file whose library is not installed, by ending."""


class Answer(ABC):
    """A frozen answer: figures are attributes, `str()` is the report, `to_dict()` the JSON document.

    A notebook shows the tables and charts of `--format html`.
    """

    __slots__ = ()

    def to_json(self) -> str:
        """Return the document of the command's `--format json` as text."""
        return render(self._named(), "json")

    def to_dict(self) -> dict[str, Any]:
        """Return the document of the command's `--format json` as new plain data."""
        # The text is parsed, so that both are equal whatever the types of the figures.
        document: dict[str, Any] = json.loads(self.to_json())
        return document

    @property
    def html(self) -> str:
        """The page of `--format html`: one file without network or script."""
        return render(self._named(), "html")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the answer to a file in the form that its ending names; an old file is replaced atomically.

        Parameters
        ----------
        path
            A name ending in .html, .md, .txt, .json or .csv; .svg or .png (with the extra `plot`) for an answer with
            a picture; .parquet (with the extra `table`) for a sweep.

        Raises
        ------
        BusplanError
            Another ending, a form that the answer does not have, or the file cannot be written.
        """
        contents, ending = self._contents(), Path(path).suffix.lower()
        if ending not in contents:
            raise BusplanError(f"{path}: {ending_expected(ending, contents)}")
        if ending in _LIBRARIES:
            _LIBRARIES[ending](str(path))
        write_file(Path(path), document_bytes(contents[ending]()), overwrite=True)

    def _contents(self) -> Mapping[str, Callable[[], str | bytes]]:
        """Functions that make the content of a file, by ending."""
        texts = {ending: partial(self._text, form) for ending, form in ENDINGS.items()}
        return {**texts, ".svg": self.svg, ".png": self._png}

    def drawing(self) -> Drawing:
        """The picture as data.

        Raises
        ------
        BusplanError
            The answer has no picture.
        """
        drawing = first_drawing(self.report().blocks)
        if drawing is None:
            raise BusplanError(
                "this answer has no picture; timeline, map_, compare, circle_test, and capacity with "
                "sensitivity=True have one"
            )
        return drawing

    def svg(self, *, note: str = "") -> str:
        """The picture as an SVG file.

        Parameters
        ----------
        note
            Words after its title.

        Raises
        ------
        BusplanError
            The answer has no picture.
        """
        from busplan.forms.svg import content

        return str(content(self.drawing(), "svg", note=note))

    def _png(self) -> bytes:
        from busplan.forms.svg import content

        return document_bytes(content(self.drawing(), "png"))

    def _text(self, form: Form) -> str:
        return self.to_json() if form == "json" else render(self._named(), form)

    @abstractmethod
    def report(self) -> Report:
        """The answer in blocks, from which all forms but JSON and CSV are written."""

    def _named(self) -> Report:
        """The report with the changed constants named, as the command line names --set."""
        profile = getattr(self, "profile", None)
        if profile is None or not profile.constants:
            return self.report()
        from busplan.questions.base.arguments import key_changes
        from busplan.questions.base.sentences import changed_report

        return changed_report(
            self.report(), key_changes({f"constants.{name}": value for name, value in profile.constants})
        )

    def _shown(self) -> Report:
        """The report with a pointer to `to_dict()`, where the command line points to an option."""
        return self._named()._replace(whole_by="to_dict() has all figures.")

    def _headline(self) -> str:
        """The answer in one line."""
        return " ".join(next(block_lines(self.report().blocks)).text.split())

    def __str__(self) -> str:
        return render(self._shown(), "table").removesuffix("\n")

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._headline()}>"

    def _repr_html_(self) -> str:
        from busplan.forms.html import fragment

        return fragment(self._shown())

    def _repr_svg_(self) -> str | None:
        try:
            return self.svg()
        except BusplanError:
            return None
