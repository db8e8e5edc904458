"""Text of the manual: no character of it is markup, in Markdown or in roff."""

import re
import shutil
import subprocess
from html import unescape

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from busplan.answers.manual.man import roff
from busplan.answers.manual.markdown import prose
from busplan.answers.manual.pages import spans

HOSTILE = (
    "- item", "+ item", "1. item", "12) item", "# head", "> quote", "=====", "---", "***", "___", "[a]: b", "[x](y)",
    "![x](y)", "[x][y]", "*a* _b_ __c__", "a_b_c _d", "~~a~~", "&lt; & &#60;", "<b>", "<a@b.c>", "a | b", "\\*a\\*",
    "a\\", "`unclosed", "<!-- a -->", "    indented", "T_exec, F_min", "1<=x<=9",
)  # fmt: skip
ROFF = (
    ".B x", "'br", "..", "a .B b", "\\fBx\\fR", "\\", "\\\\n", "--nodes -1", "it's `x` \"y\" ^ ~", "\\(aq", "a\\", ".",
    "...", "'", "\\&", "% \\% @",
)  # fmt: skip


def shown(markdown: str) -> str:
    """What a browser shows of it, and that it is one paragraph."""
    html = MarkdownIt("commonmark").enable(["table", "strikethrough"]).render(markdown)
    match = re.fullmatch(r"<p>(.*)</p>\n", html)
    assert match, html
    assert set(re.findall(r"<(\w+)", match[1])) <= {"code"}, html
    return unescape(re.sub(r"</?code>", "", match[1]))


@given(st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=30))
@example("` `")
def test_a_paragraph_shows_any_text_and_does_nothing_else(text: str) -> None:
    line = " ".join(text.split())
    if line:
        seen = "".join(part.strip() if typed else part for part, typed in spans(line))
        assert shown(prose(text)).split() == seen.split()


@pytest.mark.parametrize("text", HOSTILE)
def test_a_paragraph_shows_hostile_text(text: str) -> None:
    assert shown(prose(text)) == text.strip()


@pytest.mark.parametrize("reader", [["groff", "-man", "-Tutf8", "-ww", "-P-cbou"], ["mandoc", "-Tutf8"]], ids="".join)
def test_a_man_page_shows_hostile_text(reader: list[str]) -> None:
    if shutil.which(reader[0]) is None:
        pytest.skip(f"no {reader[0]} here")
    texts = (*HOSTILE, *ROFF)
    page = '.TH X 1 "" "" ""\n.SH NAME\n' + "".join(f".PP\n{roff(text)}\n" for text in texts)
    done = subprocess.run(reader, input=page, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    body = re.sub(r".\x08", "", done.stdout).partition("NAME\n")[2]
    assert [line.strip() for line in body.split("\n\n")][: len(texts)] == [" ".join(text.split()) for text in texts]


def test_what_is_typed_is_told_from_what_is_read() -> None:
    typed = [
        part for part, is_typed in spans("Use `a -b`, --no-circle, -o FILE; not set-points, 1 - 2 or a--b.") if is_typed
    ]
    assert typed == ["a -b", "--no-circle", "-o"]


def test_ascii_stays_ascii_with_macros_that_would_set_it_as_typography() -> None:
    # Debian's own macros forgive it, others do not.
    assert roff("- ' ` ^ ~ \"") == r"\- \(aq \(ga \(ha \(ti \(dq"
