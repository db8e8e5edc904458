"""Colours of drawings by ink, on light and on dark backgrounds, and the style sheet of a drawing in a file."""

import re
from collections.abc import Mapping
from importlib.resources import files
from types import MappingProxyType
from typing import Final, NamedTuple

DARK: Final = "@media screen and (prefers-color-scheme:dark)"
"""Media query for the colours on a dark background; printed pages are light."""


class InkColours(NamedTuple):
    """Colours of one ink."""

    light: str
    """Colour on a light background."""
    dark: str
    """Colour on a dark background."""


INKS: Final[Mapping[str, InkColours]] = MappingProxyType(
    {
        "first": InkColours("#1d4f91", "#8cb8f5"),
        "second": InkColours("#a34a00", "#f5b041"),
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
    """CSS rules that colour each ink inside a selector, for a light and for a dark background."""
    light, dark = (
        "".join(f"{scope} .{ink}{{color:{colours[side]};fill:{colours[side]}}}\n" for ink, colours in INKS.items())
        for side in (0, 1)
    )
    return light, dark


_PAPER: Final = ".chart{background:var(--paper)}\n.chart .paper{fill:var(--paper)}\n"
_SHEET_OF_PAPER: Final = '<rect class="paper" width="100%" height="100%"/>'
"""Background for viewers that have none for an SVG."""
_ROOT: Final = re.compile(r":root\s*\{([^}]*)\}")
_DARK_ROOT: Final = re.compile(r"\A.*?\}\s*\}\n", re.DOTALL)
"""Variables at the top of the style sheet, for light and for dark backgrounds."""
_VARIABLE: Final = re.compile(r"(--[\w-]+):\s*([^;]+);")
_THEMED: Final = re.compile(r"[^{}]*\{[^{}]*var\([^{}]*\}")
"""A rule with a variable."""


def styled(svg: str) -> str:
    """A drawing with the style sheet of the page's charts.

    Each colour is in it twice, for light and for dark backgrounds, because some viewers of SVG do not know variables.
    """
    chart = (files("busplan.forms") / "templates" / "chart.css").read_text(encoding="utf-8")
    light, dark = (dict(_VARIABLE.findall(block)) for block in _ROOT.findall(chart))
    rules = f"{_DARK_ROOT.sub('', chart)}{_PAPER}"
    on_light, on_dark = fills(".chart")
    sheet = f"{_filled(rules, light)}{on_light}{DARK}{{{_filled(''.join(_THEMED.findall(rules)), dark)}{on_dark}}}"
    head, body = svg.split(">", 1)
    return f"{head}>\n<style>{sheet}</style>{_SHEET_OF_PAPER}{body}"


def _filled(rules: str, colours: Mapping[str, str]) -> str:
    return re.sub(r"var\((--[\w-]+)\)", lambda match: colours[match[1]], rules)
