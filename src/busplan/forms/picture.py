"""The picture of an answer as an SVG of its own, and the colours of all drawings."""

import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.buses.figure import Ink
from busplan.forms.blocks import Block, Chapter, Chart

DARK: Final = "@media screen and (prefers-color-scheme:dark)"
"""Media query for the colours on a dark background; printed pages are light."""


class InkColours(NamedTuple):
    """Colours of one ink."""

    light: str
    """On a light background."""
    dark: str
    """On a dark background."""


INKS: Final[Mapping[Ink, InkColours]] = MappingProxyType(
    {
        "sync": InkColours("#7c3aed", "#a78bfa"),
        "contention": InkColours("#e08a00", "#f5b041"),
        "request": InkColours("#1d6fd8", "#5aa9ff"),
        "acknowledge": InkColours("#c8327c", "#ff7fb5"),
        "work": InkColours("#5aa845", "#6fbf5a"),
        "response": InkColours("#0a8f94", "#38c6c4"),
        "gap": InkColours("#b4bcc6", "#778292"),
        "long-gap": InkColours("#8792a0", "#4d5765"),
        "reserve": InkColours("#9a5b2e", "#d39a6a"),
        "idle": InkColours("#e6eaef", "#252d38"),
        # Data from nodes are teal as responses are, data to nodes blue as requests are.
        "in": InkColours("#2a9d8f", "#5cc9bb"),
        "out": InkColours("#4668a8", "#7c9fe0"),
        "fits": InkColours("#6cc07a", "#5cab67"),
        "unsure": InkColours("#f2c14e", "#dba82f"),
        "short": InkColours("#d5dae0", "#8792a0"),
        "barred": InkColours("#aab4c0", "#667282"),
        "unsafe": InkColours("#ec7fb4", "#e377ad"),
        "uneven": InkColours("#74aef7", "#6ea8f5"),
        "unjudged": InkColours("#bfe3c4", "#a5d0ab"),
        "refused": InkColours("#b59ae0", "#a78fd4"),
    }
)
"""Colours by ink; the name of an ink is its CSS class."""


def fills(scope: str) -> tuple[str, str]:
    """CSS rules that fill each ink inside a selector: for a light background and for a dark one."""
    light, dark = (
        "".join(f"{scope} .{ink}{{fill:{colours[side]}}}\n" for ink, colours in INKS.items()) for side in (0, 1)
    )
    return light, dark


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
