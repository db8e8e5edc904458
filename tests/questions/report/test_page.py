"""The page of `busplan report`: its charts are the results, its colours can be read, its names are text."""

import os
import re
import subprocess
from functools import cache
from html.parser import HTMLParser
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

import busplan
from busplan.buses import kind_named, kind_names
from busplan.forms import render
from busplan.forms.blocks import Chapter
from busplan.forms.inks import INKS
from busplan.profile.changes import NO_CHANGES, shell_word

NAMES = (
    "</title><script>alert(1)</script> \"><img src=x onerror=alert(1)> ' autofocus onfocus='alert(1)",
    "]]>--><!-- ${x} {{7*7}} {% raw %} #{x} </style></svg><b>&amp;&#60;",
    "```\u05d0\u05d1\u05d2 | `x` *a* [x](javascript:alert(1)) <!--".ljust(100, "W"),
)


def changed(**changes: object) -> busplan.Profile:
    return busplan.load_profile("paper-4ms", changes={key.replace("__", "."): value for key, value in changes.items()})


@cache
def whole() -> busplan.ReportAnswer:
    """A page with all that there is."""
    return busplan.report(changed(circle__radius_mm=25.0, circle__ramp_periods=20), circle=True)


@cache
def gantry_page() -> str:
    return busplan.report("gantry-24", circle=False).html


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
def named(names: tuple[str, ...]) -> busplan.ReportAnswer:
    profiles = [changed(name=one, description=f"{one} is why") for one in names]
    # The commands of a page name the profile that it was made from.
    origins = [("x.toml", NO_CHANGES) for _ in names]
    return busplan.report(profiles, title=" ".join(names), origins=origins)


@pytest.mark.slow
def test_hostile_names_make_no_element_and_no_attribute() -> None:
    plain, hostile = (Tags(named(names).html) for names in (("plain",) * len(NAMES), NAMES))
    assert hostile.tags == plain.tags
    assert not {tag for tag, _ in hostile.tags} & {"script", "img", "iframe", "object", "link", "base", "form"}
    assert not [one for _, attributes in hostile.tags for one in attributes if one.startswith("on")]
    for text in (*NAMES, *(f"{name} is why" for name in NAMES), " ".join(NAMES)):
        assert text in hostile.text


@pytest.mark.parametrize("names", [NAMES[2:], pytest.param(NAMES, marks=pytest.mark.slow)])
def test_hostile_names_are_text_in_markdown(names: tuple[str, ...]) -> None:
    markdown = render(named(names).report(), "markdown")
    reader = Tags(MarkdownIt("commonmark", {"html": True}).enable("table").render(markdown))
    assert {tag for tag, _ in reader.tags} <= {
        *("h1", "h2", "h3", "p", "a", "code", "pre", "strong", "ul", "li"),
        *("table", "thead", "tbody", "tr", "th", "td"),
    }
    assert {attributes for _, attributes in reader.tags} <= {(), ("id",), ("href",), ("class",), ("style",)}
    for text in (*names, *(f"{name} is why" for name in names)):
        assert " ".join(text.split()) in " ".join(reader.text.split())


@given(st.binary(min_size=1, max_size=20).filter(lambda raw: b"\0" not in raw))
def test_a_shell_gives_back_any_path(raw: bytes) -> None:
    word = shell_word(os.fsdecode(raw))
    assert word.isprintable()
    shown = subprocess.run(["bash", "-c", f"printf %s {word}"], capture_output=True, check=True)
    assert shown.stdout == (b"./" + raw if raw.startswith(b"-") and raw != b"-" else raw)


# --- the page ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_page_is_whole_in_itself_and_the_same_each_time() -> None:
    two = [changed(), changed(bus__nodes=3)]
    html = busplan.report(two).html
    assert html == busplan.report(two).html
    assert re.findall(r"https?://(?!www\.w3\.org/2000/svg)", html) == []
    assert not re.search(r"url\(|@import|<script|<link|\ssrc=", html)
    assert "None" not in html
    ids = re.findall(r'\bid="([^"]*)"', html)
    assert len(ids) == len(set(ids))
    assert {"p1", "p2", "comparison"} <= set(ids)
    assert set(re.findall(r'href="#([^"]*)"', html)) == {"p1", "p2"}


