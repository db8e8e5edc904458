"""The colours of a drawing and of its legend, on white and on black."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.buses.figure import Ink

DARK: Final = "@media screen and (prefers-color-scheme:dark)"
"""Where colours on black hold: paper is white."""


class InkColours(NamedTuple):
    """The colours of one ink."""

    light: str
    """On white."""
    dark: str
    """On black."""


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
    }
)
"""Every ink; its name is a class of style sheets."""


def fills(scope: str) -> tuple[str, str]:
    """Rules that colour each ink inside a selector, on white and on black."""
    light, dark = (
        "".join(f"{scope} .{ink}{{fill:{colours[side]}}}\n" for ink, colours in INKS.items()) for side in (0, 1)
    )
    return light, dark
