"""A log becomes a plan that covers it: no window has more frames than the plan allows, and little more load is planned.

The oracle counts the frames of every window, and shares no code with busplan.
"""

import re
from bisect import bisect_left
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import accumulate
from pathlib import Path
from random import Random
from typing import Any, Final

import pytest

import busplan
from tests.registers import at_least

BIT_RATE: Final = 500
SPANS_S: Final = (0.4, 1.3, 3, 10, 40)
MOST_FRAMES: Final = 250
"""Of an identifier, for the oracle counts every window."""
Times = list[int]
"""Stamps of an identifier, ascending [us]."""


def bits(data_bytes: int, *, is_extended: bool) -> int:
    """Most bits of a frame of 11 or 29 bits of identifier: Davis et al. 2007, equations (2) and (3)."""
    return 80 + 10 * data_bytes if is_extended else 55 + 10 * data_bytes


def periodic(random: Random, span_us: int) -> Iterator[float]:
    period_us, jitter = random.choice([10, 20, 33.3, 100, 1000]) * 1000, random.choice([0, 0.01, 0.2, 1.5])
    starts = [random.uniform(0, period_us)]
    while starts[-1] < span_us:
        starts.append(starts[-1] + period_us)
    yield from (start + random.uniform(0, jitter * period_us) for start in starts)


def lost(random: Random, span_us: int) -> Iterator[float]:
    share = random.choice([0.02, 0.1, 0.5])
    yield from (us for us in periodic(random, span_us) if random.random() > share)


def events(random: Random, span_us: int) -> Iterator[float]:
    us, mean_us = 0.0, random.choice([2e3, 2e4, 3e5, 5e6])
    while us < span_us:
        us += random.expovariate(1 / mean_us)
        yield us


def bursts(random: Random, span_us: int) -> Iterator[float]:
    number, apart_us, mean_us = (
        random.randint(2, 40),
        random.choice([300, 1000, 10_000]),
        random.choice([2e5, 2e6, 3e7]),
    )
    us = random.uniform(0, mean_us)
    while us < span_us:
        yield from (us + place * apart_us for place in range(number))
        us += number * apart_us + random.choice([mean_us, random.expovariate(1 / mean_us)])


def starts_and_stops(random: Random, span_us: int) -> Iterator[float]:
    us = random.uniform(0, span_us / 2)
    while us < span_us:
        end_us = us + random.uniform(0.01, 1) * span_us / random.choice([1, 10])
        each = random.choice([periodic, events])
        yield from (us + time_us for time_us in each(random, int(end_us - us)) if us + time_us < end_us)
        us = end_us + random.uniform(0, span_us / 2)


def once(random: Random, span_us: int) -> Iterator[float]:
    yield random.uniform(0, span_us)


SORTS: Final[dict[str, tuple[Callable[[Random, int], Iterator[float]], ...]]] = {
    "periodic": (periodic,),
    "lost frames": (lost,),
    "event-driven": (events,),
    "bursts": (bursts,),
    "starts and stops": (starts_and_stops,),
    "mixtures": (periodic, lost, events, bursts, starts_and_stops, once),
}


def traffic(sort: str, seed: int) -> dict[int, Times]:
    """Stamps of some identifiers, no two frames of the bus at one time."""
    random = Random(f"{sort} {seed}")
    span_us = int(random.choice(SPANS_S) * 1e6)
    times: dict[int, Times] = {}
    taken: set[int] = set()
    for identifier in random.sample(range(0x10, 0x7F0), random.randint(1, 12)):
        each: Times = []
        for us in sorted(random.choice(SORTS[sort])(random, span_us)):
            stamp = int(us)
            while stamp in taken:
                stamp += 1
            if us < span_us and len(each) < MOST_FRAMES:
                taken.add(stamp)
                each.append(stamp)
        if each:
            times[identifier] = sorted(each)
    # Of fewer frames there is no plan.
    return times if max(map(len, times.values()), default=0) >= 10 else traffic(sort, seed + 10_000)


