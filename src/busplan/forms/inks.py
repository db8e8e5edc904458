"""Colours of drawings and their legends, on a light and on a dark background."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.buses.figure import Ink

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
        "gap": InkColours("#b4bcc6", "#6b7685"),
        "long-gap": InkColours("#8792a0", "#4d5765"),
        "reserve": InkColours("#9a5b2e", "#d39a6a"),
        "idle": InkColours("#e6eaef", "#252d38"),
        "in": InkColours("#4668a8", "#7c9fe0"),
        "out": InkColours("#2a9d8f", "#5cc9bb"),
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
