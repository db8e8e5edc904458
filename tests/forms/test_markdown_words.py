"""Markdown: whatever a profile is called, a page shows those characters and does nothing else with them."""

from html.parser import HTMLParser

from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from busplan.forms import render
from busplan.forms.blocks import Code, Report, Sentence, Table, TableColumn, TableRow

HOSTILE = (
    "<script>alert(1)</script>", "a|b", "`x`", "```", "`", "\\", "a\\|b", "[x](http://y)", "*a* _b_", "@team #1",
    "# head", "## head", "###### h", "$x$", "&lt;", "![i](j)", "\\`", "a\\",
)  # fmt: skip


class Words(HTMLParser):
    """Tags and text of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.cells: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        del attrs
        self.tags.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_data(self, data: str) -> None:
        if self.cells and self.tags[-1] in ("td", "th", "code"):
            self.cells[-1] += data


def rendered(text: str) -> Words:
    """A table with a text in each cell, as a page shows it."""
    columns = tuple(TableColumn(name, kind="words") for name in ("code", "words"))
    table = Table(columns, (TableRow((Code(text), text)),))
    markdown = render(Report(Sentence(("Title",)), (table,), {}), "markdown")
    words = Words()
    words.feed(MarkdownIt("commonmark", {"html": True}).enable("table").render(markdown).replace("</td>\n", "</td>"))
    return words


def test_a_cell_shows_hostile_text_and_nothing_else() -> None:
    for text in HOSTILE:
        page = rendered(text)
        assert set(page.tags) <= {"h3", "table", "thead", "tbody", "tr", "th", "td", "code"}
        assert [cell.strip() for cell in page.cells] == ["code", "words", text, text]


@given(st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=30))
def test_a_cell_shows_any_text(text: str) -> None:
    line = " ".join(text.split())
    assert [cell.strip() for cell in rendered(text).cells] == ["code", "words", line, line]
