"""A question that was not asked is not answered by simulating."""

from typing import Never

import pytest

import busplan

NEVER_ROUND = {"servo.step_us": 4.0, "tolerance": {"max_contour_error_mm": 0.0}, "circle.feed_mm_per_min": 4000.0}
"""No circle holds it, so that a search for one that does has no end."""
HOSTILE = [
    ("ethercat-servo-8", {"cycle.period_us": 60.0}),
    ("paper-1ms", {"cycle.period_us": 200.0, "servo.loop": "host", "servo.update": "next_sync"}),
    ("can-servo-8", {"cycle.period_us": 1000.0}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "changes"), HOSTILE, ids=lambda value: value if isinstance(value, str) else "")
def test_no_circle_is_run_where_nobody_asked(
    name: str, changes: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_arguments: object, **_options: object) -> Never:
        raise AssertionError("a circle is simulated")

    monkeypatch.setattr("busplan.servo.circle.simulate_axis", refuse)
    profile = busplan.load_profile(name, changes={**NEVER_ROUND, **changes})
    with pytest.raises(AssertionError, match="a circle is simulated"):
        busplan.circle_test(profile, period_us=20_000.0)
    assert len(busplan.capacity(profile, period_us=[200.0, 2000.0], sensitivity=True).sensitivities) == 2
    assert busplan.check(profile, circle=False).files
    for question in (busplan.report, busplan.plan, busplan.compare, busplan.map_):
        assert str(question(profile))
    assert busplan.sweep(profile, vary={"cycle.period_us": [1000, 20_000]}).to_dict()["rows"]
