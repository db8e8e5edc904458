"""What callers may give, and what they are told of what they may not."""

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import busplan

SHIPPED = Path(__file__).parents[2] / "profiles" / "paper-4ms.toml"
TEXT = SHIPPED.read_text(encoding="utf-8")


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A profile of one's own in the working folder, with the name of a shipped one."""
    monkeypatch.chdir(tmp_path)
    path = Path("paper-4ms")
    path.write_text(TEXT.replace("nodes = 2", "nodes = 5"), encoding="utf-8")
    return path


def test_a_shipped_name_is_the_shipped_profile_and_a_path_the_file(own: Path) -> None:
    assert busplan.load_profile("paper-4ms") == busplan.load_profile(SHIPPED)
    for path in (own, own.absolute(), "./paper-4ms", str(own.absolute())):
        assert busplan.load_profile(path).bus.nodes == 5
        assert busplan.capacity(path).results[0].nodes == 5
    (file,) = busplan.check(own, circle=False).files
    assert (file.path, file.status) == ("paper-4ms", "ok")


def test_a_profile_is_taken_as_it_is() -> None:
    profile = busplan.load_profile("paper-4ms")
    assert busplan.load_profile(profile) is profile
    assert busplan.capacity(profile).profile is profile


def test_changes_are_checked_and_numbers_of_numpy_are_numbers() -> None:
    changes = {"bus.nodes": np.int64(3), "cycle.period_us": np.float64(500), "servo.x.drive_lag_us": 7.0}
    profile = busplan.load_profile("paper-4ms", changes=changes)
    assert (profile.bus.nodes, profile.cycle.period_us) == (3, 500.0)
    assert type(profile.bus.nodes) is int
    assert busplan.load_profile(profile, changes={"bus.nodes": 4}).cycle.period_us == 500.0
    assert profile.bus.nodes == 3


