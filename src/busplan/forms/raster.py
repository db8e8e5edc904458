"""An SVG as PNG, in its light colours and in the font that travels with the package. A PNG needs the extra `plot`."""

import re
from importlib.resources import as_file, files
from typing import Final

WIDTH: Final = 640
"""Width that a PNG gives to a drawing as wide as its container, in px."""
_ZOOM: Final = 2.0
"""Pixels of the PNG for a px of the SVG."""
_MOST_HEIGHT: Final = 16_000
"""Largest height in pixels: a drawing that would be higher is enlarged by less than `_ZOOM`."""
_FONT: Final = '* {font-family:"DejaVu Sans Subset" !important}'


def png(svg: str) -> bytes:
    """Convert a drawing of `busplan.forms.svg`; the same drawing gives the same bytes.

    Characters that the font lacks are of a font of this computer, and a box where none has them.

    Parameters
    ----------
    svg
        A drawing as wide as its container, with its style sheet.
    """
    import resvg_py

    height = re.search(r'\bheight="(\d+)"', svg)
    zoom = min(_ZOOM, _MOST_HEIGHT / int(height[1])) if height else _ZOOM
    with as_file(files("busplan.forms") / "fonts") as fonts:
        return resvg_py.svg_to_bytes(
            svg_string=svg.replace('width="100%"', f'width="{WIDTH}"', 1),
            background="#ffffff",
            zoom=zoom,
            font_files=[str(fonts / "regular.ttf"), str(fonts / "bold.ttf")],
            style_sheet=_FONT,
        )
