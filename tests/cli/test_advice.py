"""Words at a mistake name what to type instead, and the next command can be typed."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Busplan = Callable[..., Any]


@pytest.fixture(scope="module")
def folder(busplan: Busplan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two new profiles, and one with a comma in a number."""
    folder = tmp_path_factory.mktemp("advice")
    for options in (("a", "--bus", "ethercat", "--axes", "8"), ("g", "--bus", "firewire", "--axes", "26")):
        assert busplan("init", *options, "--nodes", "8", "--period", "1ms", cwd=folder).returncode == 0
    text = re.sub(r"(?m)^period_us = .*", "period_us = 1,5", (folder / "a.toml").read_text(encoding="utf-8"))
    (folder / "comma.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("capacity", "a.toml", "--axes", "40"), "here --set bus.nodes=..."),
        (("plan", "g.toml", "--axes", "30"), "say --set group.axes-4.nodes=3 or --set group.axes-3.nodes=8"),
        (("plan", "g.toml", "--nodes", "9"), "--nodes 9: this profile has groups; set group.NAME.nodes instead"),
        (("capacity", "a.toml", "--set", "limits.reserve=15"), "it is a share: 0.15 for 15 %"),
        (("capacity", "a.toml", "--set", "limits.reserve=15%"), "a share is a number without a sign: 0.15"),
        (("capacity", "a.toml", "--set", "cycle.period_us=1,5"), "a decimal point, not a comma: 1.5"),
        (("capacity", "comma.toml"), "a decimal point, not a comma: 1.5"),
        (("capacity", "a.toml", "--set", "bus.master=twincat"), 'did you mean "TwinCAT"?'),
        (("capacity", "a.toml", "--set", "bus.kind=EtherCAT"), 'did you mean "ethercat"?'),
        (("capacity", "comm.toml"), "comm.toml: no such file; did you mean comma.toml?"),
        (("init", "x", "--bus", "can", "--bit-rate", "1M"), "expected a whole number, in kbit/s"),
        (("sweep", "a.toml", "--vary", "cycle.period_us=250:1000:*2us"), "'2us' is not a number"),
    ],
)
def test_the_right_words_are_named(busplan: Busplan, folder: Path, arguments: tuple[str, ...], words: str) -> None:
    done = busplan(*arguments, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


def test_values_of_a_grid_take_units(busplan: Busplan, tmp_path: Path) -> None:
    def rows(values: str) -> str:
        vary = f"cycle.period_us={values}"
        return str(busplan("sweep", "paper-1ms", "--vary", vary, "--format", "csv", cwd=tmp_path).stdout)

    assert rows("250us,0.5ms,750") == rows("250:0.75ms:250us") == rows("250,500,750") != ""


def test_start_is_the_tour(busplan: Busplan, tmp_path: Path) -> None:
    tour, start = (busplan("manual", topic, cwd=tmp_path).stdout for topic in ("commands", "start"))
    assert start == tour != ""
