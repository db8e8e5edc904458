"""Style sheet of a timeline's SVG."""

from typing import Final

from busplan.drawings.svg_style import style_sheet

_STYLE: Final = """\
{0} .over{{fill:#b3261e;fill-opacity:.16}}
{0} .track{{fill:#f4f6f8}}
{0} .edge{{stroke:#b3261e;stroke-width:2}}
{0} .late{{fill:#b3261e}}
{0} .end{{stroke:#1c2430;stroke-width:1.5;stroke-dasharray:3 2}}
{0} .window{{fill:none;stroke:#1c2430;stroke-width:2}}
"""
_DARK_STYLE: Final = """\
{0} .over{{fill:#ff8a80;fill-opacity:.22}}
{0} .track{{fill:#1a2029}}
{0} .edge{{stroke:#ff8a80}}
{0} .late{{fill:#ff8a80}}
{0} .end{{stroke:#e6ebf1}}
{0} .window{{stroke:#e6ebf1}}
"""


def stylesheet() -> str:
    """CSS for light and dark backgrounds, scoped to the class of the drawing."""
    return style_sheet(".busplan-timeline", light=_STYLE, dark=_DARK_STYLE)
