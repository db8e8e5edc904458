"""Each question in each form: what the form promises, and the same document in a file."""

import csv
import json
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt

Run = Callable[..., Any]
Refused = Callable[..., str]

ENDINGS = {".txt": "table", ".md": "markdown", ".html": "html", ".csv": "csv", ".json": "json"}
QUESTIONS = (
    ("diff", "paper-1ms", "paper-optimal-gap"),
    ("diff", "paper-1ms", "paper-1ms"),
    ("explain", "paper-1ms"),
    ("explain", "paper-1ms", "required_us", "--timing-model", "both"),
    ("calibrate", "paper-two-node", "table-1.csv"),
    ("compare", "gantry-24"),
    ("paper",),
    ("evidence", "can"),
    ("profiles",),
    ("rule",),
    ("rule", "bp110"),
)


class Page(HTMLParser):
    """Tags of a page, and the figures in cells of its tables."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self._in_cell = False
        self.figures: list[Any] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag in ("td", "li", "p"):
            self._in_cell = tag == "td"
        if tag == "data" and self._in_cell:
            self.figures.append(json.loads(dict(attrs)["value"] or ""))


def leaves(document: Any) -> Iterator[Any]:
    yield document
    if isinstance(document, dict | list):
        for value in document.values() if isinstance(document, dict) else document:
            yield from leaves(value)


def written(run: Run, question: tuple[str, ...], form: str, **options: Any) -> str:
    done = run(*question, "--format", form, **options)
    assert (done.returncode, done.stderr) == (0, ""), done
    return str(done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("question", QUESTIONS, ids=" ".join)
def test_each_form_is_what_it_promises(run: Run, question: tuple[str, ...]) -> None:
    document = json.loads(written(run, question, "json"))
    assert (document["schema"], document["command"]) == (1, question[0])

    rows = list(csv.reader(StringIO(written(run, question, "csv"))))
    assert len(rows) > 1
    assert {len(row) for row in rows} == {len(set(rows[0]))}

    page = Page(written(run, question, "html"))
    assert page.tags.count("h1") == 1
    assert "script" not in page.tags
    known = list(leaves(document))
    assert [value for value in page.figures if value not in known] == []

    markdown = written(run, question, "markdown")
    assert markdown.startswith(("# ", "### "))
    rendered = Page(MarkdownIt("commonmark", {"html": True}).enable("table").render(markdown))
    assert rendered.tags[0] in ("h1", "h3")

    text = written(run, question, "table")
    assert text.endswith("\n")
    assert not text.endswith("\n\n")


@pytest.mark.slow
@pytest.mark.parametrize("ending", ENDINGS)
def test_the_ending_of_a_file_chooses_the_form(run: Run, ending: str, tmp_path: Path) -> None:
    done = run("evidence", "can", "-o", f"answer{ending}", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", f"wrote answer{ending}\n")
    expected = written(run, ("evidence", "can"), ENDINGS[ending])
    assert (tmp_path / f"answer{ending}").read_text(encoding="utf-8") == expected
    if ENDINGS[ending] == "table":
        assert run("evidence", "can").stdout == expected
    # A form may be named whatever the file is called.
    run("evidence", "can", "-o", "answer", "--format", ENDINGS[ending], cwd=tmp_path)
    assert (tmp_path / "answer").read_text(encoding="utf-8") == expected


@pytest.mark.slow
@pytest.mark.parametrize("command", ["timeline", "map", "compare"])
def test_a_picture_goes_to_a_file_and_down_a_pipe(
    run: Run, refused: Refused, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for form, start in (("svg", b"<svg xmlns="), ("png", b"\x89PNG")):
        with (tmp_path / "pipe").open("wb") as file:
            run(command, "paper-4ms", "--format", form, inside={"stdout": file.fileno()})
        done = run(command, "paper-4ms", "-o", f"picture.{form}", cwd=tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", f"wrote picture.{form}\n")
        content = (tmp_path / f"picture.{form}").read_bytes()
        assert content == (tmp_path / "pipe").read_bytes()
        assert content.startswith(start)
    said = refused(command, "paper-4ms", "-o", "picture.doc", cwd=tmp_path)
    assert said.startswith("--output picture.doc: expected a name ending in .txt, .md, .html, .csv, .json, .svg, .png")
    assert "for a PDF write .svg" in refused(command, "paper-4ms", "-o", "picture.pdf", cwd=tmp_path)
    assert "there is no folder" in refused(command, "paper-4ms", "-o", "no/picture.svg", cwd=tmp_path)
    monkeypatch.setattr("busplan.extras.find_spec", lambda _name: None)
    said = refused(command, "paper-4ms", "-o", "new.png", cwd=tmp_path)
    assert said == "--output new.png needs resvg_py: install it with the extra, as in pip install 'busplan[plot]'"
    assert {path.name for path in tmp_path.iterdir()} == {"pipe", "picture.svg", "picture.png"}


def test_a_gate_that_fails_has_given_its_answer(run: Run, tmp_path: Path) -> None:
    gate = ("diff", "paper-optimal-gap", "paper-1ms", "--fail-on-regression", "-o", "diff.md")
    done = run(*gate, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    wrote, regression = done.stderr.splitlines()
    assert wrote == "wrote diff.md"
    assert regression.startswith("regression: B is worse in 16 figures: ")
    assert (tmp_path / "diff.md").read_text(encoding="utf-8").startswith("### Changes from `paper-optimal-gap` to ")