def log_of(times: dict[int, Times]) -> str:
    rows = sorted((us, identifier) for identifier, each in times.items() for us in each)
    return "".join(
        f"({1_700_000_000 + us // 10**6}.{us % 10**6:06d}) can0 {identifier:03X}#{'5A' * (identifier % 9)}\n"
        for us, identifier in rows
    )


def messages_of(answer: busplan.ImportAnswer) -> dict[int, Any]:
    profile: Any = answer.profile
    return {message.identifier: message for message in profile.message}


def uncovered(message: Any, times: Times) -> list[tuple[int, int]]:
    """Windows with more frames than b - 1 + ceil((w + J) / T): number of frames, and what just holds them [us].

    Counted in nanoseconds, the last digit of a profile's period.
    """
    period, jitter = (round(us * 1000) for us in (message.period_us, message.jitter_us))
    found = []
    for first, start in enumerate(times):
        for number, end in enumerate(times[first:], start=1):
            # A window just longer than from the first of them to the last.
            allowed = message.burst + ((end - start) * 1000 + jitter) // period
            if number > allowed:
                found.append((number, end - start))
    return found


def fullest_bits(times: dict[int, Times], most_bits: dict[int, int]) -> Fraction:
    """Bits of the fullest second per second, or of a log of less, whose first frame ended with its stamp."""
    rows = sorted((us, most_bits[identifier]) for identifier, each in times.items() for us in each)
    stamps = [us for us, _ in rows]
    sent = [0, *accumulate(each for _, each in rows)]
    span_us = stamps[-1] - stamps[0]
    if span_us < 10**6:
        return Fraction((sent[-1] - rows[0][1]) * 10**6, span_us)
    return Fraction(max(sent[bisect_left(stamps, us + 10**6)] - sent[place] for place, us in enumerate(stamps)))


def imported(times: dict[int, Times], folder: Path) -> busplan.ImportAnswer:
    (folder / "drive.log").write_text(log_of(times), encoding="utf-8")
    return busplan.import_profile(folder / "drive.log", bit_rate_kbit_s=BIT_RATE)


def ratio_of(answer: busplan.ImportAnswer, times: dict[int, Times]) -> float:
    """Load of the plan by that of the fullest second."""
    messages = messages_of(answer)
    most_bits = {identifier: bits(message.payload_bytes, is_extended=False) for identifier, message in messages.items()}
    planned = sum(
        most_bits[identifier] / Fraction(str(each.period_us)) * 10**6 for identifier, each in messages.items()
    )
    return float(planned / fullest_bits(times, most_bits))


def of_own_seconds(answer: busplan.ImportAnswer, times: dict[int, Times]) -> float:
    """Load of the fullest second of each identifier by itself, all together, by that of the fullest of all."""
    most_bits = {
        identifier: bits(each.payload_bytes, is_extended=False) for identifier, each in messages_of(answer).items()
    }
    own = (
        max(bisect_left(each, us + 10**6) - place for place, us in enumerate(each)) * most_bits[identifier]
        for identifier, each in times.items()
    )
    return float(sum(own) / fullest_bits(times, most_bits))


def require_covered(answer: busplan.ImportAnswer, times: dict[int, Times]) -> None:
    messages = messages_of(answer)
    found = {identifier: uncovered(messages[identifier], each) for identifier, each in times.items()}
    assert found == {identifier: [] for identifier in times}


@pytest.mark.parametrize("seed", range(at_least(1)))
@pytest.mark.parametrize("sort", SORTS)
def test_the_plan_of_a_log_allows_every_window_and_little_more_load(sort: str, seed: int, tmp_path: Path) -> None:
    times = traffic(sort, seed)
    answer = imported(times, tmp_path)
    require_covered(answer, times)
    apart = any("messages coincide that the log has at different times" in remark for remark in answer.remarks)
    assert apart == (ratio_of(answer, times) > 1.2)
    # No other reason for more load: each in its own fullest second, they would load the bus so much.
    assert not apart or of_own_seconds(answer, times) > 1.2
    assert busplan.measured(answer.profile, tmp_path / "drive.log").outside == ()


