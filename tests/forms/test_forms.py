"""Each form of an answer: what it keeps, what it escapes, and how it says a state."""

import json
import math
import re
from collections.abc import Callable, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, get_args

import pytest
from markdown_it import MarkdownIt

import busplan
from busplan.errors import BusplanError
from busplan.forms import Form, render
from busplan.forms.blocks import (
    Bar,
    Block,
    Calculation,
    CalculationStep,
    Chapter,
    Chart,
    Code,
    Command,
    Report,
    SectionLink,
    Sentence,
    ShownValue,
    Snippet,
    State,
    Swatch,
    Table,
    TableColumn,
    TableRow,
    Words,
    sentence,
)
from busplan.forms.charts import ChartCell, ChartGrid, Drawing, Entry, Panel, choices
from busplan.forms.lines import Mark
from busplan.forms.numbers import decimals_of, period_value
from busplan.forms.terminal import block_lines

MARGIN = ShownValue(3.96912, "margin_us", "us", 3)
FAILED = ShownValue(False, "fits", state="fails")
HOSTILE = "<b>*x*</b> | `y` [z](javascript:alert(1)) \x1b[2J"


GRID = ChartGrid(choices("x", "1"), choices("y", "1"), ((ChartCell("fits", "#"),),), (Entry("fits", "fits", "#"),))
PICTURE = Drawing("A map", (Panel(GRID),), has_characters=True)


def answer(*blocks: Block) -> Report:
    return Report(Sentence(("An answer for ", Code("p"))), blocks, {"margin_us": 3.96912}, [{"a": 1}])


def one_of_each(text: str = "text") -> Sequence[Block]:
    table = Table(
        (
            TableColumn("name", kind="words"),
            TableColumn("margin", "us", group="paper"),
            TableColumn("fits", group="paper"),
            TableColumn("", kind="drawing"),
        ),
        (
            TableRow((Code(text), MARGIN, ShownValue(True, "fits"), Bar(MARGIN, -1.0, 5.0))),
            TableRow((SectionLink(text, "s", "x.toml"), ShownValue(None), FAILED, ""), level=1),
            TableRow((Swatch("work", "E", text), MARGIN, Words("worse", "fails"), ""), highlighted=True),
            TableRow((Command("busplan capacity p"), sentence("{} of {}", MARGIN, Code(text)), "-", "")),
        ),
        sentence("A table of {}", Code(text)),
    )
    return (
        sentence(f"{text.replace('{', '')}: {{}} to spare.", MARGIN, state="passes"),
        table,
        Chart(PICTURE, Sentence((text,)), Sentence(("It is read so: ", Code(text)))),
        Snippet(("[bus]", 'speed = "S400"')),
        Calculation(
            (CalculationStep("(1)", "T", "a + b", "1 + 2", MARGIN), CalculationStep("x", "W", "", "", Words("time")))
        ),
        Chapter(Sentence((Code(text),)), (Sentence((text,)), Command("busplan capacity p")), "kind", "s"),
    )


# --- all forms ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", get_args(Form))
def test_every_form_writes_every_block_and_the_same_each_time(form: Form) -> None:
    text = render(answer(*one_of_each()), form)
    assert text == render(answer(*one_of_each()), form)
    assert text.endswith("\n")
    if form not in ("csv", "json"):
        assert text.count(">3.969<" if form == "html" else "3.969") == 5  # a bar stands beside its figure
        assert "None" not in text
        assert "worse" in text


# --- terminal ---------------------------------------------------------------------------------------------------


def test_tables_keep_every_figure_whole_and_end_without_blanks() -> None:
    table = Table(
        (TableColumn("a", kind="words"), TableColumn("value", "us", group="paper"), TableColumn("", kind="drawing")),
        (TableRow(("x", "1", "")), TableRow(("longer", "123456.789", ""), level=1)),
    )
    assert [line.text for line in block_lines([table])] == [
        "               paper",
        "               value",
        "a                 us",
        "--------------------",
        "x                  1",
        "  longer  123456.789",
    ]


