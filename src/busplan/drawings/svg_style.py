"""Style sheet of an SVG that is also a file of its own, with literal colours for viewers without CSS variables."""

from typing import Final

from busplan.forms.inks import DARK, fills

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
