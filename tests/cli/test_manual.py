"""`busplan manual`: the reference pages with their tables, and a list of them."""

import re
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from busplan.manual import FOLDER, page, topics

Run = Callable[..., CompletedProcess[str]]
Refused = Callable[..., str]

TOPICS = [
    *("commands", "can", "circle", "ethercat", "gate", "import"),
    *("json", "limits", "measured", "models", "plan", "polled", "profile", "python", "sercos"),
]


def test_without_a_topic_it_lists_them_a_line_each_and_says_how_to_show_one(run: Run) -> None:
    done = run("manual")
    how, empty, *lines = done.stdout.splitlines()
    assert (done.returncode, done.stderr, empty) == (0, "", "")
    assert "`busplan manual TOPIC`" in how
    assert [line.split()[0] for line in lines] == TOPICS
    assert [line.split("  ", 1)[1].strip() for line in lines] == list(topics().values())


@pytest.mark.parametrize("topic", TOPICS)
def test_a_topic_is_its_page_with_tables_for_their_places(run: Run, topic: str) -> None:
    done = run("manual", topic)
    assert (done.returncode, done.stderr) == (0, "")
    prose = re.split("^> .*\n", (FOLDER / f"{topic}.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    between = r"(?:\|.*\n){3,}"
    assert re.fullmatch(between.join(map(re.escape, prose)), done.stdout)


def test_a_file_gets_the_same_page_whatever_its_name(run: Run, tmp_path: Path) -> None:
    for name in ("x.md", "x"):
        (tmp_path / name).write_text("old", encoding="utf-8")
        done = run("manual", "limits", "-o", name, cwd=tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", f"wrote {name}\n")
        assert (tmp_path / name).read_text(encoding="utf-8") == run("manual", "limits").stdout


def test_a_terminal_gets_the_page_set_for_reading_and_no_word_cut_off(
    on_terminal: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    width = {"COLUMNS": "60", "NO_COLOR": "1"}
    code, shown = on_terminal("manual", "profile", cwd=tmp_path, env=width)
    assert code == 0
    text = re.sub("\x1b\\[[0-9;]*m", "", shown)
    assert "| key |" not in text
    assert "\u2026" not in text
    assert max(map(len, text.splitlines())) <= 60
    # A table's column: the key is folded, as rich would cut it.
    column = "".join(line[1:].split(" ")[0] for line in text.splitlines())
    assert "cycle.nonperiodic_us" in column
    # A file gets Markdown.
    code, _ = on_terminal("manual", "profile", "-o", "x.md", cwd=tmp_path)
    assert (tmp_path / "x.md").read_text(encoding="utf-8") == page("profile")


def test_a_card_of_80_columns_is_not_broken_on_a_terminal_of_80(
    on_terminal: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    _, shown = on_terminal("manual", "commands", cwd=tmp_path, env={"COLUMNS": "80", "NO_COLOR": "1"})
    page = (FOLDER / "commands.md").read_text(encoding="utf-8").splitlines()
    heads = [line for line in page if line.endswith("  FITS") and len(line) == 80]
    assert heads
    assert set(heads) <= set(re.sub("\x1b\\[[0-9;]*m", "", shown).splitlines())


@pytest.mark.parametrize("topic", ["profiles", "", "Profile", "../manual/profile", "profile.md"])
def test_an_unknown_topic_is_refused_with_the_known_ones(refused: Refused, topic: str, tmp_path: Path) -> None:
    said = refused("manual", topic, "-o", "x.md", cwd=tmp_path)
    known = f"{topic or repr(topic)}: no such topic; there are {', '.join(TOPICS)}"
    assert re.fullmatch(re.escape(known) + "(; did you mean profile\\?)?", said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("typed", "offered"), [("busplan man", "manual"), ("busplan manual p", "plan polled profile python")]
)
def test_its_name_and_topics_are_completed(run: Run, typed: str, offered: str) -> None:
    at = str(len(typed.split()) - 1)
    variables = {"_BUSPLAN_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": at}
    done = run(inside={"variables": variables})
    assert done.stdout.split() == offered.split()
