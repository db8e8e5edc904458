"""Every rule has a valid and an invalid profile in `examples/CODE/`, and says of them what it should.

An invalid one begins with `# expect: LINE:COLUMN ...`: each finding's place, and every one is of the folder's rule. A
valid one has no findings at all. `baseline.json`, `recording.log` or a log of its own name, where there is one, is what
a profile beside it is held against.
"""

import json
import re
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import busplan

Check = Callable[..., Any]
Rules = Mapping[str, Mapping[str, str]]

EXAMPLES = Path(__file__).parent / "examples"
MESSAGES = Path(__file__).parent / "messages.txt"
INVALID = sorted(EXAMPLES.glob("*/invalid*.toml"))
VALID = sorted(EXAMPLES.glob("*/valid*.toml"))
CURED = ("BP101", "BP103", "BP104", "BP105", "BP109", "BP114", "BP115", "BP121", "BP141", "BP151")
"""Rules that say the cheapest cure."""
EXPECT = re.compile(rb"# expect: ((?:\d+:\d+ ?)+)")


def name_of(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


@cache
def checked(path: Path) -> Any:
    record = path.parent / "baseline.json"
    log = next((log for log in (path.with_suffix(".log"), path.parent / "recording.log") if log.exists()), None)
    baseline = record if record.exists() else None
    (file,) = busplan.check(path, record=True, baseline=baseline, pass_on_unmatched=True, recording=log).files
    return file


@pytest.fixture(scope="session")
def rules(run: Callable[..., Any]) -> Rules:
    """Every rule by its code."""
    return {rule["code"]: rule for rule in json.loads(run("rule", "--format", "json").stdout)["rules"]}


def test_an_invalid_example_triggers_its_rule_alone_and_in_place(rules: Rules) -> None:
    for path in INVALID:
        match = EXPECT.match(path.read_bytes())
        assert match is not None, f"{path} does not say what to expect"
        result = checked(path)
        assert [f"{one.line}:{one.column}" for one in result.findings] == match[1].decode().split()
        rule = rules[path.parent.name]
        assert {(one.code, one.rule, one.severity) for one in result.findings} == {
            (rule["code"], rule["rule"], rule["severity"])
        }


def messages() -> str:
    """What is said of every invalid example, a line for each finding."""
    return "".join(
        f"{path.parent.name}/{path.name}:{finding.line}:{finding.column}: "
        f"{finding.code} {finding.severity}: {finding.message}\n"
        for path in INVALID
        for finding in checked(path).findings
    )


def test_the_words_of_every_rule_are_those_that_were_read_and_found_good() -> None:
    """After a change of words: `python -m tests.gate.test_examples`, and read the difference."""
    assert messages().splitlines() == MESSAGES.read_text(encoding="utf-8").splitlines()


def test_a_valid_example_triggers_nothing() -> None:
    for path in VALID:
        result = checked(path)
        assert (result.findings, result.status, result.profile) == ((), "ok", "example")


def test_every_rule_has_both_and_none_that_is_gone_has_any(rules: Rules) -> None:
    assert {path.parent.name for path in EXAMPLES.glob("*/valid.toml")} == set(rules)
    assert {path.parent.name for path in EXAMPLES.glob("*/invalid.toml")} == set(rules)
    assert {folder.name for folder in EXAMPLES.iterdir()} == set(rules)


def test_every_rule_is_explained(rules: Rules) -> None:
    for rule in rules.values():
        assert rule["summary"].strip()
        assert len(rule["explanation"]) > 40
        assert rule["severity"] in ("error", "warning")


def test_codes_are_stable(rules: Rules) -> None:
    # A code that is dropped is never used again, and one that is added joins this list.
    assert {code: rule["rule"] for code, rule in rules.items()} == {
        "BP001": "syntax",
        "BP002": "unknown-key",
        "BP003": "missing-key",
        "BP004": "wrong-type",
        "BP005": "out-of-range",
        "BP006": "inconsistent",
        "BP007": "execution-extrapolated",
        "BP101": "slice-overrun",
        "BP102": "other-model-overrun",
        "BP103": "utilisation-over-limit",
        "BP104": "too-few-spare-nodes",
        "BP105": "too-few-spare-axes",
        "BP106": "too-many-nodes",
        "BP107": "too-many-hops",
        "BP108": "payload-over-limit",
        "BP109": "gap-count-unsafe",
        "BP110": "gap-count-wasteful",
        "BP111": "payload-not-quadlets",
        "BP112": "assumed-key",
        "BP113": "fits-only-until-bus-reset",
        "BP114": "not-shown-to-fit",
        "BP115": "node-too-slow",
        "BP121": "bus-load-over-limit",
        "BP122": "identifiers-collide",
        "BP123": "deadline-missed",
        "BP131": "no-common-clock",
        "BP132": "command-behind-sync",
        "BP141": "sercos3-unknown-period",
        "BP151": "sercos2-unknown-period",
        "BP201": "circle-tolerance",
        "BP202": "no-stability-margin",
        "BP203": "circle-impossible",
        "BP204": "circle-too-long",
        "BP301": "baseline-regression",
        "BP401": "machine-outside-plan",
        "BP402": "not-shown-by-recording",
        "BP403": "recording-shows-nothing",
        "BP901": "suppression-without-reason",
        "BP902": "suppression-without-effect",
    }


def test_a_finding_says_the_value_the_limit_and_the_cheapest_cure() -> None:
    for code, words in [
        # Two nodes at gap count 7 need 177.992 us and 205.094 us to be safe: bias 8 (0.827 + 1.139), U 11.372 us.
        (
            "BP101",
            ["178.0 us of 150.0 us", "margin -43.7 +/- 11.4 us", "cheapest cure: cycle.slice_ratio = 0.69"],
        ),
        # At S100 the paper counts gaps as fast as the standard, and more of them: 329.254 us against 279.975 us.
        ("BP102", ["cycle.period_us: the paper's equations say that it does not fit; the verdict is: fits"]),
        # 177.992 us of 2000 us; 177.992 us / 0.05 / 4000 us is 0.88996.
        ("BP103", ["8.9%", "5.0% allowed", "cheapest cure: cycle.slice_ratio = 0.89"]),
        # 14 nodes need 1911.497 us to be safe, 15 need 2097.465 us: 0.524366 of 4000 us.
        ("BP104", ["room for 12 more is shown", "13 required", "cheapest cure: cycle.slice_ratio = 0.53"]),
        ("BP105", ["room for 48 more is shown", "49 required", "cheapest cure: cycle.slice_ratio = 0.53"]),
        ("BP106", ["63 nodes", "62 of one bus", "second bus"]),
        ("BP107", ["17 hops", "16 of one bus", "bus.max_hops = 16"]),
        ("BP108", ["516 bytes", "512 bytes", 'use bus.speed = "S200"']),
        ("BP109", ["gap count 4", "3 hops", "smallest safe one is 8", "cheapest cure: bus.gap_count = 8"]),
        # 253.187 us less 177.992 us; 13 nodes are safe at gap count 63, and 14 at that of their hops.
        ("BP110", ["gap count 63", "7 that 2 hops need", "75.2 us", "wins 1 node"]),
        ("BP111", ["13 bytes", "16 bytes travel", "set the payload to 16"]),
        ("BP112", ["assumption", "measure it"]),
        # 253.187 us and a bias of 8 * 0.827 us, U 4.306 us.
        ("BP113", ["fits at 7", "does not fit at 63 after a bus reset", "-9.8 +/- 4.3 us", "bus manager"]),
        # 269.053 us and the same bias and U at S100 with cables of 10 m; 279.975 us / 550 us is 0.50905.
        ("BP114", ["not shown to fit", "269.1 us of 275.0 us", "-0.7 +/- 4.3 us", "cycle.slice_ratio = 0.51"]),
        ("BP201", ["20.012 um", "1 um", "attack velocity_feedforward first"]),
        ("BP202", ["unstable", "lower servo.position_gain_per_s"]),
        ("BP203", ["feed_mm_per_min", "the feed must stay below it"]),
        ("BP301", ["bus.nodes: 3, was 2: corrected margin fell from 1806.3 to 1704.4 us"]),
    ]:
        finding = checked(EXAMPLES / code / "invalid.toml").findings[0]
        assert finding.message.startswith(f"{finding.key}: ")
        for word in words:
            assert word in finding.message


SPLIT = ("BP007", "BP203")
"""Rules whose problem may be longer than a line: it says a range and two ways out, or two values of the profile."""


def test_a_problem_fits_a_line_and_its_parts_are_the_message() -> None:
    for path in INVALID:
        for one in checked(path).findings:
            cure = f"cheapest cure: {one.cure.replace(chr(10), ', ')}" if one.cure else None
            assert one.message == "; ".join(filter(None, (one.problem, one.help, cure)))
            assert len(one.problem) <= 100 or one.code in (*SPLIT, "BP301")
            assert not re.search(r"\d\.\d{3,} us", one.message)
            for line in (one.cure or "").splitlines():
                assert len(tomllib.loads(line)) == 1


@pytest.mark.parametrize("path", [path for path in INVALID if path.parent.name in CURED], ids=name_of)
def test_the_cheapest_cure_cures(path: Path, check: Check) -> None:
    text = path.read_text(encoding="utf-8")
    cure = checked(path).findings[0].cure
    assert cure is not None
    key, value = cure.split(" = ")
    section, name = key.split(".")
    said = re.sub(rf"^{name} = .*\n", "", text, flags=re.MULTILINE)
    cured = said.replace(f"[{section}]\n", f"[{section}]\n{name} = {value}\n")
    found = check(cured).findings
    # It is a cure by the standard and for the gap count of the profile; what else is said of it are warnings.
    assert {one.code for one in found} <= {"BP102", "BP113"}


def test_a_reserve_is_named_where_it_is_what_is_missing() -> None:
    # 279.975 us are safe and 310 us are given, of which 14 % must stay free: 43.4 us.
    (finding,) = checked(EXAMPLES / "BP114" / "invalid-reserve.toml").findings
    assert "corrected margin 34.3 +/- 4.3 us, limits.reserve asks for 43.4 us" in finding.message
    assert finding.message.endswith("cheapest cure: cycle.slice_ratio = 0.53")  # 279.975 / 0.86 / 620


def test_the_paper_alone_is_no_reason_to_build(check: Check) -> None:
    (finding,) = checked(EXAMPLES / "BP102" / "invalid-paper-fits.toml").findings
    assert finding.message == "cycle.period_us: the paper's equations say that it fits; the verdict is: does not fit"
    # Without the comment the verdict itself is there, too.
    text = (EXAMPLES / "BP102" / "invalid-paper-fits.toml").read_text(encoding="utf-8")
    found = check(text.partition("  # busplan")[0] + text[text.index("\n\n[payload]") :])
    assert {one.code for one in found.findings} == {"BP101", "BP102"}


def test_the_record_is_one_that_the_program_writes() -> None:
    record = (EXAMPLES / "BP301" / "baseline.json").read_text(encoding="utf-8")
    document = json.loads(record)
    # Worked out by hand; the last digits are the machine's.
    assert document["profiles"]["valid.toml"] == pytest.approx(checked(EXAMPLES / "BP301" / "valid.toml").figures)


def test_a_plan_that_lacks_its_reserve_alone_contradicts_no_equation(check: Check) -> None:
    # At S400 the paper says that it fits, and only the reserve keeps the verdict from saying so.
    text = (EXAMPLES / "BP114" / "invalid-reserve.toml").read_text(encoding="utf-8")
    text = text.replace('"S100"', '"S400"').replace("cable_length_m = 10\n", "")
    found = check(text)
    assert "BP102" not in {one.code for one in found.findings}


def test_a_check_runs_a_circle_of_so_many_steps_and_none_longer(check: Check) -> None:
    # 2 pi r at 100 mm/s is 1 s: 1,000 periods of 1 ms, or with the larger radius one period more.
    text = (EXAMPLES / "BP204" / "valid.toml").read_text(encoding="utf-8").partition("[servo]")[0]
    text = text.replace("period_us = 4000", "period_us = 1000") + (
        "[servo]\nposition_gain_per_s = 50\nstep_us = 100\n"
        "[circle]\nradius_mm = 15.915\nfeed_mm_per_min = 6000\nramp_periods = 0\n"
    )

    def not_run(text: str, **options: int) -> list[str]:
        found = check(text, **options)
        return [one.message for one in found.findings if one.code == "BP204"]

    assert not_run(text, circle_steps=10_000) == []
    assert [
        "was not run: 10,000 steps, over the limit of 9,999" in one for one in not_run(text, circle_steps=9_999)
    ] == [True]
    # Of itself it runs ten million.
    long = text.replace("15.915", "15.92").replace("step_us = 100", "step_us = 0.1")
    assert ["was not run: 10,010,000 steps, over the limit of 10,000,000" in one for one in not_run(long)] == [True]


if __name__ == "__main__":
    MESSAGES.write_text(messages(), encoding="utf-8")
