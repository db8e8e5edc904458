"""`--vary KEY=VALUES` as it is read."""

import re

import pytest

from busplan.cli.options import parse_axes
from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.questions.sweep import axis_values
from busplan.questions.sweep.grid import Array

PROFILE = load("paper-1ms").profile


def axes(texts: list[str]) -> list[Array]:
    return [axis_values(PROFILE, key, text, name="--vary") for key, text in parse_axes(texts).items()]


def values(spec: str) -> list[object]:
    (axis,) = axes([f"bus.gap_count={spec}"])
    found: list[object] = axis.tolist()
    return found


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("1:5", [1, 2, 3, 4, 5]),
        ("250, 500 ,1000", [250, 500, 1000]),
        ("0.1:0.5:0.1", [0.1, 0.2, 0.3, 0.4, 0.5]),
        ("1:6:2", [1, 3, 5]),
        ("5:1:-2", [5, 3, 1]),
        ("0.5:2.4", [0.5, 1.5]),
        ("125:1000:*2", [125, 250, 500, 1000]),
        ("1000:100:*0.5", [1000, 500, 250, 125]),
        ("0.1:0.2:*1.5", [0.1, 0.15]),
        ("0:1:#5", [0.0, 0.25, 0.5, 0.75, 1.0]),
        ("10:50:#5", [10, 20, 30, 40, 50]),
        ("50:10:#3", [50, 30, 10]),
        ("63,optimal", [63, "optimal"]),
        ("1e3:3e3:1e3", [1000, 2000, 3000]),
        ("4.0", [4]),
        ("-1:1", [-1, 0, 1]),
        ("7:7", [7]),
        ("7:7:0.5", [7]),
        ("99999999999999999999999", [99999999999999999999999]),
    ],
)
def test_values(spec: str, expected: list[object]) -> None:
    found = values(spec)
    assert found == expected
    assert [type(one) for one in found] == [type(one) for one in expected]


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ([], "--vary: nothing to vary"),
        (["bus.nodes"], "expected KEY=VALUES"),
        (["=1"], "expected KEY=VALUES"),
        (["k="], "expected KEY=VALUES"),
        (["k=1", "k=2"], "k is varied already"),
        (["k=x"], "'x' is not a number"),
        (["bus.gap_count=63,best"], "'best' is not a number"),
        (["bus.nodes=optimal"], "'optimal' is not a number"),
        (["k=nan"], "'nan' is not a number"),
        (["k=inf"], "'inf' is not a number"),
        (["k=1e999"], "'1e999' is not a number"),
        (["k=1,,2"], "'' is not a number"),
        (["k=1:2:3:4"], "A:B:STEP"),
        (["k=2:1"], "steps of 1 never lead from 2 to 1"),
        (["k=1:2:0"], "steps of 0 never lead"),
        (["k=1:2:-1"], "steps of -1 never lead"),
        (["k=1:2:*1"], "multiplying by 1 never leads"),
        (["k=1:2:*0.5"], "multiplying by 0.5 never leads"),
        (["k=0:2:*2"], "multiplying by 2 never leads from 0"),
        (["k=1:2:*1.00000001"], "take a larger factor"),
        (["k=1:2:#1"], "a count of 2 or more"),
        (["k=1:2:#x"], "a count of 2 or more"),
        (["k=1:1:#3"], "are one"),
        (["k=5,6,5.0"], "5 is given twice"),
        (["k=0:1:0.0000000000000000000001"], "more digits than a number here can hold"),
        (["k=1:1000001"], "k=1:1000001: 1,000,001 values are more than the 1,000,000 points a sweep takes"),
        (["k=0:1:#1000001"], "1,000,001 values are more than"),
    ],
)
def test_nonsense_is_refused(texts: list[str], message: str) -> None:
    with pytest.raises(BusplanError, match=re.escape(message)):
        axes(texts)
