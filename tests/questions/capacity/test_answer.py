"""The answer of `capacity` in Python: the verdict on a single period at the top."""

import pytest

import busplan


@pytest.mark.parametrize(
    ("period_us", "verdict", "margin_us"),
    [(4000, "fits", 1730.1), (540, "not shown to fit", 0.1), (500, "does not fit", -20.0)],
)
def test_a_single_period_has_its_verdict_at_the_top(period_us: float, verdict: str, margin_us: float) -> None:
    answer = busplan.capacity("paper-4ms", period_us=period_us)
    assert (answer.verdict, answer.fits) == (verdict, verdict == "fits")
    assert answer.margin_us == answer.verdicts[0].deciding.margin_corrected_us
    assert answer.margin_us == pytest.approx(margin_us, abs=0.1)


def test_several_periods_have_no_single_verdict() -> None:
    answer = busplan.capacity("paper-4ms", period_us=[500, 1000])
    for name in ("verdict", "fits", "margin_us"):
        with pytest.raises(
            busplan.BusplanError, match=r"^2 periods have no single verdict: each has its own, as verdicts"
        ):
            getattr(answer, name)
