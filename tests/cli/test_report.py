"""`busplan report`: every figure is the JSON's, files, refusals, several profiles, hostile paths."""

import json
import math
import re
from collections.abc import Callable, Iterator
from decimal import Decimal
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, NamedTuple

import pytest

Run = Callable[..., Any]

QUICK = """
schema_version = 1
name = "quick"
bus = { kind = "ieee1394", speed = "S400", nodes = 2 }
cycle.period_us = 2000
payload = { read_bytes = 12, write_bytes = 12 }
node = { axes = 4, execution = { kind = "linear", base_us = 30, per_byte_us = 0.35 } }
"""
CIRCLE = """
[servo]
position_gain_per_s = 50
velocity_feedforward = 0
drive_lag_us = 500
[circle]
radius_mm = 5
feed_mm_per_min = 3000
ramp_periods = 20
"""


class Shown(NamedTuple):
    """One figure in a cell of a table or beside its name."""

    text: str
    value: str
    unit: str


class Page(HTMLParser):
    """The figures of a page, its commands, the lines of its cards, and numbers in a table that lack their value."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.figures: list[Shown] = []
        self.lines: list[str] = []
        self.cards: list[str] = []
        self.unmarked: list[str] = []
        self._data: dict[str, str] | None = None
        self._text = ""
        self._is_card = self._is_command = self._is_code = self._in_cell = self._counts = False
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {key: value or "" for key, value in attrs}
        if tag == "data":
            self._data, self._text = found, ""
        elif tag == "ul":
            self._is_command = found.get("class") == "commands"
        elif tag == "code":
            self._is_code = True
            self.lines += [""] * self._is_command
        elif tag == "dd":
            self._is_card = True
            self.cards.append("")
        elif tag == "td":
            self._in_cell, self._counts = True, found.get("class") == "figures"

    def handle_endtag(self, tag: str) -> None:
        if tag == "data" and self._data is not None:
            if self._in_cell:
                self.figures.append(Shown(self._text, self._data["value"], self._data.get("data-shown-in", "")))
            self._data = None
        elif tag == "code":
            self._is_code = False
        elif tag == "ul":
            self._is_command = False
        elif tag == "dd":
            self._is_card = False
        elif tag == "td":
            self._in_cell = self._counts = False

    def handle_data(self, data: str) -> None:
        if self._is_command and self._is_code:
            self.lines[-1] += data
        elif self._is_card:
            self.cards[-1] += data
        elif self._counts and self._data is None and not self._is_code and re.search(r"\d", data):
            self.unmarked.append(data)
        if self._data is not None:
            self._text += data


def leaves(document: Any) -> Iterator[Any]:
    """All values of a document, its records and lists, too."""
    yield document
    if isinstance(document, dict | list):
        for one in document.values() if isinstance(document, dict) else document:
            yield from leaves(one)


def require_rounding(shown: Shown, value: Any) -> None:
    """What is shown is the exact value, rounded to its own last digit."""
    if value is None:
        assert shown.text == "-"
    elif isinstance(value, bool):
        assert shown.text.split()[-1] == ("yes" if value else "no")
    elif isinstance(value, str):
        assert shown.text == value
    else:
        factor = {"um": Decimal(1000), "%": Decimal(100), "ms": Decimal("0.001")}.get(shown.unit, Decimal(1))
        exact, text = Decimal(value) * factor, Decimal(shown.text)
        half = Decimal((0, (5,), int(text.as_tuple().exponent) - 1)) * Decimal("1.000001")
        # Of a figure beyond 2^53, the float nearest to it.
        assert abs(text - exact) <= max(half, Decimal(math.ulp(float(exact)))), shown


def reported(run: Run, shell: Run, *arguments: str, cwd: Path) -> Page:
    """The page for some arguments, once every figure of it is that of its commands, run as they stand."""
    done, document = (run("report", *form, *arguments, cwd=cwd) for form in ((), ("--format", "json")))
    assert (done.returncode, done.stderr) == (0, "")
    page = Page(done.stdout)
    answers = [one for each in json.loads(document.stdout)["profiles"] for one in each["answers"].values()]
    assert [json.loads(shell(f"{line} --format json", cwd=cwd).stdout) for line in page.lines] == answers
    found = [*leaves(answers)]
    assert page.cards
    assert {*page.cards} <= {one for one in found if isinstance(one, str)}
    assert page.unmarked == []
    for shown in page.figures:
        value = json.loads(shown.value)
        assert value in found, shown
        require_rounding(shown, value)
    return page


@pytest.mark.slow
def test_every_figure_of_the_shipped_profile_is_the_commands_own(run: Run, shell: Run, tmp_path: Path) -> None:
    page = reported(run, shell, "paper-4ms", "--circle", cwd=tmp_path)
    assert len(page.figures) > 200
    assert [line.split()[1] for line in page.lines] == [
        *("capacity", "map", "latency", "timeline", "circle-test", "explain"),
    ]
    # Nothing of these commands' main figures is left out.
    values = [shown.value for shown in page.figures]
    for result in json.loads(shell(f"{page.lines[0]} --format json", cwd=tmp_path).stdout)["results"]:
        for key in ("required_us", "margin_us", "utilisation", "max_axes"):
            assert json.dumps(result[key]) in values
    assert ("18.967", "um") in {(shown.text, shown.unit) for shown in page.figures}


def test_figures_at_another_period_of_hostile_paths_and_equal_names(run: Run, shell: Run, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    names = ('sub/it\'s $(a)  `b` "c"\there \u202e.toml', "-o.toml")
    for name in names:
        (tmp_path / name).write_text(QUICK + CIRCLE, encoding="utf-8")
    page = reported(run, shell, "--period", "0.4ms", "--", *names, cwd=tmp_path)
    assert "busplan capacity ./-o.toml --sensitivity --period 400us" in page.lines


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        ("period_us = 2000", "period_us = 100"),
        ("position_gain_per_s = 50", "position_gain_per_s = 900000"),
        ("nodes = 2", "nodes = 1000000"),
        ("ramp_periods = 20", "ramp_periods = 1000"),
    ],
    ids=["overrun", "unstable", "a million nodes", "impossible circle"],
)
def test_a_profile_that_fails_is_reported_with_exit_0(
    run: Run, shell: Run, tmp_path: Path, changes: tuple[str, str]
) -> None:
    text = QUICK + CIRCLE
    assert changes[0] in text
    (tmp_path / "x.toml").write_text(text.replace(*changes), encoding="utf-8")
    reported(run, shell, "x.toml", "--circle", cwd=tmp_path)


@pytest.mark.slow
def test_a_circle_is_there_where_it_is_asked_for_or_its_servo_is_measured(run: Run, tmp_path: Path) -> None:
    measured = CIRCLE.replace("[circle]", 'grade = "measured"\n[circle]')
    for circle, option, has_circle in (
        ("", (), False),
        (CIRCLE, (), False),
        (CIRCLE, ("--circle",), True),
        (measured, (), True),
        (measured, ("--no-circle",), False),
    ):
        (tmp_path / "x.toml").write_text(QUICK + circle, encoding="utf-8")
        page = Page(run("report", "x.toml", *option, cwd=tmp_path).stdout)
        assert any("circle-test" in line for line in page.lines) == has_circle


@pytest.mark.slow
def test_the_same_profile_gives_the_same_bytes_to_a_file_and_to_standard_output(run: Run, tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(QUICK + CIRCLE, encoding="utf-8")
    for name, *form in (("a.HTML",), ("page", "--format", "markdown")):
        assert run("report", "x.toml", "-o", name, *form, cwd=tmp_path).returncode == 0
    for file, kind, seed in (("a.HTML", "html", {"PYTHONHASHSEED": "7"}), ("page", "markdown", None)):
        shown = run("report", "x.toml", "--format", kind, cwd=tmp_path, env=seed).stdout
        assert (tmp_path / file).read_text(encoding="utf-8") == shown


def test_a_comparison_stands_in_front_and_leads_to_each_profile_also_of_standard_input(
    run: Run, tmp_path: Path
) -> None:
    done = run("report", "-", "paper-optimal-gap", "--title", "Cell 7 <north>", stdin=QUICK, cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.index('id="comparison"') < done.stdout.index('id="p1"') < done.stdout.index('id="p2"')
    assert [done.stdout.count(f'href="#p{number}"') for number in (1, 2, 3)] == [1, 1, 0]
    assert "<title>Cell 7 &lt;north&gt; - busplan</title>" in done.stdout
    assert "<h1>Cell 7 &lt;north&gt;</h1>" in done.stdout
    assert Page(done.stdout).lines[0] == "busplan capacity - --sensitivity"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nope"], "nope: no such file, and no shipped profile of that name"),
        (
            ["paper-4ms", "-o", "x.pdf"],
            "--output x.pdf: expected a name ending in .txt, .md, .html, .csv, .json, or --format",
        ),
        (["paper-4ms", "-o", "no/such/x.html"], "there is no folder"),
        (["-", "-"], "-: standard input can be read once"),
        (["paper-4ms", "--period", "4"], "--period 4: expected a time with its unit, as 4ms, 250us or 0.001s"),
        (["paper-4ms", "paper-1ms", "--period", "0s"], "--period 0s"),
        (["paper-4ms", "--title", "a\nb"], "--title 'a\\nb': expected words in one line"),
        (["paper-4ms", "--title", " "], "--title ' ': expected words in one line"),
        (["paper-4ms", "--format", "pdf"], "--format pdf: expected table, markdown, html, csv or json; "),
        ([], "busplan report: missing argument"),
    ],
)
def test_what_cannot_be_done_is_said_and_leaves_nothing(
    refused: Callable[..., str], tmp_path: Path, arguments: list[str], message: str
) -> None:
    assert message in refused("report", *arguments, cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_all_problems_of_all_profiles_are_said_and_nothing_is_written(
    refused: Callable[..., str], tmp_path: Path
) -> None:
    (tmp_path / "a.toml").write_text(QUICK.replace("nodes = 2", "nodes = 0"), encoding="utf-8")
    (tmp_path / "b.toml").write_text("no profile", encoding="utf-8")
    (tmp_path / "x.html").write_text("old", encoding="utf-8")
    said = refused("report", "paper-4ms", "a.toml", "b.toml", "c.toml", "-o", "x.html", cwd=tmp_path)
    assert all(f"{name}.toml:" in said for name in "abc")
    assert (tmp_path / "x.html").read_text(encoding="utf-8") == "old"
    assert len(list(tmp_path.iterdir())) == 3
