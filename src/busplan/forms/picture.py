"""The picture of an answer as an SVG of its own."""

import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Final

from busplan.forms.blocks import Block, Chapter, Chart
from busplan.forms.inks import DARK, fills

_PAPER: Final = ".chart{background:var(--paper)}\n.chart .paper{fill:var(--paper)}\n"
_SHEET_OF_PAPER: Final = '<rect class="paper" width="100%" height="100%"/>'
"""For viewers that have no background of an SVG."""
_ROOT: Final = re.compile(r":root\s*\{([^}]*)\}")
_DARK_ROOT: Final = re.compile(r"\A.*?\}\s*\}\n", re.DOTALL)
"""The variables at the top of the style sheet: for light backgrounds, and for dark ones."""
_VARIABLE: Final = re.compile(r"(--[\w-]+):\s*([^;]+);")
_THEMED: Final = re.compile(r"[^{}]*\{[^{}]*var\([^{}]*\}")
"""A rule with a variable."""


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

    Each colour stands in it twice, for light and for dark backgrounds: not every viewer of SVG knows variables.

    Parameters
    ----------
    svg
        The drawing.
    css
        Rules of its own.
    """
    chart = (files("busplan.forms") / "templates" / "chart.css").read_text(encoding="utf-8")
    light, dark = (dict(_VARIABLE.findall(block)) for block in _ROOT.findall(chart))
    rules = f"{_DARK_ROOT.sub('', chart)}{_PAPER}{css}"
    on_light, on_dark = fills(".chart")
    sheet = f"{_filled(rules, light)}{on_light}{DARK}{{{_filled(''.join(_THEMED.findall(rules)), dark)}{on_dark}}}"
    head, body = svg.split(">", 1)
    paper = "" if "viewBox" in head else _SHEET_OF_PAPER
    return f"{head}>\n<style>{sheet}</style>{paper}{body}"


def _filled(rules: str, colours: Mapping[str, str]) -> str:
    return re.sub(r"var\((--[\w-]+)\)", lambda match: colours[match[1]], rules)
