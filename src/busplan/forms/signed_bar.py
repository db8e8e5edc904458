"""A bar left or right of zero, for a table cell."""

from xml.etree.ElementTree import SubElement

from busplan.forms.svg import drawing, markup

_HEIGHT = 16


def signed_bar(value: float, *, least: float, most: float, title: str) -> str:
    """Draw one value as a bar on a scale.

    Parameters
    ----------
    value
        Value of the bar.
    least, most
        Ends of the scale, least <= 0 <= most.
    title
        Title for screen readers.
    """
    root = drawing(title, css="chart bars")
    root.set("height", str(_HEIGHT))
    zero, end = (100 * (one - least) / (most - least) for one in (0.0, value))
    box = {"x": f"{min(zero, end):.5g}%", "width": f"{abs(end - zero):.5g}%", "y": "2", "height": str(_HEIGHT - 4)}
    SubElement(root, "rect", {**box, "class": "takes" if value >= 0 else "hides"})
    x = f"{zero:.5g}%"
    SubElement(root, "line", {"x1": x, "x2": x, "y1": "0", "y2": str(_HEIGHT), "class": "zero"})
    return markup(root)
