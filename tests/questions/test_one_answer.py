"""One question, one number: every answer shows the verdict that `capacity` gives, in its document and in its words.

More profiles: pytest --hypothesis-profile=thorough tests/questions/test_one_answer.py
"""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext, suppress
from math import ceil, floor, isclose, log10
from pathlib import Path
from random import Random
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_called, kind_named, kind_names, variant_called
from busplan.errors import BusplanError
from busplan.profile.sources import shipped_names
from busplan.profile.starter import Machine, machine_text, shared_out
from tests.oracles.random_plans import PLANS

Record = Mapping[str, Any]
NAMES = tuple(name for kind in kind_names() for name in (kind, *kind_named(kind).starter.variants))
OTHERS = {
    "cells",
    "curve",
    "groups",
    "events",
    "totals",
    "regions",
    "distinct_cycles",
    "sensitivity",
    "next_bottleneck",
    "reach",
    "terms",
}
"""Keys of records that are of other designs, or of parts."""
ALSO_CALLED = {"smallest_period_us": "fastest_period_us"}
COUNTS = {"max_nodes", "max_axes", "limited_by", "safe_nodes", "safe_axes", "safe_limited_by"}
MAY_REFUSE = {"timeline", "explain", "map", "explore", "sweep"}
"""Answers that too many nodes, or a value that is refused, leave out."""
OWN = {"profile", "command", "schema", "text", "lines", "warnings", "timing_model"}


def starter(random: Random, path: Path) -> None:
    """What `init` writes for a random machine."""
    name = random.choice(NAMES)
    nodes = random.randint(1, 12)
    groups = shared_out(nodes * random.randint(1, 3), nodes=nodes)
    period_us = random.choice((500.0, 1000.0, 2000.0, 4000.0, 10_000.0, 20_000.0))
    machine = Machine(groups, period_us, random.choice((2, 4, 8)), variant=variant_called(name))
    path.write_text(machine_text(machine, kind=kind_called(name), name=path.stem, file=path.name))


def some_changes(random: Random, profile: busplan.Profile) -> dict[str, object]:
    """Other values, not all of which a profile need accept."""
    changes: dict[str, object] = {}
    if profile.has_cycle:
        changes["cycle.period_us"] = profile.cycle.period_us * random.choice((0.2, 0.5, 0.9, 1, 1, 2))
        for key, most in (("reserve", 0.3), ("max_utilisation", 1)):
            if random.random() < 0.2:
                changes[f"limits.{key}"] = round(random.uniform(0, most), 2)
        for what in ("nodes", "axes"):
            if random.random() < 0.25:
                changes[f"limits.min_spare_{what}"] = random.randint(0, 8)
    if profile.bus.kind == "can" and random.random() < 0.4:
        changes["bus.queue"] = random.choice(("fifo", "buffer", "priority"))
    return changes


def some_profile(random: Random, folder: Path) -> tuple[busplan.Profile, Path | str, dict[str, object]]:
    """A shipped profile, that of a new machine or a random plan; its file or name, and the changes of that."""
    path = folder / "plan.toml"
    way = random.choice(("shipped", "shipped", "starter", *PLANS))
    source: Path | str = path
    if way == "shipped":
        source = random.choice(shipped_names())
    elif way == "starter":
        starter(random, path)
    else:
        path.write_text(tomli_w.dumps({"schema_version": 1, "name": "plan"} | PLANS[way](random)))
    profile = busplan.load_profile(source)
    changed: dict[str, object] = {}
    for key, value in some_changes(random, profile).items():
        try:
            profile = busplan.load_profile(profile, changes={key: value})
        except BusplanError:
            continue
        changed[key] = value
    return profile, source, changed


def same(left: object, right: object) -> bool:
    """Whether two values are shown alike, as 2 and 2.0 are not."""
    if type(left) is not type(right):
        return False
    if isinstance(left, bool) or isinstance(right, bool) or not isinstance(left, int | float):
        return left == right
    return isinstance(right, int | float) and isclose(left, right, rel_tol=1e-9, abs_tol=1e-9)


def own(record: object, facts: Record) -> Iterator[Record]:
    """The records of a document that are of the machine as it is, under the model that decides."""
    if isinstance(record, list):
        for part in record:
            yield from own(part, facts)
    elif isinstance(record, dict):
        is_changed = record.get("changes") and "command" not in record
        if record.get("timing_model", facts["timing_model"]) != facts["timing_model"] or is_changed:
            return
        if not record.get("is_own", True) or record.get("transaction"):
            return
        yield record
        for key, value in record.items():
            if key not in OTHERS:
                yield from own(value, facts)


