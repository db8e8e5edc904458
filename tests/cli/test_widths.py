"""The same words and figures at every width: a narrow terminal wraps and rearranges, and says what it leaves out."""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]
OnTerminal = Callable[..., tuple[int, str]]

QUESTIONS = (
    "capacity paper-4ms",
    "capacity can-servo-8 --period 2ms,4ms --set bus.nodes=4",
    "capacity ethercat-servo-8 --sensitivity",
    "latency gantry-24",
    "latency can-servo-8",
    "circle-test paper-4ms --contributions",
    "timeline paper-4ms",
    "timeline profibus-drives-6",
    "explain paper-4ms",
    "explain ethercat-servo-8 required_us",
    "plan paper-1ms --axes 16",
    "plan paper-1ms --axes 4000",
    "calibrate paper-two-node table-1.csv",
    "map paper-4ms --y cycle.period_us=500:4000:500",
    "sweep paper-1ms --vary bus.nodes=1:4",
    "compare gantry-24",
    "report dvrk --no-circle --format table",
    "check paper-1ms paper-4ms --format full",
    "diff paper-1ms paper-optimal-gap",
    "rule",
    "rule BP110",
    "profiles",
    "evidence can",
    "paper",
)
DRAWN = re.compile(
    r"(?:^.*\|.*\|\n)+(?: +\^\n)?(?:[ \d,.]+\n)?"  # a map with the figures below it, or lanes
    r"|^ *\[[#~.r| ]+\]$"  # the bar of a card
    r"|,\s\S+\s+us\s+a\s+column"
    r"|^  next +busplan .*(?:\n {18}.+)*",  # what to ask next is for a terminal
    re.MULTILINE,
)
RULE = re.compile(r"^-{3,}$", re.MULTILINE)
"""Below the headings of a table."""
BELOW = re.compile(r"^ {4}([a-z][a-z ]*): ", re.MULTILINE)
"""A heading that stands below each row where there is no room for its column."""
LEFT_OUT = re.compile(r"Not shown: (?P<names>.*?)\. --all shows all\.")
LONG = 16
"""Longest word that is never broken."""


def words(text: str) -> Counter[str]:
    """Words and figures, each as often as it stands there, but for drawings, which fill the width."""
    text = RULE.sub("", DRAWN.sub("", text))
    text += "\n".join(set(BELOW.findall(text)))
    return Counter(word.rstrip(".,:;") for word in BELOW.sub("", text).split())


def without_broken(here: Counter[str], there: Counter[str]) -> Counter[str]:
    """What a narrow terminal shows, long words joined again that are broken over two lines."""
    joined = there.copy()
    for word, times in (here - there).items():
        for at in range(1, len(word)) if len(word) > LONG else ():
            if joined[word[:at]] and joined[word[at:]]:
                pieces = Counter({word[:at]: times}) + Counter({word[at:]: times})
                joined = joined - pieces + Counter({word: times})
                break
    return joined


@pytest.mark.slow
@pytest.mark.parametrize("columns", ["60", "80", "200"])
@pytest.mark.parametrize("question", QUESTIONS)
def test_no_width_loses_or_changes_a_word(
    run: Run, on_terminal: OnTerminal, question: str, columns: str, tmp_path: Path
) -> None:
    terminal = {"TERM": "dumb", "COLUMNS": columns, "PAGER": ""}
    for more in ([], ["--all"]) if not question.startswith(("report", "check")) else ([],):
        done = run(*question.split(), *more)
        _, shown = on_terminal(*question.split(), *more, cwd=tmp_path, env=terminal)
        here, is_divided = words(done.stdout + done.stderr), len(RULE.findall(shown)) > len(RULE.findall(done.stdout))
        said = LEFT_OUT.search(" ".join(shown.split()))
        left_out = words(said[0]) if said else Counter[str]()
        there = without_broken(here, words(shown))
        if more:
            assert said is None
        if said is None or "column" not in said["names"]:
            assert here - there == Counter()
        assert (there - left_out).keys() <= here.keys()
        if not is_divided:  # which repeats the first columns
            assert there - left_out - here == Counter()
