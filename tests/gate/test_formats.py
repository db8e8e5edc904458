"""The gate's formats: each is what the programs that read it expect, whatever a file or key is called."""

import json
import os
import re
import tomllib
from collections.abc import Callable, Mapping
from contextlib import chdir
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes, urlsplit
from xml.etree import ElementTree as ET

import jsonschema
import pytest
from pydantic_sarif.model import StaticAnalysisResultsFormatSarifVersion210JsonSchema as SarifLog

import busplan
from busplan.gate.formats import FORMATS

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "tests" / "gate" / "examples"
CLEAN = (EXAMPLES / "BP001" / "valid.toml").read_text(encoding="utf-8")
WARNS = CLEAN.replace('"optimal"', "63")
FAILS = WARNS.replace("period_us = 4000", "period_us = 300")

HOSTILE = (
    "plain.toml",
    "100% of, it: a\r\nb.toml",
    "::error::a.toml",
    "a b/ü/日本.toml",
    "a<b>&\"'.toml",
    "\x00\x07\x1b[31m\x85\u2028\ufffe.toml",
    "\udcff.toml",
    "]]>.toml",
    "#?;.toml",
    "C:\\a.toml",
)


Answer = Any
Check = Callable[[Mapping[str, str | None]], Answer]


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> Check:
    """The answer for some files by their text; None for one that is not there."""

    def check(texts: Mapping[str, str | None]) -> Answer:
        with chdir(tmp_path_factory.mktemp("checked")):
            for path, text in texts.items():
                if text is not None:
                    Path(path).parent.mkdir(parents=True, exist_ok=True)
                    Path(path).write_text(text, encoding="utf-8")
            return busplan.check([f"./{path}" for path in texts])

    return check


@pytest.fixture(scope="module")
def mixed(checked: Check) -> Answer:
    answer = checked({"p/clean.toml": CLEAN, "p/fails.toml": FAILS, "p/broken.toml": "a =", "gone.toml": None})
    return renamed(answer, *(file.path.removeprefix("./") for file in answer.files))


@pytest.fixture(scope="module")
def warned(checked: Check) -> Answer:
    return checked({"a.toml": WARNS})


def renamed(answer: Answer, *paths: str) -> Answer:
    """The same answer for files of other names."""
    return answer._replace(files=tuple(f._replace(path=path) for f, path in zip(answer.files, paths, strict=True)))


def finding_at(answer: Answer, line: int, column: int, end: int, *, words: str = "message", **mending: Any) -> Answer:
    """A finding at a place, with its words and the ways to mend it."""
    problem = {"problem": words, "message": words, "help": None, "cure": None, **mending}
    place = {"line": line, "column": column, "marked_column": column, "marked_end_column": end}
    name = {"code": "BP002", "rule": "unknown-key", "severity": "error"}
    return answer.files[0].findings[0]._replace(key="key", **name, **place, **problem)


def report(answer: Answer, *findings: Any, path: str = "a.toml", source: str = "", **more: Any) -> Answer:
    """The answer for one file with some findings."""
    sources = (source,) * len(findings)
    return answer._replace(files=(answer.files[0]._replace(path=path, findings=findings, source=sources, **more),))


def render(answer: Answer, *, file_format: str, **width: int) -> str:
    return FORMATS[file_format].write(answer, **width)


@pytest.fixture(scope="module")
def hostile(warned: Answer) -> Answer:
    files = []
    for name in HOSTILE:
        finding = finding_at(warned, 1, 1, 2, words=name, help=name, cure=f"{name} = 1")
        files += report(warned, finding, finding, path=name, source=name, profile=name).files
    gone = busplan.check("gone.toml").files[0]
    files.append(gone._replace(path="gone\n.toml", failure="gone\n.toml: no\x1bsuch, file: 100 %"))
    return warned._replace(files=tuple(files))


# The answer in blocks