def facts_of(document: Record) -> dict[str, Any]:
    """What `capacity` says of the machine, by key."""
    (verdict,) = document["verdicts"]
    (result,) = (one for one in document["results"] if one["timing_model"] == verdict["timing_model"])
    return {**result, **verdict}


def numbers(words: str) -> list[str]:
    """The numbers of a sentence, those of names left out."""
    return re.findall(r"(?<![\w.])(?<!\w-)\d+(?:\.\d+)?(?![\w.]*\w)", re.sub(r"(?<=\d),(?=\d{3})", "", words))


def is_shown(text: str, known: list[float], uncertainty_us: float) -> bool:
    """Whether a number of a sentence is one of some values, rounded, rounded up, or in another unit.

    Of an uncertainty from 100 us on two digits are known, and as few tens of a time.
    """
    decimals = len(text.partition(".")[2])
    tens = 10 ** (floor(log10(uncertainty_us)) - 1) if uncertainty_us >= 100 else 1
    for value in known:
        for factor in (1, 100, 1e-3, 1e-6):
            scaled = abs(value) * factor
            for step in (10**-decimals, tens):
                up = ceil(scaled / step * (1 - 1e-9)) * step
                if text in {f"{round(scaled / step) * step:.{decimals}f}", f"{up:.{decimals}f}"}:
                    return True
    return False


def scalars(record: object) -> Iterator[float]:
    if isinstance(record, dict):
        for value in record.values():
            yield from scalars(value)
    elif isinstance(record, list):
        for value in record:
            yield from scalars(value)
    elif isinstance(record, int | float) and not isinstance(record, bool):
        yield float(record)


def with_own_point(profile: busplan.Profile) -> dict[str, Callable[[], Any]]:
    """The answers that go over a grid, of the machine's own point."""
    period = {"cycle.period_us": [profile.cycle.period_us]}
    return {
        "map": lambda: busplan.map_(profile, x={"limits.reserve": [profile.limits.reserve]}, y=period),
        "sweep": lambda: busplan.sweep(profile, vary=period),
        "compare": lambda: busplan.compare(profile, buses=[profile.bus.kind]),
        "timeline": lambda: busplan.timeline(profile),
        "explore": lambda: busplan.explore(
            profile,
            x={"limits.reserve": [profile.limits.reserve]},
            y=period,
            over={"cycle.nonperiodic_us": [profile.cycle.nonperiodic_us]},
        ),
    }


def documents_agree(answers: Mapping[str, Any], facts: Record) -> None:
    """Each key of a record that is of this machine has the value that `capacity` gives it."""
    shown: dict[str, set[str]] = {}
    for name, answer in answers.items():
        for record in own(answer.to_dict(), facts):
            for name_here, value in record.items():
                key = ALSO_CALLED.get(name_here, name_here)
                # Of groups each has its own; a grid and `compare` count the nodes of one of them.
                is_other = key in OWN or (facts.get("groups") and key in COUNTS)
                if key not in facts or is_other or isinstance(value, dict):
                    continue
                if name == "explain" and key != "period_us":
                    continue
                shown.setdefault(name, set()).add(key)
                assert same(value, facts[key]), (name, key, value, facts[key])
    if facts.get("groups") and "compare" in answers:
        counts_agree(answers["compare"].to_dict(), facts)
    for name in {
        "latency",
        "plan",
        "check",
        "timeline",
        "map",
        "sweep",
        "compare",
        "explore",
        "report",
    } & answers.keys():
        assert "verdict" in shown[name], name
    for name in {"plan", "check", "timeline", "map", "sweep", "compare", "explore"} & answers.keys():
        assert {"margin_corrected_us", "uncertainty_us"} <= shown[name], name
    if "explain" in answers:
        values = [one["value"] for one in answers["explain"].to_dict()["derivations"]]
        assert any(same(value, facts["required_us"]) for value in values)


def counts_agree(compared: Record, facts: Record) -> None:
    """`compare` counts the nodes of a group as `capacity` does, and the axes of all."""
    (record,) = compared["buses"]
    (counted,) = (one for one in facts["groups"] if one["name"] == compared["group"])
    for key in ("safe_nodes", "safe_limited_by"):
        assert record[key] == counted[key]
    most = counted["safe_axes"] and facts["axes"] - counted["axes"] + counted["safe_axes"]
    assert record["safe_axes"] == (most if counted["axes"] else None)


