"""Pictures that stand in a page, as an SVG of their own, and in characters.

Their style sheets have literal colours, for viewers without CSS variables.
"""

from collections.abc import Callable
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.blocks import Drawing
from busplan.forms.inks import DARK, fills
from busplan.forms.lines import Line
from busplan.forms.svg import drawing

_FONT: Final = """
{0}{{font:13px system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}}
{0} text{{fill:#1c2430}}
{0} .paper{{fill:#ffffff}}
{0} .head{{font-weight:600}}
{0} .small{{font-size:12px;fill:#526071}}
{0} .bad{{fill:#b3261e}}
{0} .rule{{stroke:#c9d0d8;stroke-width:1}}
"""
_DARK_FONT: Final = """
{0} text{{fill:#e6ebf1}}
{0} .paper{{fill:#12161c}}
{0} .small{{fill:#a3b0bf}}
{0} .bad{{fill:#ff8a80}}
{0} .rule{{stroke:#3a4452}}
"""


def style_sheet(scope: str, *, light: str, dark: str) -> str:
    """CSS for light and dark backgrounds: text, inks, and a drawing's own rules.

    Parameters
    ----------
    scope
        Selector of the drawing.
    light
        Its own rules, in which {0} stands for the scope; braces are doubled.
    dark
        What of them is different on a dark background.
    """
    inks, dark_inks = fills(scope)
    light, dark = (f"{font}{own}".format(scope) for font, own in ((_FONT, light), (_DARK_FONT, dark)))
    return f"{light}{inks}{DARK}{{{dark}{dark_inks}}}\n"


class OwnPicture(Drawing):
    """A picture with a style sheet of its own.

    Parameters
    ----------
    svg
        Function that draws it without what the page has: style sheet, title and legend.
    lines
        Function that draws it in characters, `width` columns wide.
    stylesheet
        Its style sheet.
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


def begin(title: str, *, scope: str, description: str, stylesheet: str | None) -> Element:
    """Begin a picture; the caller sets its height.

    Parameters
    ----------
    title
        Title for screen readers.
    scope
        CSS class that scopes its styles.
    description
        What it shows, for screen readers.
    stylesheet
        Style sheet of a file of its own, which has a background, too; None in a page.
    """
    root = drawing(title, css=scope)
    SubElement(root, "desc").text = description
    if stylesheet is not None:
        SubElement(root, "style").text = stylesheet
        SubElement(root, "rect", {"class": "paper", "width": "100%", "height": "100%"})
    return root
