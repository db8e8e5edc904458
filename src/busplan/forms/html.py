"""A page as one HTML file: no network, no script, light and dark, phone and paper."""

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from busplan.answers.page import content
from busplan.drawings.timeline.svg_style import DARK, fills, stylesheet


def page_html(page: content.Page) -> str:
    """Write a page; whatever a profile is called, it is text.

    Parameters
    ----------
    page
        Its content.

    Returns
    -------
    str
        The whole document; the same for the same content.
    """
    environment = Environment(
        loader=PackageLoader("busplan.forms"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.tests["figure"] = lambda cell: isinstance(cell, content.ShownFigure)
    environment.tests["drawing"] = lambda cell: isinstance(cell, content.Drawing)
    environment.tests["swatch"] = lambda cell: isinstance(cell, content.Swatch)
    environment.tests["link"] = lambda cell: isinstance(cell, content.ChapterLink)
    environment.tests["code"] = lambda cell: isinstance(cell, content.Code)
    environment.tests["source"] = lambda cell: isinstance(cell, content.SourceCommand)
    # An SVG of ours is markup: its writer has escaped what it says.
    environment.filters["svg"] = Markup
    light, dark = fills(".chart")
    colours = Markup(f"{stylesheet()}{light}{DARK}{{\n{dark}}}\n")  # noqa: S704 - constants of ours
    return environment.get_template("page.html.j2").render(page=page, colours=colours)
