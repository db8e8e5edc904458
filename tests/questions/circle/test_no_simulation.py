"""A question that was not asked is not answered by simulating."""

from typing import Never

import pytest
from busplan.questions.plan.planning import plan
from busplan.questions.report.all_answers import all_answers

from busplan.gate.gate import check_document
from busplan.profile.document import Document
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.profile.write import profile_text
from busplan.questions.capacity.sensitivity import sensitivities
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.compare.kinds import compare
from busplan.questions.fit.figures import capacity
from busplan.sections.profile import Profile

NEVER_ROUND = {"servo.step_us": 1.0, "tolerance": {"max_contour_error_mm": 0.0}, "circle.feed_mm_per_min": 4000.0}
"""No circle holds it, so that a search for one that does has no end."""
HOSTILE = [
    override(load("ethercat-servo-8").profile, {**NEVER_ROUND, "cycle.period_us": 60.0}),
    override(
        load("paper-1ms").profile,
        {**NEVER_ROUND, "cycle.period_us": 200.0, "servo.loop": "host", "servo.update": "next_sync"},
    ),
    override(load("can-servo-8").profile, {**NEVER_ROUND, "cycle.period_us": 1000.0}),
]


@pytest.mark.parametrize("profile", HOSTILE, ids=lambda one: f"{one.name}-{one.cycle.period_us:g}")
def test_no_circle_is_run_where_nobody_asked(profile: Profile, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_options: object) -> Never:
        raise AssertionError("a circle is simulated")

    monkeypatch.setattr("busplan.servo.circle.simulate_axis", refuse)
    result = capacity(profile, periods_us=[profile.cycle.period_us, 2000.0])
    assert len(verdicts(result)) == len(sensitivities(result)) == 2
    assert all_answers(profile, with_circle=False).circle is None
    assert check_document(Document("a.toml", profile_text(profile)), with_circle=False).status
    assert plan(profile).options
    assert compare(profile).compared