def test_a_state_is_marked_where_it_stands() -> None:
    table = Table(
        (TableColumn("model", kind="words"), TableColumn("fits")),
        (TableRow(("paper", FAILED)), TableRow(("standard", "yes"))),
    )
    *_, failed, passed, (told, *_rest) = block_lines([table])
    assert failed.text == "paper       no !"
    assert [failed.text[mark.start : mark.end] for mark in failed.marks] == ["no !"]
    assert failed.marks[0] == Mark(12, 16, "fails")
    assert (passed.text, passed.marks) == ("standard   yes", ())
    assert told == "! fails."


def test_a_sentence_in_a_cell_keeps_its_units_and_its_state() -> None:
    said = sentence("{} to spare", MARGIN, state="fails")
    table = Table((TableColumn("set", kind="words"), TableColumn("x")), (TableRow((said, "1")),))
    *_, row = block_lines([table])
    assert row.text == "3.969 us to spare  1"
    assert row.marks == (Mark(0, 17, "fails"),)
    assert "| **3.969 us to spare** | 1 |" in render(answer(table), "markdown")
    assert '<span class="fails"><data value="3.96912"' in render(answer(table), "html")


def test_nothing_in_lines_commands_a_terminal() -> None:
    text = render(answer(*one_of_each(HOSTILE)), "table")
    assert "\x1b" not in text
    assert "\\x1b[2J" in text


# --- Markdown and HTML --------------------------------------------------------------------------------------------


