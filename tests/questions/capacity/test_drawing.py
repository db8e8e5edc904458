"""The bars of what moves the margin: as long as their figures, to the side of their signs."""

import re
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.capacity.sensitivity import Effect, Sensitivity, sensitivity
from busplan.questions.capacity.sensitivity_report import SensitivityDrawing

SVG = "{http://www.w3.org/2000/svg}"
BASE = sensitivity(load("paper-1ms").profile)
CHANGES_US = st.lists(st.floats(-1e6, 1e6).map(lambda us: round(us, 3)), min_size=1, max_size=9)


def found(*changes_us: float | None, margin_us: float = 100.0) -> Sensitivity:
    effects = (Effect(f"change {at}", "", None, None, us, None, "") for at, us in enumerate(changes_us))
    now = BASE.now._replace(margin_corrected_us=margin_us)
    return BASE._replace(effects=tuple(effects), now=now)


def bars(root: ET.Element) -> list[tuple[float, float, str]]:
    """Start and width in percent, and class, of each bar."""
    return [
        (float(rect.get("x", "")[:-1]), float(rect.get("width", "")[:-1]), rect.get("class", ""))
        for rect in root.iter(f"{SVG}rect")
    ]


def test_bars_are_on_one_scale_left_and_right_of_zero() -> None:
    root = ET.fromstring(SensitivityDrawing(found(-60.0, 20.0, -10.0, 0.0, None)).svg() or "")
    assert bars(root) == [(0, 75, "takes"), (75, 25, "hides"), (62.5, 12.5, "takes"), (75, 0, "hides")]
    words = [text.text for text in root.iter(f"{SVG}text")]
    assert words[:4] == ["change 0", "-60.000 us", "change 1", "+20.000 us"]
    assert "change 4" not in words
    assert [line.get("x1") for line in root.iter(f"{SVG}line") if line.get("class") == "zero"] == ["75%"]


@pytest.mark.parametrize(
    ("margin_us", "at"), [(40.0, "33.333%"), (60.0, "0%"), (61.0, None), (0.0, None), (-5.0, None)]
)
def test_the_end_of_the_margin_is_drawn_where_a_bar_reaches_it(margin_us: float, at: str | None) -> None:
    drawn = SensitivityDrawing(found(-60.0, margin_us=margin_us))
    root = ET.fromstring(drawn.svg() or "")
    assert drawn.shows_the_end == (at is not None)
    ends = [line.get("x1") for line in root.iter(f"{SVG}line") if line.get("class") == "edge"]
    assert ends == ([at] if at else [])


@given(changes_us=CHANGES_US, width=st.integers(20, 200))
def test_in_characters_each_bar_is_as_long_as_its_share(changes_us: list[float], width: int) -> None:
    lines = SensitivityDrawing(found(*changes_us)).characters(width)
    if not any(changes_us):
        assert lines is None
        return
    assert lines is not None
    assert len({len(line.text) for line in lines}) == 1
    assert len(lines[0].text) <= max(width, 45)
    span = max(0.0, *changes_us) - min(0.0, *changes_us)
    columns = len(lines[0].text) - len("change 0") - max(len(line.text.split()[-1]) for line in lines) - 5
    for us, line in zip(changes_us, lines, strict=True):
        bar = re.search(r"(-*)\|(\+*)", line.text)
        assert bar is not None
        assert bool(bar[1]) == (us < 0)
        assert bool(bar[2]) == (us > 0)
        assert len(bar[1] + bar[2]) == pytest.approx(abs(us) / span * columns, abs=2.1)
    # Zero is in one column.
    assert len({line.text.index("|") for line in lines}) == 1


def test_where_nothing_moves_nothing_is_drawn() -> None:
    drawn = SensitivityDrawing(found(0.0, None))
    assert (drawn.is_empty, drawn.svg(), drawn.characters(80)) == (True, None, None)


def test_those_of_a_profile_are_its_effects() -> None:
    one = sensitivity(override(load("paper-1ms").profile, {"bus.gap_count": 8}))
    lines = SensitivityDrawing(one).characters(80) or []
    made = [effect for effect in one.effects if effect.margin_change_us is not None]
    assert [line.text.split("  ")[0].strip() for line in lines] == [effect.change for effect in made]
    assert [float(line.text.split()[-1]) for line in lines] == [
        pytest.approx(effect.margin_change_us, abs=0.0005) for effect in made
    ]
    assert max(len(line.text) for line in lines) <= 80