def test_arrays_ranges_and_lists_are_the_same_values() -> None:
    wanted = busplan.capacity("paper-4ms", period_us=[2000.0, 3000.0, 4000.0])
    for periods in (
        range(2000, 4001, 1000),
        np.arange(2000, 4001, 1000),
        np.linspace(2000, 4000, 3),
        (2000, 3000, 4000),
    ):
        assert busplan.capacity("paper-4ms", period_us=periods).to_json() == wanted.to_json()
    for one in (2000, 2000.0, np.float64(2000), np.array(2000.0)):
        assert busplan.capacity("paper-4ms", period_us=one).results == wanted.results[:2]
    sizes = busplan.latency("paper-4ms", payload_bytes=np.array([4, 16]))
    assert sizes == busplan.latency("paper-4ms", payload_bytes=[4, 16])


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "no file": (lambda: busplan.capacity("nope"), "nope: no such file, and no shipped profile of that name"),
    "no file at a path": (lambda: busplan.capacity(Path("nope.toml")), "nope.toml: no such file"),
    "a folder": (lambda: busplan.load_profile(Path()), "is a directory"),
    "standard input": (lambda: busplan.load_profile("-"), "-: standard input is read by the command line alone"),
    "standard input to check": (lambda: busplan.check(["-"]), "-: standard input is read by the command line alone"),
    "a period in words": (
        lambda: busplan.circle_test("paper-4ms", period_us="4ms"),  # type: ignore[arg-type]
        "period 4ms: expected a number",
    ),
    "no period": (lambda: busplan.capacity("paper-4ms", period_us=[]), "period_us: no values; give at least one"),
    "a period that is none": (lambda: busplan.capacity("paper-4ms", period_us=[0]), "period 0: must be 0.001 or more"),
    "a period without end": (lambda: busplan.capacity("paper-4ms", period_us=[np.inf]), "period inf: must be finite"),
    "no model": (lambda: busplan.capacity("paper-4ms", timing_model=[]), "timing_model: no values"),
    "another model as a word": (
        lambda: busplan.capacity("paper-4ms", timing_model="both"),
        "timing_model 'both': expected 'standard' or 'paper', or a list of them, each once",
    ),
    "another model": (
        lambda: busplan.sweep("paper-4ms", vary={"bus.nodes": [1]}, timing_model=["both"]),
        "timing_model ['both']: expected 'standard' or 'paper', or a list of them, each once",
    ),
    "a model twice": (
        lambda: busplan.latency("paper-4ms", timing_model=["paper", "paper"]),
        "timing_model ['paper', 'paper']: expected 'standard' or 'paper', or a list of them, each once",
    ),
    "another model of a timeline": (
        lambda: busplan.timeline("paper-4ms", timing_model="both"),
        "timing_model ['both']: expected 'standard' or 'paper', or a list of them, each once",
    ),
    "no payload": (
        lambda: busplan.latency("paper-4ms", payload_bytes=[0]),
        "payload_bytes 0: expected a whole number from 1 to 1,000,000",
    ),
    "half a payload": (
        lambda: busplan.latency("paper-4ms", payload_bytes=[4.5]),  # type: ignore[list-item]
        "payload_bytes 4.5: expected a whole number from 1 to 1,000,000",
    ),
    "a goal without keys": (
        lambda: busplan.plan("paper-4ms", changes=["bus.nodes"]),  # type: ignore[arg-type]
        "changes ['bus.nodes']: expected new values by key",
    ),
    "too many axes": (
        lambda: busplan.plan("paper-4ms", axes=4_000_000),
        "axes 4000000: expected a whole number from 1 to 1,000,000",
    ),
    "an executor of no circles": (
        lambda: busplan.map_("paper-4ms", executor=ThreadPoolExecutor()),
        "executor: needs circle=True",
    ),
    "one freedom": (
        lambda: busplan.plan("paper-4ms", free="gap_count"),
        "free 'gap_count': expected several values, as a list",
    ),
    "a kind beside the paper": (
        lambda: busplan.evidence("can", paper=True),
        "kind 'can': cannot be used with paper=True",
    ),
    "a trace of every half step": (
        lambda: busplan.circle_test("paper-4ms").trace_csv(every=0),
        "every 0: expected a whole number from 1",
    ),
    "no changes for a check": (
        lambda: busplan.check("paper-4ms", changes=[1]),  # type: ignore[arg-type]
        "changes [1]: expected new values by key",
    ),
    "a change to no value": (
        lambda: busplan.check("paper-4ms", changes={"cycle.period_us": float("nan")}),
        "changes cycle.period_us: nan is no value of a profile",
    ),
    "no paths": (lambda: busplan.check([]), "paths: no values; give at least one"),
    "paths that are none": (lambda: busplan.check(5), "paths 5: expected several values, as a list"),  # type: ignore[arg-type]
    "a path that is none": (lambda: busplan.load_profile(5), "5: expected a path, the name of a shipped"),  # type: ignore[arg-type]
    "a key that is none": (
        lambda: busplan.load_profile("paper-4ms", changes={1: 2}),  # type: ignore[dict-item]
        "changes 1: expected a dotted key of the profile",
    ),
    "changes that are none": (
        lambda: busplan.load_profile("paper-4ms", changes=[1]),  # type: ignore[arg-type]
        "changes [1]: expected new values by key",
    ),
    "keys that are none": (lambda: busplan.sweep("paper-4ms", vary={1: [2]}), "vary {1: [2]}: expected keys"),  # type: ignore[dict-item]
    "a cycle that is no number": (lambda: busplan.timeline("paper-4ms", cycle=True), "cycle True: expected a whole"),
    "a window from nowhere": (lambda: busplan.timeline("paper-4ms", from_us=float("nan")), "from_us nan: expected"),
    "a window to no float": (lambda: busplan.timeline("paper-4ms", to_us=10**400), "to_us 1"),
    "a window of words": (lambda: busplan.timeline("paper-4ms", from_us="4ms"), "from_us '4ms': expected a finite"),  # type: ignore[call-overload]
    "half a transaction": (
        lambda: busplan.timeline("paper-4ms", transaction=("read",)),  # type: ignore[arg-type]
        "transaction ('read',): expected one of one node",
    ),
    "a period of another kind": (
        lambda: busplan.plan("paper-4ms", period_us=Decimal(500)),  # type: ignore[arg-type]
        "period_us Decimal('500'): expected a finite number",
    ),
    "a figure that is none": (lambda: busplan.explain("paper-4ms", 5), "figure 5: expected a key of the JSON"),  # type: ignore[arg-type]
    "another transaction": (
        lambda: busplan.explain("paper-4ms", "latency_us", transaction="both"),
        "transaction 'both': expected 'read' or 'write'",
    ),
    "a revision that is none": (
        lambda: busplan.diff("HEAD~1:nowhere.toml", "paper-4ms"),
        "HEAD~1:nowhere.toml: no file of that name",
    ),
    "standard input to diff": (lambda: busplan.diff("paper-4ms", "-"), "-: standard input is read by the command line"),
    "a tolerance below nothing": (
        lambda: busplan.diff("paper-4ms", "paper-1ms").regressions(tolerance_percent=-1),
        "tolerance_percent -1: must be 0 or more",
    ),
    "no profiles": (lambda: busplan.report([]), "profiles: no values; give at least one"),
    "another ending": (
        lambda: busplan.latency("paper-4ms").save("x.pdf"),
        "x.pdf: expected a name ending in .txt, .md, .html, .csv, .json, .svg, .png",
    ),
    "a picture that there is not": (
        lambda: busplan.latency("paper-4ms").save("x.svg"),
        "this answer has no picture; timeline, map_",
    ),
    "a folder that there is not": (
        lambda: busplan.latency("paper-4ms").save("nowhere/x.md"),
        "nowhere/x.md: cannot be written: there is no folder ",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_a_busplan_error_and_nothing_is_printed(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    call, message = REFUSED[case]
    with pytest.raises(busplan.BusplanError, match=re.escape(message)):
        call()
    assert capfd.readouterr() == ("", "")


def test_a_broken_profile_is_an_error_with_its_places_and_a_finding_of_check(own: Path) -> None:
    own.write_text(TEXT.replace("nodes = 2", "nodes = 0"), encoding="utf-8")
    with pytest.raises(busplan.BusplanError, match=r"paper-4ms:[0-9]+:1: bus\.nodes = 0: must be 1 or more"):
        busplan.load_profile(own)
    answer = busplan.check([own, "paper-1ms"], circle=False)
    (found,) = answer.findings
    assert (found.path, found.finding.code, found.finding.key) == ("paper-4ms", "BP005", "bus.nodes")
    assert (answer.passed, answer.summary.errors, repr(answer)) == (
        False,
        1,
        "<CheckAnswer: checked 2 profiles: 1 error, 0 warnings; 1 circle test not run; 1 finding suppressed>",
    )


def test_a_warning_passes_and_a_file_that_is_not_there_does_not(own: Path) -> None:
    own.write_text(TEXT.replace("# busplan: ignore[BP110]", "#"), encoding="utf-8")
    answer = busplan.check(own, circle=False)
    assert (answer.passed, [one.finding.code for one in answer.findings]) == (True, ["BP110"])
    assert busplan.check("nowhere.toml").passed is False


def test_every_file_is_checked_with_changes_which_the_answer_names(own: Path) -> None:
    answer = busplan.check([own, "paper-1ms"], circle=False, changes={"cycle.period_us": np.int64(300)})
    assert {found.finding.code for found in answer.findings} >= {"BP101"}
    assert answer.to_dict()["changes"] == {"cycle.period_us": 300}
    assert answer.changes.words == "--set cycle.period_us=300"
    (refused,) = busplan.check("paper-1ms", changes={"bus.nodes": 0}).files
    assert refused.failure is not None
    assert "--set bus.nodes=0" in refused.failure


def test_a_check_on_an_executor_is_the_same(own: Path) -> None:
    several: list[str | Path | busplan.Profile] = [own, "paper-1ms", "nowhere.toml", busplan.load_profile("paper-dma")]
    with ThreadPoolExecutor(2) as executor:
        there = busplan.check(several, circle=False, executor=executor)
    assert there.files == busplan.check(several, circle=False).files


def test_files_that_are_no_profiles_are_skipped_and_counted_on_request(own: Path, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text("a = 1\n", encoding="utf-8")
    answer = busplan.check([own, tmp_path / "other.toml"], circle=False, skip_others=True)
    assert (len(answer.files), answer.others, answer.passed) == (1, 1, True)
    assert answer.headline.endswith("skipped 1 file without a schema_version")


def test_a_profile_is_checked_as_the_file_that_would_be_written_of_it() -> None:
    fast = busplan.load_profile("paper-4ms", changes={"cycle.period_us": 300})
    answer = busplan.check([fast, "paper-1ms"], circle=False)
    assert (answer.passed, [one.path for one in answer.files]) == (False, ["paper-1ms.toml", "paper-4ms.toml"])
    assert "BP101" in [one.finding.code for one in busplan.check(fast, circle=False).findings]


def test_a_transaction_is_a_pair_or_its_text() -> None:
    wanted = busplan.timeline("paper-4ms", transaction=("read", 1))
    assert busplan.timeline("paper-4ms", transaction="read:1") == wanted
    assert wanted.events[0].node == 1
