"""The comparison of several kinds of bus inside an answer."""

from busplan.analysis.comparison.kinds import KindComparison
from busplan.drawings.compare.characters import compare_lines
from busplan.drawings.compare.svg import compare_svg, stylesheet
from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line


class KindsDrawing(Drawing):
    """The most axes over the period, a line for each kind of bus.

    Parameters
    ----------
    found
        The comparison.
    title
        Title: its message in a sentence.
    """

    stylesheet = stylesheet()
    is_text_in_markdown = True

    def __init__(self, found: KindComparison, *, title: str) -> None:
        self._found, self._title = found, title

    def svg(self) -> str:
        """Draw it without the style sheet and title, which the page has."""
        return compare_svg(self._found, title=self._title, inline=True)

    def characters(self, width: int) -> list[Line]:
        """Draw a letter for each point, and the legend."""
        return compare_lines(self._found, width=width)
