"""Style sheet of a timeline's SVG, with literal colours for viewers without CSS variables."""

from typing import Final

from busplan.forms.inks import DARK, fills

_STYLE: Final = """
.busplan-timeline{font:13px system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
.busplan-timeline text{fill:#1c2430}
.busplan-timeline .paper{fill:#ffffff}
.busplan-timeline .head{font-weight:600}
.busplan-timeline .small{font-size:12px;fill:#526071}
.busplan-timeline .bad{fill:#b3261e}
.busplan-timeline .over{fill:#b3261e;fill-opacity:.16}
.busplan-timeline .track{fill:#f4f6f8}
.busplan-timeline .rule{stroke:#c9d0d8;stroke-width:1}
.busplan-timeline .edge{stroke:#b3261e;stroke-width:2}
.busplan-timeline .window{fill:none;stroke:#1c2430;stroke-width:2}
"""
_DARK_STYLE: Final = """
.busplan-timeline text{fill:#e6ebf1}
.busplan-timeline .paper{fill:#12161c}
.busplan-timeline .small{fill:#a3b0bf}
.busplan-timeline .bad{fill:#ff8a80}
.busplan-timeline .over{fill:#ff8a80;fill-opacity:.22}
.busplan-timeline .track{fill:#1a2029}
.busplan-timeline .rule{stroke:#3a4452}
.busplan-timeline .edge{stroke:#ff8a80}
.busplan-timeline .window{stroke:#e6ebf1}
"""


def stylesheet() -> str:
    """CSS for light and dark backgrounds, scoped to the class of the drawing."""
    light, dark = fills(".busplan-timeline")
    return f"{_STYLE}{light}{DARK}{{{_DARK_STYLE}{dark}}}\n"