def test_the_answer_says_findings_failures_and_what_they_add_up_to(mixed: Answer, warned: Answer) -> None:
    *findings, failure, summary = str(mixed).splitlines()
    assert findings == render(mixed, file_format="concise").splitlines()
    assert failure.startswith("./gone.toml: no such file")
    assert summary == "checked 3 profiles: 2 errors, 1 warning; 1 could not be checked"
    assert [block.state for block in mixed.report().blocks] == ["warns", "fails", "fails", "fails", "fails"]
    assert [block.state for block in warned.report().blocks] == ["warns", "warns"]
    # An error alone fails, and so does a file that cannot be checked.
    gone: Answer = busplan.check("gone.toml")
    for found in (report(mixed, finding_at(warned, 1, 1, 2)), gone):
        assert [block.state for block in found.report().blocks] == ["fails", "fails"]


# JSON


def test_json_holds_the_contract(mixed: Answer) -> None:
    document = json.loads(render(mixed, file_format="json"))
    assert list(document) == ["schema", "command", "files", "summary"]
    assert (document["schema"], document["command"]) == (1, "check")
    assert document["summary"] == {"files": 4, "errors": 2, "warnings": 1, "circles_not_run": 0, "suppressed": 0}
    assert [(one["path"], one["profile"], one["status"]) for one in document["files"]] == [
        ("p/clean.toml", "example", "ok"),
        ("p/fails.toml", "example", "findings"),
        ("p/broken.toml", None, "findings"),
        ("gone.toml", None, "error"),
    ]
    for one in document["files"]:
        own = {
            "path",
            "profile",
            "status",
            "verdict",
            "margin_corrected_us",
            "uncertainty_us",
            "rests_on",
            "findings",
            "suppressed",
        }
        assert set(one) - {"failure"} == own
        assert (one["verdict"] is None) == (one["profile"] is None) == (one["uncertainty_us"] is None)
    assert [one["verdict"] for one in document["files"][:2]] == ["fits", "does not fit"]
    assert {"key": "bus.max_hops", "words": "a chain of cables"} in document["files"][0]["rests_on"]
    (first, second) = document["files"][1]["findings"]
    assert list(first) == [
        *("code", "rule", "severity", "message", "key", "line", "column", "marked_column", "marked_end_column"),
        *("problem", "help", "cure"),
    ]
    assert (first["code"], first["key"], first["line"], first["column"]) == ("BP110", "bus.gap_count", 7, 1)
    assert (first["marked_column"], first["marked_end_column"]) == (13, 15)  # gap_count = 63
    assert (first["help"], first["cure"]) == (None, None)
    assert first["problem"].startswith("bus.gap_count: gap count 63 is above the 7 that 2 hops need; ")
    assert first["message"] == first["problem"]
    assert second["cure"].endswith("\nbus.gap_count = 7")
    joined = second["cure"].replace("\n", ", ")
    assert second["message"] == f"{second['problem']}; cheapest cure: {joined}"
    assert (second["rule"], second["severity"]) == ("slice-overrun", "error")
    assert document["files"][3]["failure"].startswith("./gone.toml: no such file")


# Every format takes everything


@pytest.mark.parametrize("format_", FORMATS)
def test_no_name_breaks_a_format(format_: str, hostile: Answer) -> None:
    text = render(hostile, file_format=format_)
    # As the command writes it: what is no UTF-8 as an escape.
    written = text.encode("utf-8", "backslashreplace").decode("utf-8")
    assert written.endswith("\n")
    assert not re.search(r"[\x00-\x09\x0b-\x1f]", written)
    if format_ in ("json", "gitlab", "sarif"):
        json.loads(written)
    else:
        assert not re.search(r"[\x7f-\x9f\u2028]", written)
    if format_ == "junit":
        ET.fromstring(written)
    if format_ in ("concise", "github"):
        assert len(written.splitlines()) == 2 * len(HOSTILE)


# concise and full


@pytest.fixture
def full_of(warned: Answer) -> Callable[..., list[str]]:
    def lines(source: str, column: int, end: int | None = None, **mending: Any) -> list[str]:
        finding = finding_at(warned, 12, column, end or column + 1, **mending)
        return render(report(warned, finding, source=source), file_format="full").split("\n")

    return lines


