"""The Python blocks of the manual run as they stand, and draw the true numbers."""

import doctest
import re
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan.manual import page

PAGE = page("python")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def test_a_picture_and_a_table_are_five_lines_and_true(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    script = blocks("python")[0]
    assert sum(map(bool, script.splitlines())) == 5
    names: dict[str, Any] = {}
    exec(compile(script, "python.md", "exec"), names)
    found = busplan.capacity("paper-4ms", period_us=list(range(250, 4001, 250)), timing_model=["standard"]).results
    assert names["most"] == max(one.safe_axes or 0 for one in found)
    assert (tmp_path / "free.png").read_bytes().startswith(b"\x89PNG")


def test_the_pages_and_pictures_are_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(blocks("python")[1], "python.md", "exec"), {"busplan": busplan})
    assert (tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert (tmp_path / "timeline.svg").read_text(encoding="utf-8").startswith("<svg ")


def test_the_example_of_an_answer_is_the_programs_own() -> None:
    (block,) = blocks("pycon")
    example = doctest.DocTestParser().get_doctest(block, {}, "python.md", "python.md", 0)
    assert len(example.examples) >= 5
    assert doctest.DocTestRunner().run(example).failed == 0


def test_every_function_is_named() -> None:
    functions = [name for name in busplan.__all__ if name.islower() and not name.startswith("_")]
    assert [name for name in functions if not re.search(rf"`{name}`|busplan\.{name}\(", PAGE)] == []
