"""Keys that do not agree: all that a section has of them at once, and nothing that rests on what is refused."""

from pathlib import Path

import pytest

import busplan

BUS = """\
schema_version = 1
name = "two-faults"
[bus]
kind = "can"
bit_rate_kbit_s = 500
data_bit_rate_kbit_s = 250
error_burst = 2
nodes = 1
[cycle]
period_us = 4000
[payload]
read_bytes = 8
write_bytes = 8
[node]
axes = 1
execution = { kind = "linear", base_us = 10, per_byte_us = 0 }
"""


def test_two_problems_of_a_section_are_told_at_once_each_at_its_key(tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    path.write_text(BUS, encoding="utf-8")
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.load_profile(path)
    first, second = str(refused.value).splitlines()
    assert "two.toml:6" in first
    assert "is under bit_rate_kbit_s, 500" in first
    assert "two.toml:7" in second
    assert "asks for error_period_us" in second


def test_what_a_section_adds_is_checked_only_where_what_it_extends_is_right(tmp_path: Path) -> None:
    path = tmp_path / "no-node.toml"
    without_node = BUS.partition("[node]")[0].replace("data_bit_rate_kbit_s = 250\nerror_burst = 2\n", "")
    message = '[[message]]\nname = "SYNC"\nidentifier = 1\npayload_bytes = 8\nperiod_us = 1000\n'
    path.write_text(without_node + message, encoding="utf-8")
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.load_profile(path)
    assert "node" in str(refused.value)
    assert "what the frames of the cycle are called" not in str(refused.value)
