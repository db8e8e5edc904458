"""How far each quantity may grow: what it names fits, and a little more breaks what it names."""

from typing import Any

import pytest

import busplan
from busplan.questions.capacity.sensitivity import Reach
from tests.registers import shipped_of_each_kind

CYCLES = [name for name in shipped_of_each_kind() if busplan.load_profile(name).has_cycle]


def grown(profile: Any, reach: Reach, value: float) -> Any:
    """The profile with a quantity at a value, from the profile's own keys."""
    if reach.key != "execution":
        return busplan.load_profile(profile, changes={reach.key: value})
    changes: dict[str, Any] = {}
    for group in profile.node_groups:
        execution, key = group.node.execution, group.node_key("execution")
        names = ("time_us",) if execution.kind == "table" else ("base_us", "per_byte_us")
        for name in names:
            own = getattr(execution, name)
            changes[f"{key}.{name}"] = [value * us for us in own] if isinstance(own, tuple) else value * own
    return busplan.load_profile(profile, changes=changes)


def broken(profile: Any) -> set[str]:
    """What is not shown to be kept: limits, time, or the safety of a setting."""
    figures = busplan.capacity(profile).verdicts[0].deciding
    if figures.verdict == "fits":
        return set() if figures.safe else {"unsafe"}
    return {*figures.exceeded, *(figures.not_shown or ())}


@pytest.mark.slow
@pytest.mark.parametrize("name", CYCLES)
def test_what_it_names_fits_and_a_little_more_does_not(name: str) -> None:
    profile = busplan.load_profile(name)
    (sensitivity,) = busplan.capacity(profile, sensitivity=True).sensitivities
    assert sensitivity.reaches
    for reach in sensitivity.reaches:
        assert not broken(grown(profile, reach, reach.most)), reach
        if not reach.limited_by:
            assert reach.most >= 1e6 or _is_refused(profile, reach)
            continue
        beyond = reach.most + 1 if isinstance(reach.most, int) else reach.most * 1.012 + 1e-6
        now = broken(grown(profile, reach, beyond))
        assert now, reach
        assert set(reach.limited_by) & now or now == {"unsafe"}, reach


def _is_refused(profile: Any, reach: Reach) -> bool:
    with pytest.raises(busplan.BusplanError):
        grown(profile, reach, 2 * reach.most)
    return True


def test_execution_that_is_not_on_the_bus_breaks_sync0() -> None:
    """The drives of EtherCAT compute beside the bus, until SYNC0 comes too soon, or the node is too slow."""
    (sensitivity,) = busplan.capacity("ethercat-servo-8", sensitivity=True).sensitivities
    by_key = {reach.key: reach for reach in sensitivity.reaches}
    assert by_key["execution"].limited_by == ("sync0",)
    assert by_key["bus.master_jitter_us"].limited_by == ("sync0",)
    assert by_key["bus.nodes"].most == busplan.capacity("ethercat-servo-8").results[0].safe_nodes


def test_a_plan_that_does_not_fit_has_no_reach() -> None:
    (sensitivity,) = busplan.capacity("paper-1ms", period_us=300, sensitivity=True).sensitivities
    assert sensitivity.reaches == ()
