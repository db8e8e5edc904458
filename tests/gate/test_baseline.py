"""The baseline: what is a regression, what is none, and what is no baseline."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan.gate.baseline import MODELS, read_baseline

Changed = Callable[..., str]
Check = Callable[..., Any]
Record = dict[str, Any]
SHIPPED = Path(__file__).resolve().parents[2] / "profiles"


def record(result: Any, *, keys: bool = True) -> Record:
    """What a baseline holds of a result; an older one has no keys."""
    return {"figures": result.figures, "keys": result.keys if keys else None}


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("axes = 4", "axes = 3", "node.axes", "3, was 4: safe axes fell from 56 to 42, most axes from 60 to 45"),
        (
            "nodes = 2",
            "nodes = 3",
            "bus.nodes",
            "3, was 2: corrected margin fell from 1806.3 to 1704.4 us, margin from ",
        ),
        # A hundredth of a microsecond has two decimals.
        (
            "period_us = 4000",
            "period_us = 3999.98",
            "cycle.period_us",
            "corrected margin fell from 1806.28 to 1806.27 us",
        ),
        (
            "period_us = 4000",
            "period_us = 3000",
            "cycle.period_us",
            "3000, was 4000: corrected margin fell from 1806.3 to 1306.3 us, safe axes from 56 to ",
        ),
        ("base_us = 30", "base_us = 31", "node.execution.base_us", "31, was 30: corrected margin fell from "),
    ],
)
def test_a_loss_of_axes_or_margin_is_one_error_at_the_key_that_costs_it(
    old: str, new: str, key: str, words: str, clean: str, changed: Changed, check: Check
) -> None:
    before = check(clean)
    (finding,) = check(changed((old, new)), baseline=record(before)).findings
    assert (finding.code, finding.severity, finding.key) == ("BP301", "error", key)
    assert words in finding.problem
    assert (finding.help or "").startswith("if that is meant, record it with --update-baseline")
    # An older baseline does not know the key, and says the same figures at the name.
    (older,) = check(changed((old, new)), baseline=record(before, keys=False)).findings
    assert (older.code, older.key, older.line) == ("BP301", "name", 2)
    assert older.problem.removeprefix("name: ") == finding.problem.rpartition(": ")[2]


def test_keys_that_cost_nothing_are_not_blamed(clean: str, changed: Changed, check: Check) -> None:
    others = (('name = "example"', 'name = "other"'), ("read_bytes = 12", "read_bytes = 8"), ("axes = 4", "axes = 5"))
    text = changed(*others, ("period_us = 4000", "period_us = 3000"), more="\n[tolerance]\nmax_contour_error_mm = 1\n")
    (finding,) = check(text, baseline=record(check(clean)), circle=False).findings
    assert finding.problem.startswith("cycle.period_us: 3000, was 4000: corrected margin fell ")


def test_several_keys_that_cost_something_are_one_finding(clean: str, changed: Changed, check: Check) -> None:
    pairs = [('gap_count = "optimal"', "gap_count = 10"), ("nodes = 2", "nodes = 3"), ("base_us = 30", "base_us = 40")]
    text = changed(*pairs, ("period_us = 4000", "period_us = 3900  # busplan: ignore[BP301] meant"))
    found = check(text, baseline=record(check(clean))).findings
    (finding,) = [one for one in found if one.code == "BP301"]
    assert finding.key == "bus.gap_count"
    assert '10, was "optimal"; bus.nodes = 3, was 2; cycle.period_us = 3900, was 4000; and 1 more: ' in finding.problem


def test_a_key_that_is_no_longer_said_has_its_default(clean: str, changed: Changed, check: Check) -> None:
    (finding,) = [
        one
        for one in check(changed(('gap_count = "optimal"\n', "")), baseline=record(check(clean))).findings
        if one.code == "BP301"
    ]
    assert finding.problem.startswith('bus.gap_count: 63, was "optimal": ')
    assert finding.line == 4  # [bus], which has it no more
    # And one that is said for the first time was its default before.
    before = record(check(changed(('gap_count = "optimal"', "gap_count = 63"))))
    unsaid = {**before, "keys": {key: one for key, one in before["keys"].items() if key != "bus.gap_count"}}
    text = changed(('gap_count = "optimal"', "gap_count = 63"), ("nodes = 2", "nodes = 3"))
    (finding,) = [one for one in check(text, baseline=unsaid).findings if one.code == "BP301"]
    assert finding.problem.startswith("bus.nodes: 3, was 2: ")


def test_changes_that_go_together_are_all_named(clean: str, changed: Changed, check: Check) -> None:
    # Neither key of the new kind can be taken back alone, so nobody can tell which of them it was.
    linear = 'kind = "linear"\ngrade = "measured"\nbase_us = 30\nper_byte_us = 0.35'
    table = 'kind = "table"\ngrade = "measured"\npayload_bytes = [8, 16]\ntime_us = [90, 91]'
    (finding,) = check(changed((linear, table)), baseline=record(check(clean))).findings
    assert finding.problem.startswith('node.execution.kind: "table", was "linear"; ')
    assert "node.execution.payload_bytes = [8, 16], was not set" in finding.problem


def test_figures_that_fell_with_no_key_changed_stand_at_the_name(clean: str, check: Check) -> None:
    before = record(check(clean))
    more = {**before, "figures": {**before["figures"], "standard.safe_axes": 60}}
    (finding,) = check(clean, baseline=more).findings
    assert finding.problem == "name: safe axes fell from 60 to 56"


def test_a_group_is_named_in_its_key_and_its_figures(check: Check) -> None:
    text = (SHIPPED / "gantry-24.toml").read_text(encoding="utf-8")
    before = record(check(text))
    group = next(key for key in before["keys"] if key.endswith(".nodes")).split(".")[1]
    text = text.replace("slice_ratio = 0.85", "slice_ratio = 0.75")
    (finding,) = [one for one in check(text, baseline=before).findings if one.code == "BP301"]
    assert finding.problem.startswith("cycle.slice_ratio: 0.75, was 0.85: corrected margin fell from ")
    assert finding.problem.endswith(", and 5 more")
    assert f"nodes of {group} " in finding.problem


@pytest.mark.parametrize(
    ("old", "new"),
    [("axes = 4", "axes = 5"), ("period_us = 4000", "period_us = 4001"), ("nodes = 2", "nodes = 1")],
)
def test_a_gain_is_fine(old: str, new: str, clean: str, changed: Changed, check: Check) -> None:
    assert check(changed((old, new)), baseline=record(check(clean))).findings == ()


def test_the_same_is_fine_and_a_profile_without_a_record_too(clean: str, check: Check) -> None:
    assert check(clean, baseline=record(check(clean))).findings == ()
    assert check(clean, baseline={"figures": {}}).findings == ()


def test_it_goes_by_figure_and_not_by_line(clean: str, changed: Changed, check: Check) -> None:
    recorded = record(check(clean))
    moved = "# one\n\n# two\n" + clean.replace("[bus]", "# three\n[bus] # four")
    assert check(moved, baseline=recorded).findings == ()
    before = check(changed(("nodes = 2", "nodes = 3")), baseline=recorded)
    after = check("# one\n\n" + changed(("nodes = 2", "nodes = 3")), baseline=recorded)
    assert [one.line + 2 for one in before.findings] == [one.line for one in after.findings]
    assert [one.message for one in before.findings] == [one.message for one in after.findings]


def test_both_timing_models_are_held(clean: str, check: Check) -> None:
    before = record(check(clean))
    figures = before["figures"]
    more = {**figures, "standard.margin_us": figures["standard.margin_us"] + 1}
    (finding,) = check(clean, baseline={"figures": more}).findings
    assert finding.problem.startswith("name: margin fell from ")
    more = {**figures, "paper.margin_us": figures["paper.margin_us"] + 1}
    (finding,) = check(clean, baseline={"figures": more}).findings
    assert finding.problem.endswith(" by the paper timing")


@pytest.mark.parametrize(("loss", "is_lost"), [(1e-12, False), (0.9e-9, False), (1.1e-9, True), (-1e-3, False)])
def test_rounding_is_no_loss(loss: float, is_lost: bool, clean: str, check: Check) -> None:
    figures = check(clean).figures
    before = {**figures, "standard.margin_us": figures["standard.margin_us"] * (1 + loss)}
    assert bool(check(clean, baseline={"figures": before}).findings) is is_lost


def test_a_record_is_sorted_by_path_and_has_what_the_file_sets(
    clean: str, run: Callable[..., Any], tmp_path: Path
) -> None:
    for name in ("b.toml", "a.toml"):
        (tmp_path / name).write_text(clean, encoding="utf-8")
    run("check", ".", "--baseline", "baseline.json", "--update-baseline", cwd=tmp_path)
    document = json.loads((tmp_path / "baseline.json").read_text(encoding="utf-8"))
    assert list(document["profiles"]) == list(document["keys"]) == ["a.toml", "b.toml"]
    assert document["keys"]["a.toml"]["bus.gap_count"] == "optimal"
    # No words that change no figure.
    assert not {"name", "description", "schema_version", "bus.max_hops"} & set(document["keys"]["a.toml"])
    # What a user may rely on is the verdict's: the closed forms of the paper have no such figures.
    assert set(document["profiles"]["a.toml"]) == {
        *("paper.max_axes", "paper.margin_us", "standard.max_axes", "standard.margin_us"),
        *("standard.safe_axes", "standard.margin_corrected_us"),
    }
    assert run("check", ".", "--baseline", "baseline.json", cwd=tmp_path).returncode == 0


GOOD = {"schema": 1, "command": "baseline", "profiles": {"a.toml": {"paper.max_axes": 4}}}


def test_what_is_no_baseline_is_refused_in_one_message(tmp_path: Path) -> None:
    path = tmp_path / "b.json"
    for document in [
        "",
        "{",
        "[]",
        "null",
        '"text"',
        "[" * 100_000,
        "1" * 5_000,
        json.dumps(GOOD)[:-1],
        json.dumps({**GOOD, "schema": 2}),
        json.dumps({**GOOD, "schema": None}),
        json.dumps({**GOOD, "command": "check"}),
        json.dumps({**GOOD, "models": "2"}),
        json.dumps({**GOOD, "models": True}),
        json.dumps({**GOOD, "models": 2.0}),
        json.dumps({**GOOD, "models": None}),
        json.dumps({**GOOD, "keys": []}),
        json.dumps({**GOOD, "keys": {"a.toml": [1]}}),
        json.dumps({**GOOD, "keys": {"a.toml": {"bus.nodes": None}}}),
        json.dumps({**GOOD, "keys": {"a.toml": {"bus.nodes": {"a": 1}}}}),
        json.dumps({**GOOD, "keys": {"a.toml": {"bus.nodes": [[1]]}}}),
        json.dumps({**GOOD, "keys": {"a.toml": {"bus.nodes": float("nan")}}}),
        json.dumps({**GOOD, "profiles": []}),
        json.dumps({**GOOD, "profiles": {"a.toml": []}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": "4"}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": True}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": None}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": float("nan")}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": float("inf")}}}),
        json.dumps({**GOOD, "profiles": {"a.toml": {"paper.max_axes": 10**400}}}),
    ]:
        path.write_text(document, encoding="utf-8")
        with pytest.raises(busplan.BusplanError, match="remove it, and record one with --update-baseline") as caught:
            busplan.check("paper-1ms", baseline=path)
        assert len(caught.value.problems) == 1
        assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("models", [None, 1, 3])
def test_figures_of_other_timing_models_are_not_compared(models: int | None, tmp_path: Path) -> None:
    path = tmp_path / "b.json"
    path.write_text(json.dumps(GOOD if models is None else {**GOOD, "models": models}), encoding="utf-8")
    with pytest.raises(busplan.BusplanError, match="recorded by other timing models, so its figures cannot be"):
        busplan.check("paper-1ms", baseline=path)


def test_safe_axes_are_held_where_the_closed_form_still_has_them(clean: str, check: Check) -> None:
    # 2097.465 us make 15 nodes safe and 1942.386 us are needed: a reserve takes safe nodes, and no others.
    before = record(check(clean))
    now = check(f"{clean}\n[limits]\nreserve = 0.1\n", baseline=before)
    assert [(one.code, one.key) for one in now.findings] == [("BP301", "limits.reserve")]
    # 1911.497 us for 14 nodes, and 1737.510 us for 13, of 1800 us.
    assert now.findings[0].problem.endswith("0.1, was 0: safe axes fell from 56 to 52")
    assert now.figures["standard.max_axes"] == before["figures"]["standard.max_axes"] == 60


def test_a_figure_that_no_bus_has_any_more_is_called_by_its_key(clean: str, changed: Changed, check: Check) -> None:
    before = record(check(clean))
    older = {**before, "figures": {**before["figures"], "standard.most_old_nodes": 4.5, "plain": 3}}
    (finding,) = check(clean, baseline=older).findings
    assert finding.problem == ("name: most old nodes fell from 4.5 to none, plain from 3 to none by the plain timing")
    # It behind those that are known; and of two changed keys only the one that costs something is to blame.
    text = changed(("nodes = 2", "nodes = 3"), ("read_bytes = 12", "read_bytes = 8"))
    (finding,) = check(text, baseline=older).findings
    assert finding.problem.startswith("bus.nodes: 3, was 2: corrected margin fell from ")
    assert finding.problem.endswith(", most old nodes from 4.5 to none, and 2 more")


def test_a_key_that_cannot_be_taken_back_alone_is_not_blamed(clean: str, changed: Changed, check: Check) -> None:
    linear = 'kind = "linear"\ngrade = "measured"\nbase_us = 30\nper_byte_us = 0.35'
    table = 'kind = "table"\ngrade = "measured"\npayload_bytes = [8, 16]\ntime_us = [30, 31]'
    text = changed((linear, table), ("nodes = 2", "nodes = 4"))
    (finding,) = check(text, baseline=record(check(clean))).findings
    assert finding.problem.startswith("bus.nodes: 4, was 2: corrected margin fell from ")


def test_a_long_value_is_cut(changed: Changed, check: Check) -> None:
    linear = 'kind = "linear"\ngrade = "measured"\nbase_us = 30\nper_byte_us = 0.35'
    table = 'kind = "table"\ngrade = "measured"\npayload_bytes = [{}]\ntime_us = [{}]'
    before = changed((linear, table.format("8, 12, 16, 20, 24, 28, 32, 36", "30, 31, 32, 33, 34, 35, 36, 37")))
    after = changed((linear, table.format("8, 12, 16, 20, 24, 28, 32, 36", "90, 91, 92, 93, 94, 95, 96, 97")))
    (finding,) = check(after, baseline=record(check(before))).findings
    assert finding.problem.startswith(
        "node.execution.time_us: [90.0, 91.0, 92.0, 93.0, 94.0,..., was [30.0, 31.0, 32.0, 33.0, 34.0,...: "
    )


def test_a_file_that_is_no_baseline_is_refused_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "b.json"

    def refused() -> str:
        with pytest.raises(busplan.BusplanError) as caught:
            busplan.check("paper-1ms", baseline=path)
        return str(caught.value).removeprefix(f"{path}: ")

    assert refused() == "no such file; record it with --update-baseline"
    path.write_bytes(b"\xff")
    assert refused() == "is not UTF-8, so it is not a baseline; give another"
    path.write_text("{", encoding="utf-8")
    assert refused().startswith("not JSON, so not a baseline; remove it")
    with path.open("wb") as file:
        file.truncate(32_000_001)
    assert refused().startswith("is larger than 32,000,000 bytes, so it is not a baseline")


@pytest.mark.parametrize(
    ("count", "words"), [(1, "0.toml"), (3, "0.toml, 1.toml, 2.toml"), (4, "0.toml, 1.toml, 2.toml and 1 more")]
)
def test_three_files_are_named_and_the_others_counted(count: int, words: str, clean: str, gate: Check) -> None:
    for number in range(count):
        Path(f"{number}.toml").write_text(clean, encoding="utf-8")
    gate(clean, name="0.toml", baseline={"figures": {}})
    Path("baseline.json").write_text(Path("baseline.json").read_text().replace("0.toml", "gone.toml"))
    *_, unmatched = busplan.check([f"{number}.toml" for number in range(count)], baseline="baseline.json").files
    assert f"no record ({words}), " in str(unmatched.failure)


def test_records_are_named_from_the_folder_of_the_baseline_or_the_working_folder(
    clean: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "line"
    folder.mkdir()
    (folder / "a.toml").write_text(clean, encoding="utf-8")
    text = json.dumps({**GOOD, "models": MODELS, "profiles": {"a.toml": {"standard.max_axes": 61}}})
    (folder / "b.json").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    def found(path: str, baseline: Any) -> tuple[list[str], bool]:
        file, *more = busplan.check(path, baseline=baseline).files
        return [finding.code for finding in file.findings], bool(more)

    assert found("line/a.toml", "line/b.json") == (["BP301"], False)
    # Its content alone is of no folder: in this one there is no a.toml, and line/a.toml has no record.
    content = read_baseline(text, name="the baseline")
    assert found("line/a.toml", content) == ([], True)
    monkeypatch.chdir(folder)
    assert found("a.toml", content) == (["BP301"], False)


MESSAGES = """\
schema_version = 1
name = "car"
[bus]
kind = "can"
bit_rate_kbit_s = 500
[[message]]
name = "m"
identifier = 1
payload_bytes = 8
period_us = 10000
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        # A frame of 111 bits and up to 24 of stuffing in 10 ms at 500 kbit/s.
        ("= 500", "= 250", "bus.bit_rate_kbit_s: 250, was 500: bus load rose from 2.7 to 5.4 %, expected load from "),
        ("= 500", "= 1000", ""),
        ("= 10000", "= 5000", "message.m.period_us: 5000, was 10000: bus load rose from 2.7 to 5.4 %, expected load "),
        ("= 10000", "= 20000", ""),
    ],
)
def test_of_messages_alone_the_load_is_held(old: str, new: str, words: str, check: Check) -> None:
    before = record(check(MESSAGES))
    assert before["figures"]["worst-stuffing.bus_load"] == pytest.approx(135 / 5000)
    found = check(MESSAGES.replace(old, new), baseline=before).findings
    assert [one.code for one in found] == ["BP301"] * bool(words)
    assert all(one.problem.startswith(words) for one in found)


@pytest.mark.parametrize(("more", "is_lost"), [(0.9e-9, False), (1.1e-9, True)])
def test_a_share_is_rounded_as_a_whole_of_1(more: float, is_lost: bool, check: Check) -> None:
    before = record(check(MESSAGES))
    before["figures"]["worst-stuffing.bus_load"] -= more
    assert bool(check(MESSAGES, baseline=before).findings) is is_lost