class Tags(HTMLParser):
    """Tags with the names of their attributes, and text."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, tuple[str, ...]]] = []
        self.values: list[dict[str, str | None]] = []
        self.text = ""
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, tuple(name for name, _ in attrs)))
        if tag == "data":
            self.values.append(dict(attrs))

    def handle_data(self, data: str) -> None:
        self.text += data


def test_foreign_text_is_text_in_markdown() -> None:
    plain, hostile = (
        Tags(
            MarkdownIt("commonmark", {"html": True})
            .enable("table")
            .render(render(answer(*one_of_each(text)), "markdown"))
        )
        for text in ("text", HOSTILE)
    )
    assert [tag for tag in hostile.tags if tag[0] != "code"] == [tag for tag in plain.tags if tag[0] != "code"]
    assert "<b>*x*</b>" in hostile.text


def test_foreign_text_is_text_in_html() -> None:
    plain, hostile = (Tags(render(answer(*one_of_each(text)), "html")) for text in ("text", HOSTILE))
    assert hostile.tags == plain.tags
    assert "<b>*x*</b>" in hostile.text


def test_html_keeps_the_exact_value_and_its_state() -> None:
    found = Tags(render(answer(*one_of_each()), "html")).values
    assert {json.loads(one["value"] or "") for one in found} == {3.96912, True, False, None}
    assert [one["class"] for one in found if one["value"] == "false"] == ["fails"]


def test_html_has_its_drawings_and_their_style_once() -> None:
    html = render(answer(Chart(PICTURE, Sentence(("one",))), Chart(PICTURE, Sentence(("two",)))), "html")
    assert html.count(".chart .fits{") == 2  # on a light and on a dark background
    assert html.count("<title>A map</title>") == 2


def test_markdown_has_a_drawing_in_characters() -> None:
    text = render(answer(*one_of_each()), "markdown")
    assert "```text\n  1 | # |\n" in text
    assert text.startswith("### An answer for `p`\n")
    assert render(answer()._replace(is_page=True), "markdown") == "# An answer for `p`\n"
    assert render(answer(Sentence(("Alone.",)))._replace(is_page=True), "table") == "An answer for p\nAlone.\n"
    assert render(answer(Sentence(("Alone.",))), "markdown") == "### An answer for `p`\n\nAlone.\n"


@pytest.mark.parametrize("state", ["passes", "fails", "warns", "neutral"])
def test_a_page_and_a_comment_say_the_state_of_a_sentence_and_of_a_cell(state: State) -> None:
    table = Table((TableColumn("is"),), (TableRow((Words("so", state),)),))
    report = answer(Sentence(("It is so.",), state), table)
    html, text = render(report, "html"), render(report, "markdown")
    assert f'<p class="note {state}">It is so.</p>' in html
    assert f'<span class="{state}">so</span>' in html
    assert ("**It is so.**" in text) == (state in ("passes", "fails"))
    assert ("| **so** |" in text) == (state == "fails")


def test_the_row_that_is_sought_is_set_off_in_every_form_that_can() -> None:
    table = Table((TableColumn("us"),), (TableRow((MARGIN,), highlighted=True), TableRow((MARGIN,))))
    *_, highlighted, other = block_lines([table])
    assert [mark.tone for mark in highlighted.marks] == ["heading"]
    assert other.marks == ()
    assert render(answer(table), "markdown").count("**3.969**") == 1
    assert render(answer(table), "html").count('<tr class="highlighted">') == 1


def test_html_says_the_unit_of_the_exact_value_and_of_the_one_that_is_shown() -> None:
    html = render(answer(Sentence((ShownValue(0.0036, "mean_mm", "um", 3),))), "html")
    assert 'value="0.0036" data-unit="mm" data-shown-in="um">3.600</data> um' in html


# --- JSON and CSV -------------------------------------------------------------------------------------------------


def test_json_and_csv_are_the_record() -> None:
    assert json.loads(render(answer(), "json")) == {"margin_us": 3.96912}
    assert render(answer(), "csv") == "a\n1\n"
    assert render(answer()._replace(records=[]), "csv") == ""


def test_what_is_no_one_table_has_no_csv() -> None:
    with pytest.raises(
        BusplanError, match="--format csv: this answer has several tables and CSV holds one; use --format json"
    ):
        render(answer()._replace(records=None), "csv")


def test_json_refuses_what_is_not_finite() -> None:
    with pytest.raises(ValueError, match="Out of range"):
        render(answer()._replace(document={"value_us": math.nan}), "json")


# --- numbers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value_us", "written"), [(999.99999, "999.99999 us"), (411.8349, "411.8349 us"), (1e9, "1000 s")]
)
def test_periods_keep_their_digits(value_us: float, written: str) -> None:
    report = answer(Sentence((period_value(value_us),)))
    assert render(report, "table") == f"{written}\n"


def test_a_text_that_no_spreadsheet_takes_says_so_in_its_cell() -> None:
    def cell(text: str) -> str:
        return render(answer()._replace(records=[{"a": text}]), "csv").splitlines()[1]

    assert cell("x" * 32_767) == "x" * 32_767
    assert cell("x" * 131_073) == '"(131,073 characters, too long for a cell: --format json has them)"'
    assert cell("=1+1") == "'=1+1"


def test_a_figure_below_zero_has_the_decimals_of_one_above(run: Callable[..., Any]) -> None:
    shown = run("capacity", "paper-4ms", "--period", "500us", "--all").stdout
    assert re.search(r"^corrected margin +JCGM 100 +us +-19\.936 ! +-$", shown, re.MULTILINE)
    assert re.search(r"^margin +\(1\) \(2\) +us +-13\.320 ! +42\.883$", shown, re.MULTILINE)
    # What has no digit among them is written with three of its own, of either sign.
    assert [decimals_of(number, 3) for number in (-0.00012, 0.00012, -0.001, -123.4)] == [
        "-0.00012", "0.00012", "-0.001", "-123.400",
    ]  # fmt: skip


def test_a_file_that_python_saves_speaks_of_no_option(run: Callable[..., Any], tmp_path: Path) -> None:
    answer = busplan.compare("paper-1ms", buses=["can"])
    for ending in ("md", "txt", "html"):
        answer.save(tmp_path / f"x.{ending}")
        text = (tmp_path / f"x.{ending}").read_text(encoding="utf-8")
        assert ("Not shown" in text, "--all" in text) == (True, False)
    assert "to_dict() has all figures." in str(answer)
    assert "--all shows all." in run("compare", "paper-1ms", "--buses", "can", "--format", "markdown").stdout