def full_for_a_while(random: Random) -> dict[int, Times]:
    """A bus full for 1.5 s, and nearly silent for 30."""
    times: dict[int, Times] = {identifier: [] for identifier in range(0x100, 0x11E)}
    for number in range(6000):
        times[random.choice(list(times))].append(number * 250)
    return {**times, 0x700: [1_500_500 + number * 10**6 for number in range(30)]}


def seldom(random: Random) -> dict[int, Times]:
    """Many events in a minute, of which each comes now and then, in twos or threes."""
    times = {}
    for identifier in range(0x10, 0x38):
        starts = sorted(random.randrange(60 * 10**6) for _ in range(10))
        times[identifier] = [us + near * 1000 for us in starts for near in range(random.randint(2, 3))]
    return {identifier: sorted(each) for identifier, each in times.items()}


CASES: Final[dict[str, tuple[Callable[[Random], dict[int, Times]], float]]] = {
    "one burst of twenty": (
        lambda _: {0x10: [k * 100_000 for k in range(300)], 0x20: [20_000_300 + k * 1000 for k in range(20)]},
        0.3,
    ),
    "on for three seconds": (
        lambda _: {0x10: [k * 100_000 for k in range(300)], 0x20: [20_000_300 + k * 10_000 for k in range(300)]},
        0.98,
    ),
    "five, and a second of silence": (
        lambda _: {0x10: [s * 10**6 + k * 700 for s in range(20) for k in range(5)]},
        0.8,
    ),
    "full for 1.5 s": (full_for_a_while, 0.85),
    "seldom": (seldom, 0.2),
    "two modes": (lambda _: {0x10 + n: [n * 2 * 10**6 + k * 2000 for k in range(600)] for n in range(2)}, 1.9),
}


@pytest.mark.parametrize("case", CASES)
def test_what_was_recorded_for_a_while_is_planned_with_the_load_of_its_fullest_second(
    case: str, tmp_path: Path
) -> None:
    make, least = CASES[case]
    times = make(Random(1))
    answer = imported(times, tmp_path)
    require_covered(answer, times)
    assert least <= ratio_of(answer, times) <= (2 if case == "two modes" else 1.2)
    (said,) = (remark for remark in answer.remarks if remark.startswith("The plan has a load of "))
    loads = [float(number) for number in re.findall(r"([\d.]+) %", said)]
    assert loads[0] / loads[1] == pytest.approx(ratio_of(answer, times), rel=0.02)
    start_us = min(map(min, times.values()))
    seconds = {(us - start_us) // 10**6 for each in times.values() for us in each}
    assert f"; {len(seconds)} of its {max(seconds) + 1} s have frames" in said


def test_a_short_row_beside_a_busy_bus_is_a_burst(tmp_path: Path) -> None:
    """As a period for ever, its load would be little beside that of the others."""
    times = {0x10: [k * 10_000 for k in range(1000)], 0x20: [k * 10_000 + 300 for k in range(1000)]}
    answer = imported({**times, 0x30: [4_000_700 + k * 30_000 for k in range(20)]}, tmp_path)
    message = messages_of(answer)[0x30]
    # The last comes behind a period of 500 ms.
    assert (message.burst, message.deadline_us) == (19, "none")
    assert message.period_us == pytest.approx(9_990_000 / 20, rel=0.01)


def test_a_period_of_a_database_covers_the_log_too(tmp_path: Path) -> None:
    """A longer one by little, which counts as the same, and a shorter one."""
    random = Random(4)
    for period_ms, recorded_us in ((100, 99_000), (50, 100_000)):
        times = {0x101: [round(k * recorded_us + random.uniform(0, 3e4)) for k in range(300)]}
        log, base = tmp_path / "drive.log", tmp_path / "car.dbc"
        log.write_text(log_of(times))
        base.write_text(
            'VERSION ""\nBO_ 257 Engine: 8 ECU\nBA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\n'
            f'BA_DEF_DEF_ "GenMsgCycleTime" 0;\nBA_ "GenMsgCycleTime" BO_ 257 {period_ms};\n'
        )
        answer = busplan.import_profile([log, base], bit_rate_kbit_s=BIT_RATE)
        assert messages_of(answer)[0x101].period_us == period_ms * 1000
        require_covered(answer, times)
