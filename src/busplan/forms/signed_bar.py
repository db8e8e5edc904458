"""A bar to the left or to the right of zero, for a cell of a table."""

from xml.etree.ElementTree import SubElement

from busplan.forms.svg import drawing, markup

_HEIGHT = 16


def signed_bar(value: float, *, least: float, most: float, title: str) -> str:
    """Draw one value on a scale that it shares with the rows above and below.

    Parameters
    ----------
    value
        What the bar shows.
    least, most
        Ends of the scale; zero lies between them or is one of them.
    title
        What it shows, for who cannot see it.
    """
    root = drawing(title, css="chart bars")
    root.set("height", str(_HEIGHT))
    zero, end = (100 * (one - least) / (most - least) for one in (0.0, value))
    box = {"x": f"{min(zero, end):.5g}%", "width": f"{abs(end - zero):.5g}%", "y": "2", "height": str(_HEIGHT - 4)}
    SubElement(root, "rect", {**box, "class": "takes" if value >= 0 else "hides"})
    x = f"{zero:.5g}%"
    SubElement(root, "line", {"x1": x, "x2": x, "y1": "0", "y2": str(_HEIGHT), "class": "zero"})
    return markup(root)
