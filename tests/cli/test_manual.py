"""`busplan manual`: what is shipped is what the program says today, whole, and clean for those who read it."""

import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from html import unescape
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest
from markdown_it import MarkdownIt
from typer.main import get_command

from busplan import __version__
from busplan.analysis.register import figures_of
from busplan.answers.manual.pages import Entry, Manual
from busplan.buses import kind_named
from busplan.cli import app
from busplan.cli.lazy import COMMANDS
from busplan.cli.tree import manual_of

Run = Callable[..., CompletedProcess[str]]
Refused = Callable[..., str]

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "busplan"
SHIPPED = {"man": PACKAGE / "_manual" / "busplan.1", "markdown": PACKAGE / "_manual" / "reference.md"}
REFRESH = "run: for file in busplan.1 reference.md; do busplan manual -o src/busplan/_manual/$file; done"
READERS = {"groff": ["groff", "-man", "-Tutf8", "-P-cbou"], "mandoc": ["mandoc", "-Tutf8", "-O", "width=200"]}


def manual() -> Manual:
    return manual_of(get_command(app))


def entries() -> Iterator[Entry]:
    for page in (manual().program, *manual().commands):
        yield from (*page.arguments, *page.options)
    for section in manual().sections:
        yield from section.entries


def sentences() -> Iterator[str]:
    """Everything that the manual says, as a reader sees it."""
    for page in (manual().program, *manual().commands):
        yield from (page.summary, *page.paragraphs, *page.examples, f"{page.called} {page.usage}")
    for section in manual().sections:
        yield from section.paragraphs
    yield from (entry.text for entry in entries())


def plain(text: str) -> str:
    return " ".join(text.replace("`", "").split())


@pytest.mark.parametrize("format_", ["man", "markdown"])
def test_what_is_shipped_is_what_the_program_says(run: Run, format_: str) -> None:
    done = run("manual", "--format", format_)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == SHIPPED[format_].read_text(encoding="utf-8"), REFRESH


def test_it_has_every_command_and_every_parameter_but_help() -> None:
    root: Any = get_command(app)
    found = {page.name: page for page in manual().commands}
    assert tuple(found) == COMMANDS
    for name, page in found.items():
        params = root.get_command(None, name).params
        named = [one for entry in (*page.arguments, *page.options) for one in entry.names]
        assert sorted(named) == sorted(
            one
            for param in params
            for one in ([param.metavar] if param.param_type_name == "argument" else param.opts + param.secondary_opts)
        )
        assert page.examples
    assert {"--version", "--help"} <= {name for entry in manual().program.options for name in entry.names}


def test_it_says_what_holds_for_all_commands() -> None:
    sections = {section.title: section for section in manual().sections}
    assert tuple(sections) == ("Exit status", "Figures", "Environment", "Files", "See also")
    names = {title: [name for entry in one.entries for name in entry.names] for title, one in sections.items()}
    assert names["Exit status"] == ["0", "1", "2", "130"]
    figures = figures_of(kind_named("ieee1394"))
    assert set(names["Figures"]) >= {key for command in figures.values() for key in command}
    assert len(names["Figures"]) == len(set(names["Figures"]))
    assert {"NO_COLOR", "FORCE_COLOR", "BUSPLAN_FORMAT", "_BUSPLAN_COMPLETE"} <= set(names["Environment"])
    assert {"paper-4ms", "table-1.csv"} <= set(names["Files"])


