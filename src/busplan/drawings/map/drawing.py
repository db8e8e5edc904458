"""The map of a profile inside an answer."""

from busplan.analysis.map.trade_off import TradeOff
from busplan.drawings.map.characters import map_lines
from busplan.drawings.map.svg import map_svg, stylesheet
from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line


class MapDrawing(Drawing):
    """The verdict over two keys.

    Parameters
    ----------
    found
        The map.
    title
        Title: its message in a sentence.
    """

    stylesheet = stylesheet()
    is_text_in_markdown = True

    def __init__(self, found: TradeOff, *, title: str) -> None:
        self._found, self._title = found, title

    def svg(self) -> str:
        """Draw it without the style sheet, title and legend, which the page has."""
        return map_svg(self._found, title=self._title, inline=True)

    def characters(self, width: int) -> list[Line]:
        """Draw a row of characters for each value of `y`, and the legend."""
        return map_lines(self._found, width=width)
