"""What the card says of settings that are free to change is true, and nothing better of them is."""

from itertools import product
from typing import Any

import pytest

import busplan
from tests.registers import shipped_of_each_kind

CYCLES = [name for name in shipped_of_each_kind() if busplan.load_profile(name).has_cycle]


def lines(profile: Any) -> dict[str, str]:
    card = str(busplan.capacity(profile)).partition("\n\n")[0]
    return {line[2:18].strip(): line[18:].strip() for line in card.splitlines()[2:]}


def fits(profile: Any, **changes: Any) -> bool:
    return busplan.capacity(busplan.load_profile(profile, changes=changes)).fits


def registers(name: str) -> list[dict[str, Any]]:
    """Values of keys that are a number in the nodes, by the manual: gap count, shift of SYNC0, PDOs of each axis."""
    kind = busplan.load_profile(name).bus.kind
    if kind == "ethercat":
        return [{"bus.sync_shift": tenths / 10} for tenths in range(1, 10)]
    return (
        [{"bus.gap_count": count} for count in range(0, 64, 3)] + [{"bus.gap_count": 7}] if kind == "ieee1394" else []
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper-dma", "paper-1ms", "ethercat-servo-8"])
def test_the_best_setting_is_the_best_of_all(name: str) -> None:
    answer = busplan.capacity(name)
    best = answer.verdicts[0].best_register
    assert best is not None
    assert fits(name, **best.changes, **{"cycle.period_us": 1.0001 * best.period_us})
    assert not fits(name, **best.changes, **{"cycle.period_us": 0.99 * best.period_us})
    safe = [
        changes
        for changes in registers(name)
        if busplan.capacity(busplan.load_profile(name, changes=changes)).verdicts[0].deciding.safe
    ]
    assert [one for one in safe if fits(name, **one, **{"cycle.period_us": 0.994 * best.period_us})] == []
    assert any(fits(name, **one, **{"cycle.period_us": 1.006 * best.period_us}) for one in safe)


@pytest.mark.parametrize("name", CYCLES)
def test_a_setting_is_named_only_where_it_is_worth_it(name: str) -> None:
    verdict = busplan.capacity(name).verdicts[0]
    said = lines(name)["fastest period"]
    assert ("; " in said) == (verdict.best_register is not None)
    if verdict.best_register and verdict.fastest and verdict.fastest.us:
        assert verdict.best_register.period_us < 0.99 * verdict.fastest.us


@pytest.mark.parametrize(("nodes", "period_us"), [*product((8, 14, 20), (250, 320, 400))])
def test_an_axis_too_many_for_a_default_shift_is_told_the_shift(nodes: int, period_us: int) -> None:
    changes = {"bus.nodes": nodes, "cycle.period_us": period_us}
    said = lines(busplan.load_profile("ethercat-servo-8", changes=changes))
    assert "bus.sync_shift = 0." in said["fastest period"]


def test_a_free_bit_rate_stands_before_a_longer_period() -> None:
    profile = busplan.load_profile("canopen-6", changes={"bus.bit_rate_kbit_s": 500})
    said = lines(profile)
    assert said["cure"].startswith("bus.bit_rate_kbit_s = 1000")
    assert "cycle.period_us" not in said["cure"]
    assert fits(profile, **{"bus.bit_rate_kbit_s": 1000})
    assert not fits(profile, **{"bus.bit_rate_kbit_s": 800})
    # Where no bit rate is enough alone, the period beside it is shorter than without.
    fast = busplan.load_profile(profile, changes={"cycle.period_us": 2000})
    assert not fits(fast, **{"bus.bit_rate_kbit_s": 1000})
    assert lines(fast)["cure"].startswith("cycle.period_us = 4170, bus.bit_rate_kbit_s = 1000 (")
    assert fits(fast, **{"cycle.period_us": 4170, "bus.bit_rate_kbit_s": 1000})
    assert not fits(fast, **{"cycle.period_us": 4160, "bus.bit_rate_kbit_s": 1000})