@pytest.mark.slow
def test_headings_go_down_one_by_one_and_tables_have_scopes() -> None:
    for html in (whole().html, busplan.report(["paper-4ms", "paper-1ms"]).html):
        tags = Tags(html).tags
        levels = [int(tag[1]) for tag, _ in tags if re.fullmatch("h[1-6]", tag)]
        assert levels.count(1) == 1
        assert all(lower <= upper + 1 for upper, lower in pairwise(levels))
        assert all("scope" in attributes for tag, attributes in tags if tag == "th")
        assert all({"role", "class"} <= set(names) or "aria-hidden" in names or "x" in names or "y" in names
                   for tag, names in tags if tag == "svg")  # fmt: skip


def parts() -> dict[str, Chapter]:
    return {block.kind or "": block for block in whole().report().blocks if isinstance(block, Chapter)}


def test_the_verdict_and_the_map_stand_before_all_that_is_folded() -> None:
    assert list(parts()) == ["capacity", "map", "latency", "timeline", "circle", "explain"]
    html = whole().html
    first = html.index("<details")
    assert html.index('<p class="answer">FITS</p>') < html.index("fastest period") < first
    assert html.index("settings are shown to fit") < first
    assert html.count("<details") == len(parts())


# --- what cannot be shown is said -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("profile", "words"),
    [
        (
            changed(cycle__period_us=300.0),
            "NOT RUN, the cycle does not fit the bus: it needs 263.320 us of 150.000 us.",
        ),
        (changed(servo__position_gain_per_s=1e5), "Not drawn: the position loop is unstable."),
        (changed(bus__nodes=5000), "The timeline is not drawn: bus.nodes = 5000: a timeline shows up to 1000 nodes"),
        (changed(circle__feed_mm_per_min=1e6), "The circle test cannot be run: circle.feed_mm_per_min = 1000000.0: "),
        ("dvrk", "The circle test cannot be run: the profile has no section for it."),
    ],
)
def test_what_is_not_shown_is_said(profile: busplan.Profile | str, words: str) -> None:
    answer = busplan.report(profile, circle=True)
    html, markdown = answer.html, render(answer.report(), "markdown").replace("\\", "")
    assert "nan" not in html.lower().replace("nano", "")
    assert words in Tags(html).text
    assert words.removesuffix(".") in markdown
    (document,) = answer.to_dict()["profiles"]
    assert bool(document["missing"]) == words.startswith("The ")
    assert all(why in Tags(html).text for why in document["missing"])


def test_the_page_of_a_full_bus_stays_small() -> None:
    html = busplan.report(changed(bus__nodes=62, bus__max_hops=16, cycle__period_us=100_000.0)).html
    assert len(html.encode()) < 300_000
    (lanes,) = re.findall(r"by node</text>.*?</svg>", html, re.DOTALL)
    # A bar is a whole transaction; the bus has a lane of its own, with the synchronous packet.
    assert lanes.count("<title>") == 2 * 62 + 1


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


def test_what_is_assumed_is_said_before_every_figure_that_rests_on_it() -> None:
    page = gantry_page()
    assumed = "group.drives.execution, group.tool.execution and group.io.execution: measure them first"
    assert page.index(assumed) < page.index("<details")
    measured = busplan.load_profile("paper-two-node", changes={"node.execution.grade": "measured"})
    assert "measure it first" not in busplan.report(measured, circle=False).html


def test_a_warning_looks_like_one_in_a_card_of_what_passes() -> None:
    page = gantry_page()
    card = page.partition('<div class="judged passes">')[2].partition("</div>\n</div>")[0]
    assert '<dd class="warns">not shown to fit while it leaves bus.gap_count = 63</dd>' in card
    assert re.search(r"\.lines p\.warns[^{]*\{[^}]*border-left", page)


def test_a_recording_stands_beside_the_plan_of_its_machine(tmp_path: Path) -> None:
    path = tmp_path / "machine 1.log"
    busplan.emulate("can-servo-8", cycles=30).save(path)
    page = busplan.report("can-servo-8", recording=path, circle=False)
    (profile,) = page.to_dict()["profiles"]
    beside, cycle = profile["answers"]["measured"], profile["answers"]["recorded_cycle"]
    assert beside["figures"] == busplan.measured("can-servo-8", path).to_dict()["figures"]
    assert cycle == busplan.timeline("can-servo-8", recording=path).to_dict()
    sections = {section.key: section.command for section in page.profiles[0].sections}
    assert sections["recorded_cycle"] == f"busplan timeline can-servo-8 --recording '{path}'"
    with pytest.raises(busplan.BusplanError, match="recording: belongs to one profile, and there are 2"):
        busplan.report(["can-servo-8", "canopen-6"], recording=path)
