"""Rules that count, by options and settings; findings that the baseline knows; what is suppressed is counted."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic_sarif.model import StaticAnalysisResultsFormatSarifVersion210JsonSchema as Sarif

import busplan
from busplan import check as check_profiles
from busplan.gate.rules import NEVER_SUPPRESSED, all_rules
from busplan.gate.selection import Selection
from tests.gate.conftest import CLEAN

Busplan = Callable[..., Any]
FAILS = CLEAN.replace("period_us = 4000", "period_us = 300")
WARNS = CLEAN.replace('gap_count = "optimal"', "gap_count = 63")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "p" / "old").mkdir(parents=True)
    for name, text in (("p/clean", CLEAN), ("p/fails", FAILS), ("p/warns", WARNS), ("p/old/fails", FAILS)):
        assert text != CLEAN or name == "p/clean"
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    return tmp_path


def codes(text: str) -> list[str]:
    return re.findall(r"^\S+ (BP\d{3}) ", text, re.MULTILINE)


CODES = sorted(all_rules())
STARTS = st.lists(st.sampled_from([code[:length] for code in CODES for length in (3, 4, 5)]), max_size=3)


@given(STARTS, STARTS, st.sampled_from(CODES))
@example(["BP1"], ["BP1"], "BP110")
@example(["BP11"], ["BP1"], "BP110")
@example(["BP1"], ["BP11"], "BP110")
@example(["BP1", "BP110"], ["BP11"], "BP110")
@example(["BP11"], ["BP1", "BP110"], "BP110")
def test_the_longest_beginning_decides_and_ignore_in_a_tie(select: list[str], ignore: list[str], code: str) -> None:
    if code in NEVER_SUPPRESSED:
        expected = True
    else:
        best: dict[int, bool | None] = dict.fromkeys(range(6))
        for length in range(6):
            if code[:length] in select or (not select and not length):
                best[length] = True
            if code[:length] in ignore:
                best[length] = False
        expected = next((bool(best[length]) for length in range(5, -1, -1) if best[length] is not None), False)
    assert (not Selection(tuple(select), tuple(ignore)).reason(code, "a.toml")) is expected


def test_options_choose_rules_and_what_they_leave_out_is_counted(busplan: Busplan, folder: Path) -> None:
    every = busplan("check", "p", cwd=folder)
    assert set(codes(every.stdout)) >= {"BP101", "BP110"}
    for options, pattern in (
        (("--select", "BP110"), "BP110"),
        (("--ignore", "BP110"), "(?!BP110)"),
        (("--ignore", "BP1"), "(?!BP1)"),
        (("--select", "BP1", "--ignore", "BP110, BP112"), "BP1(?!10|12)"),
    ):
        run = busplan("check", "p", *options, cwd=folder)
        left = [code for code in codes(every.stdout) if re.match(pattern, code)]
        assert codes(run.stdout) == left
        lost = len(codes(every.stdout)) - len(left)
        assert f"{lost} finding{'s' if lost > 1 else ''} suppressed" in run.stderr
        assert run.returncode == (1 if "BP101" in left else 0)
    shown = busplan("check", "p", "--ignore", "BP101", "--show-suppressed", cwd=folder).stderr
    assert shown.count("(suppressed: ignored by BP101)") == 2


SETTINGS = 'ignore = ["BP110"]\nfail-on = "warning"\n[per-file-ignores]\n"p/old/*" = ["BP1"]\n'


@pytest.mark.parametrize("is_pyproject", [False, True])
def test_settings_are_those_of_the_nearest_file(busplan: Busplan, folder: Path, is_pyproject: bool) -> None:
    if is_pyproject:
        text = "[tool.other]\nx = 1\n[tool.busplan]\n" + SETTINGS.replace("[per", "[tool.busplan.per")
        (folder / "pyproject.toml").write_text(text, encoding="utf-8")
    else:
        (folder / "busplan.toml").write_text(SETTINGS, encoding="utf-8")
        (folder / "pyproject.toml").write_text('[tool.busplan]\nselect = ["BP9"]\n', encoding="utf-8")
    for cwd, path in ((folder, "p"), (folder / "p", ".")):
        run = busplan("check", path, cwd=cwd)
        assert run.returncode == 1
        assert "fails.toml" in run.stdout
        assert "old" not in run.stdout
        assert "BP110" not in run.stdout
    # The command line comes first, and a file that is nearer hides one further up.
    assert "BP110" in busplan("check", "p", "--ignore", "BP2", cwd=folder).stdout
    assert busplan("check", "p/clean.toml", "p/warns.toml", cwd=folder).returncode == 0
    (folder / "p" / "busplan.toml").write_text('fail-on = "error"\n', encoding="utf-8")
    assert "BP110" in busplan("check", "warns.toml", cwd=folder / "p").stdout
    # An empty file has settings, too: none.
    (folder / "p" / "busplan.toml").write_text("", encoding="utf-8")
    assert "BP110" in busplan("check", "warns.toml", cwd=folder / "p").stdout


def test_the_settings_are_never_taken_for_a_profile(busplan: Busplan, folder: Path) -> None:
    (folder / "p" / "busplan.toml").write_text("jobs = 1\n", encoding="utf-8")
    assert "checked 4 profiles" in busplan("check", "p", cwd=folder).stderr
    run = busplan("check", "p/busplan.toml", cwd=folder)
    assert (run.returncode, run.stderr.splitlines()[0]) == (
        2,
        "p/busplan.toml: has settings of `busplan check`, but no profile",
    )
    assert busplan("check", "p/busplan.toml", "p/clean.toml", "--skip-others", cwd=folder).returncode == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("ignor = []\n", "busplan.toml:1:1: ignor: unknown key; did you mean ignore?"),
        ('\nignore = ["BP9999"]\n', "busplan.toml:2:1: ignore: BP9999: no rule has a code that begins so"),
        ('ignore = "BP112"\n', "busplan.toml:1:1: ignore: expected a list of rule codes"),
        ('per-file-ignores = ["BP1"]\n', "expected lists of rule codes by pattern of the path"),
        ('[per-file-ignores]\n"a" = ["XX"]\n', "busplan.toml:1:2: per-file-ignores: XX: no rule"),
        ('fail-on = "info"\n', 'busplan.toml:1:1: fail-on: expected "error" or "warning"'),
        ("circle = 1\n", "busplan.toml:1:1: circle: expected true or false"),
        ('jobs = "2"\n', "busplan.toml:1:1: jobs: expected a whole number"),
        ("ignore = [\n", "busplan.toml:1:11: not valid TOML"),
        ('ignore = ["BP0"]\n', "BP001, BP002"),
    ],
)
def test_wrong_settings_are_told_by_their_place(busplan: Busplan, folder: Path, text: str, words: str) -> None:
    (folder / "busplan.toml").write_text(text, encoding="utf-8")
    run = busplan("check", "p", cwd=folder)
    assert run.returncode == 2
    assert words in run.stderr
    assert run.stdout == ""


def test_rules_that_do_not_exist_or_must_be_mended_are_refused(refused: Callable[..., str], folder: Path) -> None:
    assert "ignore BP992: no rule has a code that begins so" in refused("check", "p", "--ignore", "BP992", cwd=folder)
    words = refused("check", "p", "--ignore", "BP001", cwd=folder)
    assert words == "ignore BP001: BP001 cannot be ignored; correct what they find"


@pytest.mark.slow
def test_known_failures_block_no_commit_and_a_further_one_does(busplan: Busplan, tmp_path: Path) -> None:
    """Forty profiles, seven of which fail."""
    (tmp_path / "p").mkdir()
    for number in range(40):
        (tmp_path / "p" / f"{number:02}.toml").write_text(FAILS if number < 7 else CLEAN, encoding="utf-8")
    given = ("check", "p", "--baseline", "b.json")
    assert busplan("check", "p", cwd=tmp_path).returncode == 1
    recorded = busplan(*given, "--update-baseline", cwd=tmp_path)
    assert (recorded.returncode, recorded.stderr.splitlines()[0]) == (0, recorded.stderr.splitlines()[0])
    assert re.match(r"recorded 40 profiles with \d+ known findings in b.json", recorded.stderr)
    run = busplan(*given, cwd=tmp_path)
    assert (run.returncode, run.stdout) == (0, "")
    assert "findings suppressed" in run.stderr
    # Lines may move: a finding is known by its rule and its key.
    (tmp_path / "p" / "03.toml").write_text("\n\n" + FAILS, encoding="utf-8")
    assert busplan(*given, cwd=tmp_path).returncode == 0
    (tmp_path / "p" / "20.toml").write_text(FAILS, encoding="utf-8")
    run = busplan(*given, cwd=tmp_path)
    assert run.returncode == 1
    assert {line.partition(":")[0] for line in run.stdout.splitlines()} == {"p/20.toml"}
    # What gets worse is a loss all the same, and what is mended is told.
    (tmp_path / "p" / "20.toml").write_text(CLEAN, encoding="utf-8")
    (tmp_path / "p" / "03.toml").write_text(FAILS.replace("period_us = 300", "period_us = 200"), encoding="utf-8")
    assert codes(busplan(*given, cwd=tmp_path).stdout) == ["BP301"]
    (tmp_path / "p" / "03.toml").write_text(CLEAN, encoding="utf-8")
    run = busplan(*given, cwd=tmp_path)
    assert run.returncode == 0
    assert "mended since the baseline: BP101 cycle.period_us in p/03.toml; --update-baseline drops" in run.stderr


@pytest.mark.parametrize("known", ["[]", '{"p/clean.toml": "BP101"}', '{"p/clean.toml": [1]}'])
def test_a_damaged_list_of_known_findings_is_refused(refused: Callable[..., str], folder: Path, known: str) -> None:
    text = f'{{"schema": 1, "command": "baseline", "models": 2, "profiles": {{}}, "findings": {known}}}'
    (folder / "b.json").write_text(text, encoding="utf-8")
    assert "b.json: a damaged baseline" in refused("check", "p/clean.toml", "--baseline", "b.json", cwd=folder)


def test_sarif_has_what_is_suppressed_with_its_reason(busplan: Busplan, folder: Path) -> None:
    text = WARNS.replace("gap_count = 63", "gap_count = 63  # busplan: ignore[BP110] the drives know no other")
    (folder / "p" / "warns.toml").write_text(text, encoding="utf-8")
    busplan("check", "p/fails.toml", "--baseline", "b.json", "--update-baseline", cwd=folder)
    run = busplan(
        *("check", "p", "--baseline", "b.json", "--pass-on-unmatched", "--ignore", "BP111,BP112", "--format", "sarif"),
        cwd=folder,
    )
    document = json.loads(run.stdout)
    Sarif.model_validate(document)
    seen = {
        (result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"], result["ruleId"]): result.get(
            "suppressions"
        )
        for result in document["runs"][0]["results"]
    }
    assert seen["p/warns.toml", "BP110"] == [{"kind": "inSource", "justification": "the drives know no other"}]
    assert seen["p/fails.toml", "BP101"] == [{"kind": "external", "justification": "known in the baseline"}]
    assert seen["p/old/fails.toml", "BP101"] is None


def test_the_heaviest_assumption_of_each_file_is_told_and_the_others_are_counted(
    busplan: Busplan, tmp_path: Path
) -> None:
    for name in ("a", "b"):
        run = busplan("init", f"{name}.toml", "--nodes", "8", "--axes", "26", cwd=tmp_path)
        assert run.returncode == 0, run.stderr
    once, every, github = (
        busplan("check", ".", *more, cwd=tmp_path) for more in ((), ("--verbose",), ("--format", "github"))
    )
    assert [line[0] for line in once.stdout.splitlines() if "BP112" in line] == ["a", "b"]
    assert codes(every.stdout).count("BP112") == 4
    assert "2 similar findings not shown (--verbose)" in once.stderr
    assert "similar finding" not in every.stderr + github.stderr
    assert github.stderr.count("BP112") == github.stdout.count("BP112") == 4
    document = json.loads(busplan("check", ".", "--format", "json", cwd=tmp_path).stdout)
    assert sum(finding["code"] == "BP112" for file in document["files"] for finding in file["findings"]) == 4


def test_the_heaviest_is_told_wherever_it_stands(busplan: Busplan, tmp_path: Path) -> None:
    assert busplan("init", "a.toml", "--nodes", "8", "--axes", "26", cwd=tmp_path).returncode == 0
    answer = check_profiles(tmp_path / "a.toml", select=["BP112"])
    (file,) = answer.files
    first, second = file.findings
    assert first.weight == second.weight > 0.25
    for weights in ((0.3, 0.9), (0.9, 0.3)):
        pair = tuple(one._replace(weight=weight) for one, weight in zip((first, second), weights, strict=True))
        (told,) = answer._replace(files=(file._replace(findings=pair),)).told
        assert told.finding == max(pair, key=lambda one: one.weight)


def test_python_takes_the_same(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    answer = busplan.check("p", ignore=["BP101"], per_file_ignores={"warns.toml": ["BP110"]})
    assert answer.passed
    assert {each.by for file in answer.files for each in file.suppressed} == {"selection"}
    assert {each.reason for file in answer.files for each in file.suppressed} >= {"ignored for warns.toml"}
    with pytest.raises(busplan.BusplanError, match="select BP7: no rule has a code that begins so"):
        busplan.check("p", select=["BP7"])