def test_full_underlines_the_value_and_says_the_cure_on_a_line_of_its_own(full_of: Callable[..., list[str]]) -> None:
    assert full_of("nodes = 24", 9, 11, help="mend it", cure="bus.gap_count = 7\ncycle.slice_ratio = 0.7417") == [
        "a.toml:12:9: BP002 error: message",
        "   |",
        "12 | nodes = 24",
        "   |         ^^ unknown-key",
        "help: mend it",
        "cheapest cure:",
        "    bus.gap_count = 7",
        "    cycle.slice_ratio = 0.7417",
        "",
        "",
    ]


@pytest.mark.parametrize(
    ("text", "marked"),
    [
        (WARNS, "63"),  # the value, not the key
        (CLEAN.replace("axes = 4", "axes = 0"), "0"),
        (CLEAN.replace("axes = 4", 'axes = "a  b"'), '"a  b"'),
        (CLEAN.replace("axes = 4", "axis = 4"), "axis"),  # what is no key has no value that counts
        (CLEAN.replace("axes = 4\n", ""), "node"),  # the table that lacks it
        (CLEAN.replace('gap_count = "optimal"\n', ""), "bus"),
        (CLEAN.replace("axes = 4", "axes = [\n4,\n5]"), "["),  # the first line of several
        (CLEAN.replace("nodes = 2", "nodes = 2  # busplan: ignore[BP110]  "), "# busplan: ignore[BP110]"),
        (CLEAN.replace("nodes = 2", "nodes = "), ""),  # the end of a line
    ],
)
def test_what_is_marked_is_what_is_wrong(text: str, marked: str, checked: Check) -> None:
    (result,) = checked({"a.toml": text}).files
    for finding, source in zip(result.findings, result.source, strict=True):
        if source[finding.marked_column - 1 : finding.marked_end_column - 1] == marked:
            return
    raise AssertionError(result.findings)


@pytest.mark.parametrize(
    ("source", "column", "shown", "indent"),
    [
        ("\t\tnodes = 2", 3, "        nodes = 2", "        "),
        ("a\tb = 2", 3, "a    b = 2", "     "),
        ("日本 = 2", 3, "日本 = 2", "    "),
        ("e\u0301 = 2", 3, "e\u0301 = 2", " "),
        ("ü = 2", 3, "ü = 2", "  "),
        ("\x1b[31m = 2", 3, " [31m = 2", "  "),
        ("", 1, "", ""),
        ("abc", 4, "abc", "   "),
    ],
)
def test_the_caret_stands_below_its_column(
    source: str, column: int, shown: str, indent: str, full_of: Callable[..., list[str]]
) -> None:
    _, _, line, caret, *_ = full_of(source, column)
    assert line == f"12 | {shown}".rstrip()
    assert caret == f"   | {indent}^ unknown-key"


@pytest.mark.parametrize("column", [1, 50, 5_000, 99_990, 100_001])
def test_a_very_long_line_is_shown_around_its_column(column: int, full_of: Callable[..., list[str]]) -> None:
    source = "".join(chr(ord("a") + number % 26) for number in range(100_000))
    _, _, line, caret, *_ = full_of(source, column)
    assert len(line) <= 100
    at = caret.index("^")
    assert line[at : at + 3] == source[column - 1 : column + 2][: len(line) - at]
    assert line.removeprefix("12 | ").strip(".") in source
    assert line.startswith("12 | ...") == (column > 40)
    assert line.endswith("...") == (column < 99_000)


def marked_line(full_of: Callable[..., list[str]], source: str, column: int, end: int) -> tuple[str, str]:
    _, _, line, caret, *_ = full_of(source, column, end)
    return line.removeprefix("12 | "), caret.removeprefix("   | ")


