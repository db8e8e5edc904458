"""CAN networks of many messages, and of many points: every command answers, soon."""

import csv
import io
import tomllib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

import busplan
from tests.buses.can.machines import loaded, phases, text_of

Run = Callable[..., Any]
BASE = """\
schema_version = 1
name = "many"
bus = { kind = "can", bit_rate_kbit_s = 1000, nodes = 2, identifier_bits = 29 }
cycle = { period_us = 20000.0 }
payload = { read_bytes = 8, write_bytes = 8 }
node = { axes = 1, execution = { kind = "linear", grade = "assumed", base_us = 100, per_byte_us = 0 } }
"""


def messages(count: int, *, load: float, slow: float, random: Random) -> list[dict[str, Any]]:
    """Some messages that together make a load, a share of them with the longest period."""
    weights = [0.0 if random.random() < slow else random.uniform(0.1, 1) for _ in range(count)]
    found = []
    for number, weight in enumerate(weights):
        period_us = 160 / (load * weight / sum(weights)) if weight else 1e9
        jitter_us = random.choice([0.0, random.uniform(0, period_us)])
        identifier = random.choice([0x10, 0x10000]) + 3 * number
        keys = {"identifier": identifier, "payload_bytes": 8, "period_us": period_us, "jitter_us": jitter_us}
        found.append({"name": f"m{number}", **keys})
    return found


def many(count: int, *, load: float, slow: float = 0.5, seed: int = 1) -> busplan.Profile:
    sent = messages(count, load=load, slow=slow, random=Random(seed))
    return loaded({**tomllib.loads(BASE), "message": sent})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("map", 40),
        ("sweep --vary cycle.period_us=20000,40000 --vary message.m3.jitter_us=0,50", 40),
        ("sweep --vary cycle.period_us=20000,40000 --vary message.m3.identifier=17,70000", 40),
        ("report --no-circle", 10),
    ],
)
def test_many_messages_are_answered(run: Run, tmp_path: Path, line: str, count: int) -> None:
    (tmp_path / "many.toml").write_text(text_of(many(count, load=0.4)), encoding="utf-8")
    command, *options = line.split()
    done = run(command, "many.toml", *options, "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("load", "slow", "seed"), [(0.995, 0.9, 1), (0.9998, 0.8, 4)])
def test_a_bus_that_is_nearly_full_is_answered(load: float, slow: float, seed: int) -> None:
    profile = many(60, load=load, slow=slow, seed=seed)
    assert busplan.capacity(profile).report().blocks
    found = busplan.latency(profile, timing_model=["worst-stuffing"])
    assert len(found.transactions) == 64


def test_a_response_that_takes_too_many_steps_is_not_computed_and_said() -> None:
    random = Random(3)
    periods_us = [random.uniform(27_000, 54_000) for _ in range(30)]
    scale = sum(135 / us for us in periods_us) / 0.9999
    each = [
        {"name": f"m{number}", "identifier": number, "payload_bytes": 8, "period_us": us}
        for number, us in enumerate([*(us * scale for us in periods_us), 1e9])
    ]
    bus = {"kind": "can", "bit_rate_kbit_s": 1000}
    own = loaded({"schema_version": 1, "name": "full", "bus": bus, "message": each})
    answers = phases(own)
    assert answers["m30"]["worst_response_us"] is None
    assert answers["m10"]["worst_response_us"] is not None
    said = [one.finding.message for one in busplan.check(own).findings]
    assert any("its busy period takes over 2000 steps to find" in words for words in said)


def test_groups_have_one_set_of_columns(run: Run, tmp_path: Path) -> None:
    execution = {"kind": "linear", "grade": "measured", "base_us": 50.0, "per_byte_us": 0.0}
    sizes = {"write_bytes": 8, "execution": execution, "nodes": 2, "axes": 1}
    data = tomllib.loads(BASE)
    data = {key: value for key, value in data.items() if key not in ("payload", "node")}
    data["bus"].pop("nodes")
    groups = [{"name": name, "read_bytes": size, **sizes} for name, size in (("left", 8), ("right", 6))]
    (tmp_path / "two.toml").write_text(text_of(loaded({**data, "group": groups})), encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(run("latency", "two.toml", "--format", "csv", cwd=tmp_path).stdout)))
    assert {row["group"] for row in rows} == {"", "left", "right"}
    assert len({tuple(row) for row in rows}) == 1


def test_a_long_list_of_inputs_stands_once(run: Run, tmp_path: Path) -> None:
    (tmp_path / "many.toml").write_text(text_of(many(40, load=0.5)), encoding="utf-8")
    text = run("explain", "many.toml", "worst_response_us", "--all", cwd=tmp_path).stdout
    inputs = [line for line in text.splitlines() if "message.m7.period_us" in line]
    assert text.count("m7") > 40
    assert len(inputs) < 3  # the messages', and that of the loop


@pytest.mark.slow
def test_a_thousand_messages_are_answered(run: Run, tmp_path: Path) -> None:
    (tmp_path / "many.toml").write_text(text_of(many(1000, load=0.2, slow=0)), encoding="utf-8")
    for command in ("check", "latency"):
        assert run(command, "many.toml", cwd=tmp_path).returncode in (0, 1)


@pytest.mark.slow
def test_a_long_file_with_a_wrong_key_says_so_soon(run: Run, tmp_path: Path) -> None:
    text = text_of(many(1_000, load=0.2, slow=0)).replace("payload_bytes = 8\nperiod", "payload = 8\nperiod")
    (tmp_path / "many.toml").write_text(text, encoding="utf-8")
    assert "more problems of this file are not listed" in run("check", "many.toml", cwd=tmp_path).stdout
