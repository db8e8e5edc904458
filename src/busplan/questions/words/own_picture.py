"""A picture with rules of its own, in a page, as an SVG of its own, and in characters."""

from collections.abc import Callable

from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line


class OwnPicture(Drawing):
    """A picture that stands in a page and in characters.

    Parameters
    ----------
    svg
        Function that draws it without what the page has: style sheet, title and legend.
    lines
        Function that draws it in characters, `width` columns wide.
    stylesheet
        Its own rules, behind those of all charts.
    """

    is_text_in_markdown = True

    def __init__(self, svg: Callable[[], str], lines: Callable[..., list[Line]], *, stylesheet: str) -> None:
        self._svg, self._lines, self.stylesheet = svg, lines, stylesheet

    def svg(self) -> str:
        """Draw it for a page."""
        return self._svg()

    def characters(self, width: int) -> list[Line]:
        """Draw it in characters."""
        return self._lines(width=width)