def test_a_line_is_cut_where_it_is_wider_than_the_page(full_of: Callable[..., list[str]]) -> None:
    # 95 columns are left of 100, less three on each side where something is cut.
    whole, rule = "a" * 94, " unknown-key"
    assert marked_line(full_of, f"{whole}b", 1, 2) == (f"{whole}b", f"^{rule}")
    assert marked_line(full_of, f"{whole}bc", 1, 2) == (f"{'a' * 89}...", f"^{rule}")
    # The name of the rule takes 12.
    assert marked_line(full_of, f"{whole}b", 83, 84) == (f"{whole}b", f"{' ' * 82}^{rule}")
    assert marked_line(full_of, f"{whole}b", 84, 85) == (f"{whole}b", f"{' ' * 83}^")
    # The mark is shown first, and where it fills the line alone, without the name of the rule.
    long = f"key = {'x' * 88} end"
    assert marked_line(full_of, long, 7, 95) == (f"... {'x' * 88}...", f"    {'^' * 88}")
    assert marked_line(full_of, f"key = {'x' * 200} end", 7, 207) == (f"...{'x' * 89}...", f"   {'^' * 89}")
    # Half of what is left is for what stands behind it.
    shown, under = marked_line(full_of, f"{'b' * 100}xxx{'c' * 100}", 101, 104)
    assert shown == f"...{'b' * 43}xxx{'c' * 43}..."
    assert under == f"{' ' * 46}^^^{rule}"


LONG = "the cycle needs 348.5 us of 250.0 us, corrected margin -98.5 +/- 6.3 us, " * 3


@pytest.mark.parametrize("width", [40, 60, 80, 100, 300])
def test_full_keeps_to_the_width_and_breaks_no_figure(width: int, warned: Answer) -> None:
    finding = finding_at(warned, 12, 1, 2, words=LONG, help=LONG)
    found = report(warned, finding, source="nodes = 2  # " + "x" * 200)
    shown = without_colours(render(found, file_format="full", width=width)).splitlines()
    assert max(map(len, shown)) <= min(width, 100)
    assert shown[0].startswith("a.toml:12:1: BP002 error: the")
    assert not any(
        re.search(r"[0-9]$", line) or re.match(r" +(us|\+/-)", line) for line in shown[:-5] if "|" not in line
    )
    if width == 100:
        assert shown == render(found, file_format="full").splitlines()


def test_a_sentence_breaks_between_words_alone(warned: Answer) -> None:
    words = f"{'a' * 60} closed-form-of-the-paper {'b' * 120} end"
    shown = render(report(warned, finding_at(warned, 12, 1, 2, words=words)), file_format="full").splitlines()
    assert shown[:3] == [
        f"a.toml:12:1: BP002 error: {'a' * 60}",
        "    closed-form-of-the-paper",
        f"    {'b' * 120}",
    ]


def without_colours(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;]*m", "", text)


def test_a_terminal_has_severities_in_colour_and_in_words(mixed: Answer, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NO_COLOR", "COLORTERM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    for name in ("concise", "full"):
        coloured = render(mixed, file_format=name, width=100)
        assert without_colours(coloured) == render(mixed, file_format=name)
        assert "\x1b[33mBP110 warning\x1b[0m" in coloured
        assert "\x1b[1;31mBP101 error\x1b[0m" in coloured
        assert "\x1b[1mp/fails.toml:7:1: \x1b[0m" in coloured
    assert "\x1b[33m^^ gap-count-wasteful\x1b[0m" in render(mixed, file_format="full", width=100)
    monkeypatch.setenv("NO_COLOR", "1")
    for name in ("concise", "full"):
        assert not re.search(r"\x1b\[(?:1;)?3", render(mixed, file_format=name, width=100))


# Markdown


def test_markdown_has_a_verdict_for_each_profile(mixed: Answer) -> None:
    lines = render(mixed, file_format="markdown").splitlines()
    assert lines[:8] == [
        "### Check of profiles",
        "",
        "checked 3 profiles\\: 2 errors, 1 warning; 1 could not be checked",
        "",
        "| profile | result | verdict | corrected margin, us |",
        "| :--- | :--- | :--- | ---: |",
        "| `p/clean.toml` | passes | fits | 1806.3 +/- 11.4 |",
        "| `p/fails.toml` | **1 error, 1 warning** | does not fit | -109.8 +/- 4.3 |",
    ]
    assert lines[8] == "| `p/broken.toml` | **1 error** | - | - |"
    assert lines[9].startswith("| `gone.toml` | **could not be checked**: ./gone.toml\\: no such file, and ")
    assert lines[9].endswith(" | - | - |")
    assert lines[11] == "| place | rule | severity | problem | remedy |"
    assert lines[13].startswith("| `p/fails.toml:7:1` | BP110 gap-count-wasteful | warning | bus.gap\\_count\\: ")
    assert lines[13].endswith(" |  |")
    assert lines[14].endswith(" | `cycle.slice_ratio = 0.69`<br>`bus.gap_count = 7` |")


# GitHub


def github_command(line: str) -> tuple[str, dict[str, str], str]:
    """Read a workflow command as the runner does."""
    match = re.fullmatch(r"::(\w+) ([^:]*)::(.*)", line)
    assert match is not None, line

    def plain(text: str, *escapes: tuple[str, str]) -> str:
        for escaped, character in (("%0D", "\r"), ("%0A", "\n"), *escapes, ("%25", "%")):
            text = text.replace(escaped, character)
        return text

    properties = dict(one.split("=", 1) for one in match[2].split(","))
    escapes = (("%3A", ":"), ("%2C", ","))
    return match[1], {key: plain(value, *escapes) for key, value in properties.items()}, plain(match[3])


def test_github_commands_say_file_line_and_message(mixed: Answer) -> None:
    commands = [github_command(line) for line in render(mixed, file_format="github").splitlines()]
    assert [(level, one["file"], one["line"], one["col"]) for level, one, _ in commands] == [
        ("warning", "p/fails.toml", "7", "1"),
        ("error", "p/fails.toml", "12", "1"),
        ("error", "p/broken.toml", "1", "4"),
    ]
    assert commands[0][1]["title"] == "BP110 gap-count-wasteful"
    assert commands[0][2] == mixed.files[1].findings[0].message


def test_github_has_paths_from_the_root_of_the_working_tree(tmp_path: Path) -> None:
    (tmp_path / "tree" / ".git").mkdir(parents=True)
    for folder, said in (("tree/deep", "deep/p.toml"), ("beside", "p.toml")):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "p.toml").write_text(FAILS, encoding="utf-8")
        with chdir(tmp_path / folder):
            lines = render(busplan.check("p.toml"), file_format="github").splitlines()
        assert lines
        assert {github_command(line)[1]["file"] for line in lines} == {said}


@pytest.mark.parametrize("name", ["100% of, it: a\r\nb.toml", "::error::a.toml", "%0A.toml", "a,line=9.toml"])
def test_github_reads_hostile_names_as_they_are(name: str, warned: Answer) -> None:
    finding = finding_at(warned, 3, 4, 5, words=f"{name}: unknown")
    text = render(report(warned, finding, path=name), file_format="github")
    assert text.count("\n") == 1
    level, properties, message = github_command(text.removesuffix("\n"))
    assert level == "error"
    assert properties == {"file": name, "line": "3", "col": "4", "title": "BP002 unknown-key"}
    assert message == f"{name}: unknown"


# GitLab


def test_gitlab_issues_have_what_its_report_needs(mixed: Answer) -> None:
    issues = json.loads(render(mixed, file_format="gitlab"))
    assert [(one["check_name"], one["severity"], one["location"]) for one in issues] == [
        ("gap-count-wasteful", "minor", {"path": "p/fails.toml", "lines": {"begin": 7}}),
        ("slice-overrun", "major", {"path": "p/fails.toml", "lines": {"begin": 12}}),
        ("syntax", "major", {"path": "p/broken.toml", "lines": {"begin": 1}}),
    ]
    assert all(set(one) == {"description", "check_name", "fingerprint", "severity", "location"} for one in issues)
    assert issues[1]["description"].startswith("BP101 cycle.period_us: ")


def test_gitlab_fingerprints_are_unique(hostile: Answer) -> None:
    issues = json.loads(render(hostile, file_format="gitlab"))
    assert len({one["fingerprint"] for one in issues}) == len(issues) == 2 * len(HOSTILE)


# JUnit


def test_junit_has_one_case_a_profile_also_when_clean(mixed: Answer) -> None:
    text = render(mixed, file_format="junit")
    assert text.startswith("<?xml version='1.0' encoding='utf-8'?>\n<testsuites ")
    root = ET.fromstring(text)
    assert (root.tag, root.attrib["name"]) == ("testsuites", "busplan check")
    (suite,) = root
    assert (suite.tag, suite.attrib) == ("testsuite", root.attrib)
    assert {key: suite.attrib[key] for key in ("tests", "failures", "errors")} == {
        "tests": "4", "failures": "2", "errors": "1",
    }  # fmt: skip
    cases = suite.findall("testcase")
    assert [case.attrib["name"] for case in cases] == ["p/clean.toml", "p/fails.toml", "p/broken.toml", "gone.toml"]
    assert [[one.tag for one in case] for case in cases] == [[], ["failure", "system-out"], ["failure"], ["error"]]
    assert [(case.attrib["classname"], case.attrib["file"]) for case in cases] == [
        ("busplan.check", case.attrib["name"]) for case in cases
    ]
    assert [one.attrib for one in cases[1].findall("system-out")] == [{}]
    failure = cases[1].find("failure")
    assert failure is not None
    assert failure.attrib["type"] == "BP101"
    assert failure.attrib["message"].startswith("cycle.period_us: the cycle needs")
    assert (failure.text or "").startswith("p/fails.toml:12:1: BP101 ")
    assert (cases[1].findtext("system-out") or "").startswith("p/fails.toml:7:1: BP110 ")


# SARIF


def sarif(found: Answer) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(render(found, file_format="sarif"))
    SarifLog.model_validate(document)
    return document


def test_sarif_is_valid_by_the_published_schema(mixed: Answer, hostile: Answer) -> None:
    document = sarif(mixed)
    assert (document["version"], document["$schema"]) == ("2.1.0", "https://json.schemastore.org/sarif-2.1.0.json")
    sarif(hostile)


def test_sarif_results_point_to_their_rules(mixed: Answer) -> None:
    (run,) = sarif(mixed)["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == sorted(folder.name for folder in EXAMPLES.iterdir())
    assert len({rule["name"] for rule in rules}) == len(rules)
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
        assert result["level"] == rules[result["ruleIndex"]]["defaultConfiguration"]["level"]
    (invocation,) = run["invocations"]
    assert invocation["executionSuccessful"] is False
    (told,) = invocation["toolExecutionNotifications"]
    assert (told["level"], told["message"]["text"][:26]) == ("error", "./gone.toml: no such file,")
    region = run["results"][0]["locations"][0]["physicalLocation"]["region"]
    assert region == {"startLine": 7, "startColumn": 1, "endColumn": 15}
    assert [result.get("properties") for result in run["results"]] == [
        None,
        {"cure": "cycle.slice_ratio = 0.69\nbus.gap_count = 7"},
        None,
    ]
    page = rules[run["results"][0]["ruleIndex"]]["help"]
    assert page["text"].startswith("BP110 gap-count-wasteful (warning): ")
    assert page["markdown"].startswith("### `BP110` gap-count-wasteful\n")
    assert "ignore[BP110] reason" in page["text"]
    assert "ignore[BP110] reason" in page["markdown"]
    assert run["columnKind"] == "unicodeCodePoints"


def artifact(answer: Answer, name: str) -> dict[str, str]:
    (result,) = sarif(renamed(answer, name))["runs"][0]["results"]
    found: dict[str, str] = result["locations"][0]["physicalLocation"]["artifactLocation"]
    return found


@pytest.mark.parametrize(
    ("name", "uri"),
    [
        ("p/a.toml", "p/a.toml"),
        ("a b/ü.toml", "a%20b/%C3%BC.toml"),
        ("100%.toml", "100%25.toml"),
        ("a:b.toml", "a%3Ab.toml"),
        ("#?.toml", "%23%3F.toml"),
        ("\udcff.toml", "%FF.toml"),
        ("<stdin>", "%3Cstdin%3E"),
    ],
)
def test_sarif_paths_below_the_working_folder_are_relative(name: str, uri: str, warned: Answer) -> None:
    assert artifact(warned, name) == {"uri": uri, "uriBaseId": "%SRCROOT%"}
    parts = urlsplit(uri)
    assert (parts.scheme, parts.netloc, parts.query, parts.fragment) == ("", "", "", "")
    assert unquote_to_bytes(uri) == os.fsencode(name)


def test_sarif_paths_elsewhere_are_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, warned: Answer) -> None:
    here = tmp_path.resolve() / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert artifact(warned, "../a b.toml") == {"uri": f"{here.parent.as_uri()}/a%20b.toml"}
    assert artifact(warned, "/etc/ü.toml") == {"uri": "file:///etc/%C3%BC.toml"}


def test_sarif_fingerprints_stay_when_lines_are_inserted_above(checked: Check) -> None:
    def prints(text: str) -> list[str]:
        results = sarif(checked({"a.toml": text}))["runs"][0]["results"]
        return [one["partialFingerprints"]["busplanFinding/v1"] for one in results]

    before = prints(FAILS)
    assert len(set(before)) == len(before) == 2
    assert prints("# one\n\n" + FAILS.replace("[cycle]", "# two\n[cycle]")) == before
    assert prints(FAILS.replace("[bus]", "[limits]\nmin_spare_axes = 99\n[bus]"))[1:] == before


# The profile's own schema


@pytest.fixture(scope="session")
def schema(run: Callable[..., Any]) -> dict[str, Any]:
    schema: dict[str, Any] = json.loads(run("schema").stdout)
    return schema


@pytest.fixture(scope="session")
def validator(schema: dict[str, Any]) -> Any:
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_the_profile_schema_accepts_what_is_shipped_and_what_only_the_gate_finds(validator: Any) -> None:
    examples = [path for path in EXAMPLES.glob("*/invalid*.toml") if not path.parent.name.startswith("BP0")]
    for path in (*(ROOT / "profiles").glob("*.toml"), *examples):
        validator.validate(tomllib.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("code", ["BP002", "BP003", "BP004", "BP005"])
def test_the_profile_schema_refuses_what_has_another_shape(validator: Any, code: str) -> None:
    for path in (EXAMPLES / code).glob("invalid*.toml"):
        with pytest.raises(jsonschema.ValidationError):
            validator.validate(tomllib.loads(path.read_text(encoding="utf-8")))


def test_every_key_of_the_profile_schema_is_described_with_its_unit(schema: dict[str, Any]) -> None:
    units = {
        "per_byte_us": "[us/byte]", "um_per_m": "[um/m]", "mm_per_min": "[mm/min]", "per_s2": "[1/s^2]",
        "per_s": "[1/s]", "frames_s": "[frames/s]", "mm_s": "[mm/s]", "us": "[us]", "mm": "[mm]", "bytes": "[bytes]",
        "deg": "[deg]", "db": "[dB]", "m": "[m]", "ppm": "[um/m]", "bits": "[bits]", "kbit_s": "[kbit/s]",
        "mbit_s": "[Mbit/s]", "s": "[s]",
    }  # fmt: skip
    # A grade has the name of the value that it grades, and no unit.
    sections = [schema, *(section for name, section in schema["$defs"].items() if name != "ServoGrades")]
    keys = [(name, key) for section in sections for name, key in section.get("properties", {}).items()]
    assert len(keys) > 60
    for name, key in keys:
        assert key.get("description"), name
        unit = next((unit for ending, unit in units.items() if f"_{name}".endswith(f"_{ending}")), "")
        assert unit in key["description"], name


def test_several_findings_of_one_file_are_lines_of_one_case(warned: Answer) -> None:
    found = [finding_at(warned, line, 1, 2, words=f"m{line}") for line in (1, 2)]
    (case,) = ET.fromstring(render(report(warned, *found), file_format="junit"))[0]
    assert (case.findtext("failure") or "").splitlines() == [
        "a.toml:1:1: BP002 error: m1", "a.toml:2:1: BP002 error: m2",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("margin_us", "uncertainty_us", "words"), [(1.04, 2.5, "1.0 +/- 2.5"), (-20.0, None, "-20.0"), (None, None, "-")]
)
def test_markdown_says_a_margin_as_far_as_it_is_known(
    margin_us: float | None, uncertainty_us: float | None, words: str, warned: Answer
) -> None:
    fit = warned.files[0].fit._replace(margin_corrected_us=margin_us, uncertainty_us=uncertainty_us)
    row = render(report(warned, fit=fit), file_format="markdown").splitlines()[-1]
    assert row == f"| `a.toml` | passes | fits | {words} |"
