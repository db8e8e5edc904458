"""The page of `busplan report`: its charts are the results, its colours can be read, its names are text."""

import os
import re
import subprocess
from collections.abc import Callable
from functools import cache
from html.parser import HTMLParser
from importlib.resources import files
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from busplan.questions.report.all_answers import AllAnswers, all_answers
from busplan.questions.report.commands import sources
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from busplan.buses import kind_named, kind_names
from busplan.buses.ieee1394.section import Ieee1394Profile
from busplan.forms import render
from busplan.forms.blocks import Chapter, Report, ShownValue, Table
from busplan.forms.numbers import cell_text, sentence_text
from busplan.forms.picture import INKS
from busplan.forms.svg import signed_bar
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.base.shell import shell_word
from busplan.questions.report.page import ReportedProfile, page_report
from busplan.sections.profile import Profile

PLACES = {"paper": "first", "standard": "second"}
"""Where each timing model stands, which its colour goes by."""
SVG = "{http://www.w3.org/2000/svg}"
BASE = load("paper-4ms").profile
TERMS = kind_named("ieee1394").figures.terms
NAMES = (
    "</title><script>alert(1)</script> \"><img src=x onerror=alert(1)> ' autofocus onfocus='alert(1)",
    "]]>--><!-- ${x} {{7*7}} {% raw %} #{x} </style></svg><b>&amp;&#60;",
    "```\u05d0\u05d1\u05d2 | `x` *a* [x](javascript:alert(1)) <!--".ljust(100, "W"),
)


def changed(**changes: object) -> Profile:
    return override(BASE, {key.replace("__", "."): value for key, value in changes.items()})


def made(*profiles: Profile, title: str | None = None) -> Report:
    subjects = [ReportedProfile(f"{number}.toml", without_circle(one)) for number, one in enumerate(profiles)]
    return page_report(subjects, title=title)


@cache
def without_circle(profile: Profile) -> AllAnswers:
    return all_answers(profile, with_circle=False)


@cache
def simulated() -> AllAnswers:
    return all_answers(changed(circle__radius_mm=25.0, circle__ramp_periods=20))