@pytest.mark.parametrize("reader", READERS)
def test_the_man_page_shows_all_of_it_as_it_is_written(reader: str, tmp_path: Path) -> None:
    if shutil.which(reader) is None:
        pytest.skip(f"no {reader} here")
    done = subprocess.run(
        [*READERS[reader], str(SHIPPED["man"])], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert done.stderr == ""
    shown = " ".join(re.sub(r".\x08", "", done.stdout).split())
    assert [text for text in sentences() if plain(text) not in shown] == []
    assert f"busplan {__version__}" in shown
    for entry in entries():
        assert f"{', '.join(entry.names)} {entry.value}".strip() in shown


@pytest.mark.skipif(shutil.which("mandoc") is None, reason="no mandoc here")
def test_mandoc_misses_nothing_in_the_man_page_but_a_date(tmp_path: Path) -> None:
    done = subprocess.run(
        ["mandoc", "-T", "lint", str(SHIPPED["man"])], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    (line,) = done.stdout.splitlines()
    assert line.endswith(':1:15: WARNING: missing date, using "": TH')


@pytest.mark.skipif(shutil.which("groff") is None, reason="no groff here")
def test_groff_has_no_warning_of_the_man_page(tmp_path: Path) -> None:
    done = subprocess.run(
        ["groff", "-man", "-ww", "-Tutf8", "-z", str(SHIPPED["man"])],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert (done.returncode, done.stderr) == (0, "")


def rendered() -> str:
    """The Markdown reference as a browser has it."""
    reader = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    return str(reader.render(SHIPPED["markdown"].read_text(encoding="utf-8")))


def test_the_markdown_shows_all_of_it_as_it_is_written() -> None:
    shown = plain(unescape(re.sub(r"<[^>]*>", "", rendered())))
    assert [text for text in sentences() if plain(text) not in shown] == []


def test_the_markdown_has_a_heading_a_link_and_a_row_for_each() -> None:
    html = rendered()
    headings = re.findall(r"<h2>([^<]*)</h2>", html)
    assert headings == [
        "Commands",
        *(f"busplan {name}" for name in COMMANDS),
        *(one.title for one in manual().sections),
    ]
    anchors = re.findall(r'<a href="#([^"]*)">', html)
    assert anchors == [heading.replace(" ", "-") for heading in headings if heading.startswith("busplan")]
    assert html.count("<td") == 2 * (len(COMMANDS) + len(list(entries())))
    assert not re.search(r"<(em|strong|del|img|hr|blockquote|ul|ol|h[3-6])\b", html)


@pytest.mark.parametrize(
    ("arguments", "format_"),
    [
        (("-o", "x.1"), "man"),
        (("-o", "x.md"), "markdown"),
        (("-o", "x", "--format", "markdown"), "markdown"),
        (("-o", "x.1", "--format", "markdown"), "markdown"),
        (("--output", "x.md", "--format", "man"), "man"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_it_goes_into_a_file_and_replaces_it(
    run: Run, tmp_path: Path, arguments: tuple[str, ...], format_: str
) -> None:
    file = tmp_path / arguments[1]
    file.write_text("old", encoding="utf-8")
    done = run("manual", *arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", f"wrote {file.name}\n")
    assert file.read_bytes() == SHIPPED[format_].read_bytes()
    assert list(tmp_path.iterdir()) == [file]


def test_without_options_it_is_what_a_person_can_read(run: Run) -> None:
    assert run("manual").stdout == run("manual", "--format", "markdown").stdout


def test_it_does_not_change_with_the_terminal(run: Run) -> None:
    narrow = run("manual", env={"COLUMNS": "40", "BUSPLAN_FORMAT": "sarif", "FORCE_COLOR": "1", "LANG": "C"})
    assert narrow.stdout == run("manual").stdout


def test_what_cannot_be_written_is_said(refused: Refused, tmp_path: Path) -> None:
    assert refused("manual", "-o", "no/x.1", cwd=tmp_path).startswith("no/x.1: cannot be written: there is no folder")
    assert "--format" in refused("manual", "--format", "pdf")


def test_its_name_and_forms_are_completed(run: Run) -> None:
    for line, words in (("busplan man", "manual"), ("busplan manual --format ma", "markdown man")):
        at = str(len(line.split()) - 1)
        done = run(env={"_BUSPLAN_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": at})
        assert done.stdout.split() == words.split()


def test_a_name_that_says_no_form_is_refused(refused: Callable[..., str], tmp_path: Path) -> None:
    assert "expected a name ending in .1, .md, or --format" in refused("manual", "-o", "x.html", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []
