"""The picture of an answer as an SVG of its own."""

from collections.abc import Sequence
from importlib.resources import files

from busplan.forms.blocks import Block, Chapter, Chart
from busplan.forms.inks import DARK, fills

_PAPER = ".chart{background:var(--paper)}\n"


def first_picture(blocks: Sequence[Block]) -> str | None:
    """Write the first chart of an answer as SVG with its style sheet, for light and dark backgrounds.

    Parameters
    ----------
    blocks
        Blocks of the answer.

    Returns
    -------
    str or None
        None if no chart can be drawn.
    """
    for block in blocks:
        found = None
        if isinstance(block, Chapter):
            found = first_picture(block.blocks)
        elif isinstance(block, Chart) and (svg := block.drawing.svg()) is not None:
            found = styled(svg, css=block.drawing.stylesheet)
        if found is not None:
            return found
    return None


def styled(svg: str, *, css: str = "") -> str:
    """Add the style sheet of the page's charts to a drawing of the class `chart`.

    Parameters
    ----------
    svg
        The drawing.
    css
        Rules of its own.
    """
    chart = (files("busplan.forms") / "templates" / "chart.css").read_text(encoding="utf-8")
    light, dark = fills(".chart")
    head, body = svg.split(">", 1)
    return f"{head}>\n<style>{chart}{_PAPER}{css}{light}{DARK}{{{dark}}}</style>{body}"