class Tags(HTMLParser):
    """Every tag with its attributes' names, comments, and all text outside style."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, tuple[str, ...]]] = []
        self.text = ""
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, tuple(name for name, _ in attrs)))

    def handle_comment(self, data: str) -> None:
        self.tags.append((f"comment {data}", ()))

    def handle_data(self, data: str) -> None:
        self.text += data


# --- names ------------------------------------------------------------------------------------------------


@cache
def named(names: tuple[str, ...]) -> Report:
    return made(*(changed(name=one, description=f"{one} is why") for one in names), title=" ".join(names))


def test_hostile_names_make_no_element_and_no_attribute() -> None:
    plain, hostile = (Tags(render(named(names), "html")) for names in (("plain",) * len(NAMES), NAMES))
    assert hostile.tags == plain.tags
    assert not {tag for tag, _ in hostile.tags} & {"script", "img", "iframe", "object", "link", "base", "form"}
    assert not [one for _, attributes in hostile.tags for one in attributes if one.startswith("on")]
    for text in (*NAMES, *(f"{name} is why" for name in NAMES), " ".join(NAMES)):
        assert text in hostile.text


def test_hostile_names_are_text_in_markdown() -> None:
    markdown = render(named(NAMES), "markdown")
    reader = Tags(MarkdownIt("commonmark", {"html": True}).enable("table").render(markdown))
    assert {tag for tag, _ in reader.tags} <= {
        *("h1", "h2", "h3", "p", "a", "code", "pre", "strong", "ul", "li"),
        *("table", "thead", "tbody", "tr", "th", "td"),
    }
    assert {attributes for _, attributes in reader.tags} <= {(), ("id",), ("href",), ("class",), ("style",)}
    for text in (*NAMES, *(f"{name} is why" for name in NAMES)):
        assert " ".join(text.split()) in " ".join(reader.text.split())


@given(st.binary(min_size=1, max_size=20).filter(lambda raw: b"\0" not in raw))
def test_a_shell_gives_back_any_path(raw: bytes) -> None:
    word = shell_word(os.fsdecode(raw))
    assert word.isprintable()
    shown = subprocess.run(["bash", "-c", f"printf %s {word}"], capture_output=True, check=True)
    assert shown.stdout == (b"./" + raw if raw.startswith(b"-") and raw != b"-" else raw)


# --- the page ---------------------------------------------------------------------------------------------


def test_a_page_is_whole_in_itself_and_the_same_each_time() -> None:
    one = ReportedProfile("paper-4ms", simulated())
    html = render(page_report([one, one], title=None), "html")
    assert html == render(page_report([one, one], title=None), "html")
    assert re.findall(r"https?://(?!www\.w3\.org/2000/svg)", html) == []
    assert not re.search(r"url\(|@import|<script|<link|\ssrc=", html)
    assert "None" not in html
    ids = re.findall(r'\bid="([^"]*)"', html)
    assert len(ids) == len(set(ids))
    assert {"p1", "p2", "comparison"} <= set(ids)
    assert set(re.findall(r'href="#([^"]*)"', html)) == {"p1", "p2"}


def test_headings_go_down_one_by_one_and_tables_have_scopes() -> None:
    for one in (made(BASE), made(BASE, BASE)):
        tags = Tags(render(one, "html")).tags
        levels = [int(tag[1]) for tag, _ in tags if re.fullmatch("h[1-6]", tag)]
        assert levels.count(1) == 1
        assert all(lower <= upper + 1 for upper, lower in pairwise(levels))
        assert all("scope" in attributes for tag, attributes in tags if tag == "th")
        assert all({"role", "class"} <= set(names) or "aria-hidden" in names or "x" in names or "y" in names
                   for tag, names in tags if tag == "svg")  # fmt: skip


@cache
def whole() -> tuple[ReportedProfile, Report]:
    subject = ReportedProfile("paper-4ms", simulated())
    return subject, page_report([subject])


def parts(report: Report) -> dict[str, Chapter]:
    return {block.kind: block for block in report.blocks() if isinstance(block, Chapter)}


@cache
def documents() -> dict[str, Any]:
    subject, _ = whole()
    found = sources(subject.answer, argument=subject.argument, changes=subject.changes)
    return {name: source.document() for name, source in found.items()}


def test_only_the_parts_in_their_order() -> None:
    assert list(parts(whole()[1])) == [
        *("verdict", "models", "timeline", "terms", "sensitivity", "axes", "map", "circle"),
        *("sources", "assumptions", "commands"),
    ]


def test_every_figure_is_one_of_the_documents(values_of_the_document: Callable[[Report], int]) -> None:
    assert values_of_the_document(whole()[1]) > 200


def test_a_column_holds_the_figures_of_its_timing_model_and_transaction() -> None:
    _, report = whole()
    found, seen = documents(), 0
    owners = [*found["capacity"]["results"], *found["latency"]["transactions"], *found["axes"]["results"]]
    for table in (block for part in parts(report).values() for block in part.blocks if isinstance(block, Table)):
        for row in table.rows:
            for column, cell in zip(table.columns, row.cells, strict=True):
                model = next((one for one in (column.heading, column.group) if one in ("paper", "standard")), None)
                if isinstance(cell, ShownValue) and model is not None:
                    assert any(
                        owner[cell.key] == cell.value
                        for owner in owners
                        if cell.key in owner
                        and owner["timing_model"] == model
                        and owner.get("transaction", "") in column.group
                    ), cell
                    seen += 1
    assert seen > 100


def test_a_row_of_periods_holds_the_figures_of_its_period() -> None:
    _, report = whole()
    results = documents()["axes"]["results"]
    (table,) = (block for block in parts(report)["axes"].blocks if isinstance(block, Table))
    for row in table.rows:
        period, *figures = (cell for cell in row.cells if isinstance(cell, ShownValue))
        own = [one for one in results if one["period_us"] == period.value]
        assert own
        assert all(any(one[cell.key] == cell.value for one in own) for cell in figures)
    assert [cell_text(row.cells[0]) for row in table.rows if row.highlighted] == ["4000"]


def test_all_forms_say_the_same() -> None:
    _, report = whole()
    markdown = render(report, "markdown")
    lines = render(report, "table")
    rendered = Tags(MarkdownIt("commonmark").enable("table").render(markdown)).text
    for part in parts(report).values():
        assert sentence_text(part.title) in rendered
        assert sentence_text(part.title) in lines
        for table in (block for block in part.blocks if isinstance(block, Table)):
            for row in table.rows:
                for cell in row.cells:
                    text = getattr(cell, "text", cell_text(cell))
                    assert " ".join(text.split()) in rendered
                    assert " ".join(text.split()) in lines
    assert "```text\nThe period of " in markdown
    assert "<svg" not in markdown


# --- what cannot be shown is said -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("profile", "words"),
    [
        (
            changed(cycle__period_us=300.0),
            ["Not drawn: the cycle does not fit the bus: 263.320 us needed of 150."],
        ),
        (changed(servo__position_gain_per_s=1e5), ["Not drawn: the position loop is unstable."]),
        (
            changed(cycle__period_us=4050.0, bus__nodes=5000),
            [
                "The circle test cannot be run: ",
                "Not drawn: bus.nodes = 5000: a timeline shows up to 1000 nodes",
            ],
        ),
        (
            Ieee1394Profile.model_validate(BASE.model_dump(exclude_unset=True, include=Profile.model_fields.keys()
                                           - {"servo", "circle", "tolerance", "delivery", "mechanics"})),
            ["The profile has no section for a circle test, so none was run."],
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_drawn_is_said(profile: Profile, words: list[str]) -> None:
    content = page_report([ReportedProfile("x", all_answers(profile))], title=None)
    html, markdown = render(content, "html"), render(content, "markdown").replace("\\", "")
    assert "nan" not in html.lower().replace("nano", "")
    text = Tags(html).text
    for one in words:
        assert one in text
        assert one.removesuffix(".") in markdown


@pytest.mark.parametrize(
    ("nodes", "bars", "said"),
    [
        (62, 2 * 62, " A bar is a whole transaction."),
        (1000, 0, "1000 nodes are over the 62"),
    ],
)
def test_the_page_stays_small_however_many_nodes_there_are(nodes: int, bars: int, said: str) -> None:
    profile = changed(bus__nodes=nodes, bus__max_hops=16, cycle__period_us=100_000.0, circle__radius_mm=300.0)
    results = all_answers(profile, with_circle=nodes == 62)
    html = render(page_report([ReportedProfile("x", results)], title=None), "html")
    assert len(html.encode()) < 300_000
    assert said in Tags(html).text
    lanes = re.findall(r"by node</text>.*?</svg>", html, re.DOTALL)
    # The bus has a lane of its own, with the synchronous packet.
    assert [lane.count("<title>") for lane in lanes] == ([bars + 1] if bars else [])


def test_a_circle_that_was_left_out_is_said() -> None:
    assert "The circle test was left out (--no-circle)." in Tags(render(made(BASE), "html")).text


# --- charts -----------------------------------------------------------------------------------------------


def test_signed_bars_share_one_zero() -> None:
    def bar(value: float) -> tuple[float, float, str]:
        (rect,) = ET.fromstring(signed_bar(value, least=-1.0, most=3.0, title="x")).iter(f"{SVG}rect")
        x, width = (float((rect.get(key) or "").rstrip("%")) for key in ("x", "width"))
        return x, width, rect.get("class") or ""

    assert bar(3.0) == (25.0, 75.0, "takes")
    assert bar(-1.0) == (0.0, 25.0, "hides")
    assert bar(0.0) == (25.0, 0.0, "takes")


# --- colours ----------------------------------------------------------------------------------------------

STYLE = (files("busplan.forms") / "templates" / "chart.css").read_text(encoding="utf-8")
SCHEMES = [
    dict(re.findall(r"--([\w-]+): (#\w{6})", block)) for block in re.findall(r":root \{(.*?)\}", STYLE, re.DOTALL)
]


def luminance(colour: str) -> float:
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    """Contrast of two colours (WCAG 2)."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("scheme", SCHEMES, ids=["light", "dark"])
def test_words_and_curves_can_be_read_in_both_schemes(scheme: dict[str, str]) -> None:
    for name in ("ink", "muted", "link", "good", "bad", "warn", "plain"):
        assert contrast(scheme[name], scheme["paper"]) >= 4.5, name
    for name in ("first", "second"):
        assert contrast(INKS[name][SCHEMES.index(scheme)], scheme["paper"]) >= 4.5, name


