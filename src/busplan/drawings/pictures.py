"""Answers as files of pictures: what draws each form."""

from typing import TYPE_CHECKING, assert_never

if TYPE_CHECKING:
    from busplan.analysis.comparison.kinds import KindComparison
    from busplan.analysis.map.trade_off import TradeOff
    from busplan.analysis.timeline.schedule import Schedule
    from busplan.forms import Picture, TimelinePicture


def map_picture(found: "TradeOff", form: "Picture", *, title: str) -> str | bytes:
    """Draw a map as a file of its own.

    Parameters
    ----------
    found
        The map.
    form
        The form.
    title
        Title: its message in a sentence.
    """
    match form:
        case "svg":
            from busplan.drawings.map.svg import map_svg

            return map_svg(found, title=title)
        case "png":
            from busplan.drawings.map.png import map_png

            return map_png(found, title=title)
        case _:
            assert_never(form)


def compare_picture(found: "KindComparison", form: "Picture", *, title: str) -> str | bytes:
    """Draw a comparison of buses, of which at least one has the machine; otherwise as `map_picture`."""
    match form:
        case "svg":
            from busplan.drawings.compare.svg import compare_svg

            return compare_svg(found, title=title)
        case "png":
            from busplan.drawings.compare.png import compare_png

            return compare_png(found, title=title)
        case _:
            assert_never(form)


def timeline_picture(found: "Schedule", form: "TimelinePicture", *, title: str) -> str | bytes:
    """Draw a timeline; otherwise as `map_picture`."""
    match form:
        case "mermaid":
            from busplan.drawings.timeline.mermaid import timeline_mermaid

            return timeline_mermaid(found, title=title)
        case "svg":
            from busplan.drawings.timeline.svg import timeline_svg

            return timeline_svg(found, title=title)
        case "png":
            from busplan.drawings.timeline.png import timeline_png

            return timeline_png(found, title=title)
        case _:
            assert_never(form)