def needs_agree(answers: Mapping[str, Any], facts: Record) -> None:
    """Missed limits, cure, and whether senders are known, are judged once."""
    (file,) = answers["check"].to_dict()["files"]
    found = {one["code"]: one for one in (*file["findings"], *file["suppressed"])}
    missed = facts["missed_limits"]
    codes = {"max_utilisation": "BP103", "min_spare_nodes": "BP104", "min_spare_axes": "BP105"}
    assert {code for code in codes.values() if code in found} == {codes[key.removeprefix("limits.")] for key in missed}
    plan = answers["plan"].to_dict()
    is_well = facts["verdict"] == "fits" and not missed and facts.get("gap_count_safe", True)
    assert is_well == (plan["recommended_changes"] == {}), (plan["recommended_changes"], facts["verdict"], missed)
    if not is_well:
        cure = facts["cheapest_change"] and facts["cheapest_change"]["changes"]
        assert plan["recommended_changes"] == cure
        for one in found.values():
            if one["cure"] and one["code"] in ("BP101", "BP114", *codes.values()):
                assert sorted(line.split(" = ")[0] for line in one["cure"].splitlines()) == sorted(cure)
    said = str(answers["latency"])
    if answers["latency"].profile.bus.kind == "can":
        of_deadlines = {"senders", "deadline", "periods"}
        if of_deadlines & {*facts["not_shown"], *facts["exceeded"]}:
            assert "Every message keeps its deadline" not in said
        if "senders" in facts["not_shown"]:
            assert "who sends it is not known" in said


def words_agree(answers: Mapping[str, Any], facts: Record, *, has_cycle: bool) -> None:
    """Each number of the card is in the record; `timeline` has the same lines; the words of a limit stand once."""
    lines = {line["label"]: line["text"] for line in facts["lines"]}
    if has_cycle:
        given_us, margin_us = facts["available_us"], facts["margin_corrected_us"]
        used_us = given_us - margin_us
        counts = facts.get("groups") or [facts]
        more = [one[f"safe_{what}"] - one[what] for one in counts for what in ("nodes", "axes")]
        known = [*scalars(facts), used_us, used_us / given_us, given_us * facts["reserve"], *more]
        for label in ("used", "free", "short by", "room for", "fastest period"):
            words = lines.get(label, "")
            for number in [] if words.startswith("none: ") else numbers(words):
                assert is_shown(number, known, facts["uncertainty_us"] or 0.0), (label, lines[label], number)
        if "timeline" in answers:
            words = str(answers["timeline"])
            for label in {"used", "free", "short by"} & lines.keys():
                assert f"{label} {lines[label]}" in words, (label, lines[label])
    reasons = [lines[label] for label in ("limit", "fastest period", "cure") if label in lines]
    limit = lines.get("limit")
    assert limit is None or sum(limit in reason for reason in reasons) == 1


@pytest.mark.slow
@given(seed=st.integers(0, 2**32))
def test_every_answer_shows_the_verdict_of_capacity(seed: int, tmp_path: Path) -> None:
    random = Random(seed)
    profile, source, changes = some_profile(random, tmp_path)
    capacity = busplan.capacity(profile)
    facts = facts_of(capacity.to_dict())
    asked: dict[str, Callable[[], Any]] = {
        "latency": lambda: busplan.latency(profile),
        "plan": lambda: busplan.plan(profile),
        "check": lambda: busplan.check(source, changes=changes, circle=False),
    }
    if profile.has_cycle:
        asked |= with_own_point(profile)
        asked["explain"] = lambda: busplan.explain(profile, "required_us")
    answers = {}
    for name, ask in asked.items():
        with suppress(BusplanError) if name in MAY_REFUSE else nullcontext():
            answers[name] = ask()
    documents_agree(answers, facts)
    needs_agree(answers, facts)
    words_agree(answers, facts, has_cycle=profile.has_cycle)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gantry-24", "can-servo-8", "ethercat-servo-8"])
def test_so_does_a_report(name: str) -> None:
    """A report asks the others: its map alone takes too long for random profiles."""
    documents_agree({"report": busplan.report(name, circle=False)}, facts_of(busplan.capacity(name).to_dict()))