def test_letters_can_be_read_on_their_bars() -> None:
    letters = dict.fromkeys(INKS, ("#10151c", "#10151c"))
    letters |= dict.fromkeys(("sync", "request", "acknowledge", "reserve", "out"), ("#ffffff", "#10151c"))
    letters |= {"idle": (SCHEMES[0]["ink"], SCHEMES[1]["ink"]), "long-gap": ("#10151c", SCHEMES[1]["ink"])}
    for term in (term for kind in kind_names() for term in kind_named(kind).figures.terms):
        for letter, colour in zip(letters[term.ink], INKS[term.ink], strict=True):
            assert contrast(letter, colour) >= 4.5, term
    for ink, colours in INKS.items():
        if ink.startswith(("above", "below")):
            assert contrast("#10151c", colours.light) >= 4, ink
    levels = [colours for ink, colours in INKS.items() if ink.startswith(("above", "below"))]
    assert len(set(levels)) == len(levels)


@cache
def gantry() -> str:
    return render(made(load("gantry-24").profile), "html")


def test_what_is_assumed_is_said_before_any_figure_that_rests_on_it() -> None:
    page = gantry()
    words, figure = page.index("are assumed: nobody has measured"), page.index("fastest period")
    assert words < figure
    assert "<bdi>group.drives.execution.base_us</bdi>" in page[:figure]
    measured = override(load("paper-two-node").profile, {"node.execution.grade": "measured"})
    assert "assumed: nobody has measured" not in render(made(measured), "html")
    # What carries most of the verdict is named first.
    assert page[:words].rpartition("<p")[2].partition("<bdi>")[2].startswith("group.drives.execution.base_us</bdi>")


def test_a_warning_looks_like_one_in_a_card_of_what_passes() -> None:
    page = gantry()
    card = page.partition('<div class="judged passes">')[2].partition("</div>\n</div>")[0]
    assert '<dd class="warns">not shown to fit while it leaves bus.gap_count = 63</dd>' in card
    assert re.search(r"\.lines p\.warns[^{]*\{[^}]*border-left", page)
