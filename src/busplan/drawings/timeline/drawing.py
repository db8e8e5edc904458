"""The timeline of a cycle inside an answer."""

from busplan.analysis.timeline.schedule import Schedule
from busplan.drawings.timeline.characters import timeline_lines
from busplan.drawings.timeline.svg import timeline_svg
from busplan.drawings.timeline.svg_style import stylesheet
from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line


class TimelineDrawing(Drawing):
    """A cycle to scale.

    Parameters
    ----------
    plan
        The schedule, narrowed to its window.
    title
        Title: its message in a sentence.
    """

    stylesheet = stylesheet()
    is_text_in_markdown = True

    def __init__(self, plan: Schedule, *, title: str) -> None:
        self._plan, self._title = plan, title

    def svg(self) -> str:
        """Draw it without the style sheet and text, which the page has."""
        return timeline_svg(self._plan, title=self._title, inline=True)

    def characters(self, width: int) -> list[Line]:
        """Draw the whole period as a strip, and the window in lanes."""
        return timeline_lines(self._plan, width=width)
