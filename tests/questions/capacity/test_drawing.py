"""The bars of what moves the margin: as long as their figures, to the side of their signs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.forms.charts import Lanes
from busplan.profile.shipped import load
from busplan.questions.capacity.sensitivity import Effect, Sensitivity, sensitivity_of
from busplan.questions.capacity.sensitivity_report import sensitivity_drawing
from busplan.questions.fit.network import network_of

BASE = sensitivity_of(network_of(load("paper-1ms").profile))
CHANGES_US = st.lists(st.floats(-1e6, 1e6).map(lambda us: round(us, 3)), min_size=1, max_size=9)


def bars(*changes_us: float | None, margin_us: float = 100.0) -> Lanes | None:
    effects = (Effect(f"change {at}", "", None, None, us, None, "") for at, us in enumerate(changes_us))
    found: Sensitivity = BASE._replace(effects=tuple(effects), now=BASE.now._replace(margin_corrected_us=margin_us))
    drawing = sensitivity_drawing(found)
    if drawing is None:
        return None
    (panel,) = drawing.panels
    assert isinstance(panel.plot, Lanes)
    return panel.plot


@given(CHANGES_US)
def test_a_bar_reaches_from_zero_to_its_figure_on_one_scale(changes_us: list[float]) -> None:
    plot = bars(*changes_us, None)
    if plot is None:
        assert not any(changes_us)
        return
    assert len(plot.lanes) == len(changes_us)
    for us, lane in zip(changes_us, plot.lanes, strict=True):
        assert [(span.start, span.end) for span in lane.spans] == ([(min(us, 0), max(us, 0))] if us else [])
        assert all(span.entry.ink == ("takes" if us < 0 else "hides") for span in lane.spans)
        assert lane.note == f"{us:+.3f} us".replace("+0.000", "0.000")
    assert (plot.across.low, plot.across.high) == (min(0, *changes_us), max(0, *changes_us))
    assert plot.guides[0].x == 0


@pytest.mark.parametrize(("margin_us", "at"), [(40.0, -40), (60.0, -60), (61.0, None), (0.0, None), (-5.0, None)])
def test_the_end_of_the_margin_is_drawn_where_a_bar_reaches_it(margin_us: float, at: float | None) -> None:
    plot = bars(-60.0, margin_us=margin_us)
    assert plot is not None
    assert [guide.x for guide in plot.guides if guide.entry.words] == ([] if at is None else [at])


def test_where_nothing_moves_nothing_is_drawn() -> None:
    assert bars(0.0, None) is None


def test_those_of_a_profile_are_its_effects() -> None:
    (panel,) = busplan.capacity("paper-1ms", sensitivity=True).drawing().panels
    assert isinstance(panel.plot, Lanes)
    made = [effect for effect in BASE.effects if effect.margin_change_us is not None]
    assert [lane.label for lane in panel.plot.lanes] == [effect.change for effect in made]
