"""Every rule has a valid and an invalid profile in `examples/CODE/`, and says of them what it should.

An invalid one begins with `# expect: LINE:COLUMN ...`: each finding's place, and every one is of the folder's rule. A
valid one has no findings at all. `baseline.json`, where there is one, is what the profiles beside it are held against.
"""

import json
import re
from pathlib import Path

import pytest

from busplan.errors import PlacedError
from busplan.profile.toml import decode
from busplan.rules.baseline import read_baseline
from busplan.rules.gate import FileResult, check_document, unreadable
from busplan.rules.registry import all_rules

EXAMPLES = Path(__file__).parent / "examples"
INVALID = sorted(EXAMPLES.glob("*/invalid*.toml"))
VALID = sorted(EXAMPLES.glob("*/valid*.toml"))
EXPECT = re.compile(rb"# expect: ((?:\d+:\d+ ?)+)")


def name_of(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


def checked(path: Path) -> FileResult:
    record = path.parent / "baseline.json"
    recorded = read_baseline(record.read_text(encoding="utf-8"), name="baseline.json") if record.exists() else {}
    content = path.read_bytes()
    try:
        return check_document(decode(content, name=path.name), baseline=recorded.get(path.name))
    except PlacedError as error:
        return unreadable(path.name, error, content)


@pytest.mark.parametrize("path", INVALID, ids=name_of)
def test_an_invalid_example_triggers_its_rule_alone_and_in_place(path: Path) -> None:
    match = EXPECT.match(path.read_bytes())
    assert match is not None, f"{path} does not say what to expect"
    result = checked(path)
    assert [f"{one.line}:{one.column}" for one in result.findings] == match[1].decode().split()
    rule = all_rules()[path.parent.name]
    assert {(one.code, one.rule, one.severity) for one in result.findings} == {(rule.code, rule.name, rule.severity)}


@pytest.mark.parametrize("path", VALID, ids=name_of)
def test_a_valid_example_triggers_nothing(path: Path) -> None:
    result = checked(path)
    assert (result.findings, result.status, result.profile) == ((), "ok", "example")


@pytest.mark.parametrize("code", all_rules())
def test_every_rule_has_both(code: str) -> None:
    assert (EXAMPLES / code / "valid.toml").is_file()
    assert (EXAMPLES / code / "invalid.toml").is_file()


def test_there_are_no_examples_of_rules_that_are_gone() -> None:
    assert {folder.name for folder in EXAMPLES.iterdir()} == set(all_rules())


def test_codes_and_names_are_unique_and_every_rule_is_explained() -> None:
    assert all(re.fullmatch(r"BP[0-9]{3}", code) and rule.code == code for code, rule in all_rules().items())
    assert len({rule.name for rule in all_rules().values()}) == len(all_rules())
    for rule in all_rules().values():
        assert rule.summary.strip()
        assert len(rule.explanation) > 40
        assert rule.severity in ("error", "warning")


def test_codes_are_stable() -> None:
    # A code that is dropped is never used again, and one that is added joins this list.
    assert {code: rule.name for code, rule in all_rules().items()} == {
        "BP001": "syntax",
        "BP002": "unknown-key",
        "BP003": "missing-key",
        "BP004": "wrong-type",
        "BP005": "out-of-range",
        "BP006": "inconsistent",
        "BP007": "execution-extrapolated",
        "BP101": "slice-overrun",
        "BP102": "other-model-overrun",
        "BP103": "over-utilisation",
        "BP104": "too-few-spare-nodes",
        "BP105": "too-few-spare-axes",
        "BP106": "too-many-nodes",
        "BP107": "too-many-hops",
        "BP108": "payload-over-limit",
        "BP109": "gap-count-unsafe",
        "BP110": "gap-count-wasteful",
        "BP111": "payload-not-quadlets",
        "BP112": "execution-unmeasured",
        "BP201": "circle-tolerance",
        "BP202": "no-stability-margin",
        "BP203": "circle-impossible",
        "BP301": "baseline-regression",
        "BP901": "suppression-without-reason",
        "BP902": "suppression-without-effect",
    }


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("BP101", ["183.862 us", "150.000 us", "33.862 us too much", "cheapest cure: cycle.slice_ratio = 0.6129"]),
        ("BP102", ["fits the paper's timing, not the standard's", "175.000 us", "cheapest cure: "]),
        ("BP103", ["9.2%", "5.0% allowed", "cheapest cure: cycle.period_us = 7355"]),
        ("BP104", ["11 to spare", "12 asked for", "cheapest cure: cycle.slice_ratio = 0.5245"]),
        ("BP105", ["44 to spare", "45 asked for", "cheapest cure: cycle.slice_ratio = 0.5245"]),
        ("BP106", ["63 nodes", "62 of one bus", "second bus"]),
        ("BP107", ["17 hops", "16 of one bus", "bus.max_hops = 16"]),
        ("BP108", ["516 bytes", "512 bytes", 'cheapest cure: bus.speed = "S200"']),
        ("BP109", ["gap count 4", "3 hops", "smallest safe one is 8"]),
        ("BP110", ["gap count 63", "7 that 2 hops need", "127.604 us", "win 2 nodes"]),
        ("BP111", ["13 bytes", "16 bytes travel", "say 16"]),
        ("BP112", ["assumption", "measure it"]),
        ("BP201", ["20.012 um", "1 um", "attack velocity_feedforward first"]),
        ("BP202", ["unstable", "lower servo.position_gain_per_s"]),
        ("BP203", ["feed_mm_per_min", "choose at most"]),
        ("BP301", ["margin_us", "1749.51112695", "1834.91690495 of the baseline"]),
    ],
)
def test_a_finding_says_the_value_the_limit_and_the_cheapest_cure(code: str, words: list[str]) -> None:
    finding = checked(EXAMPLES / code / "invalid.toml").findings[0]
    assert finding.message.startswith(f"{finding.key}: ")
    for word in words:
        assert word in finding.message


@pytest.mark.parametrize("code", ["BP101", "BP102", "BP103", "BP104", "BP105"])
def test_the_cheapest_cure_cures(code: str) -> None:
    text = (EXAMPLES / code / "invalid.toml").read_text(encoding="utf-8")
    message = checked(EXAMPLES / code / "invalid.toml").findings[0].message
    key, value = message.rpartition("cheapest cure: ")[2].split(" = ")
    section, name = key.split(".")
    said = re.sub(rf"^{name} = .*\n", "", text, flags=re.MULTILINE)
    cured = said.replace(f"[{section}]\n", f"[{section}]\n{name} = {value}\n")
    assert check_document(decode(cured.encode(), name="cured.toml")).findings == ()


def test_the_record_is_one_that_the_program_writes() -> None:
    record = (EXAMPLES / "BP301" / "baseline.json").read_text(encoding="utf-8")
    assert set(json.loads(record)["profiles"]["valid.toml"]) == set(checked(EXAMPLES / "BP301" / "valid.toml").figures)
