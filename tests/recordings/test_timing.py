"""Timing of CAN logs, against counts over every window, and logs worked out by hand."""

from itertools import combinations
from math import floor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.recordings import can_timing
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.can_timing import ClockStretch, SentFrames
from busplan.recordings.canopen import Role, is_likely, role

ascending = st.lists(st.integers(0, 3000), min_size=1, max_size=25).map(lambda times: sorted(map(float, times)))


def log(folder: Path, frames: list[tuple[int, str]]) -> CanFrames:
    """Frames at some microseconds, in candump's form and in this order."""
    path = folder / "bus.log"
    path.write_text("".join(f"({1000 + us // 10**6}.{us % 10**6:06d}) can0 {frame}\n" for us, frame in frames))
    return read_can(path, progress=lambda *_: None)


def stretch_of(times_us: list[float]) -> ClockStretch:
    return ClockStretch(np.arange(len(times_us)), np.array(times_us, dtype=float), 0)


def messages(folder: Path, frames: list[tuple[int, str]]) -> dict[tuple[int, bool], SentFrames]:
    found = log(folder, frames)
    return dict(can_timing.frames_by_identifier(found, can_timing.longest_stretch(found)))


@given(times_us=ascending, period_us=st.integers(1, 400))
def test_an_event_model_allows_each_window_and_no_smaller_one_does(times_us: list[float], period_us: int) -> None:
    def allows(burst: int, jitter_us: float) -> bool:
        """Whether frames are allowed in each time that is a little longer than from their first to their last."""
        return all(
            last - first + 1 <= burst + floor((times_us[last] - times_us[first] + jitter_us) / period_us)
            for first, last in combinations(range(len(times_us)), 2)
        )

    model = can_timing.event_model(np.array(times_us), period_us, stamp_error_us=0, tolerance=0)
    assert allows(*model)
    assert model.burst == 1 or (model.jitter_us == 0 and not allows(model.burst - 1, 0))
    assert model.jitter_us == 0 or not allows(1, model.jitter_us - 1)
    # A period of jitter is no burst.
    assert model.burst == 1 or not allows(1, period_us)


def test_clocks_and_stamps_shorten_the_period_and_lengthen_the_jitter() -> None:
    times_us = np.array([0.0, 80, 200, 290])
    # A clock that is 10 % fast: 90 us behind the first, 180 behind it, 90 behind the third.
    assert can_timing.event_model(times_us, 100, stamp_error_us=1.5, tolerance=0.1) == (1, 12)
    assert can_timing.event_model(times_us, 100, stamp_error_us=0, tolerance=0) == (1, 20)
    # Four at once need three periods, or a little less by their clock.
    assert can_timing.event_model(np.zeros(4), 100, stamp_error_us=0, tolerance=0) == (4, 0)
    assert can_timing.event_model(np.zeros(4), 100, stamp_error_us=0, tolerance=0.5) == (3, 0)


@given(times_us=ascending.filter(lambda times: times[0] < times[-1]), unit=st.sampled_from([300.0, 1000.0]))
def test_the_load_of_a_second_is_that_of_the_frames_in_it(times_us: list[float], unit: float) -> None:
    times = np.array(times_us) * unit
    wire_us = np.array([100.0 + place % 7 for place in range(len(times))])
    loads = can_timing.second_loads(times, wire_us)
    if times[-1] - times[0] < 1e6:
        # Behind the first frame, which ends as the log begins.
        assert loads.tolist() == pytest.approx([(wire_us.sum() - wire_us[0]) / (times[-1] - times[0])])
    else:
        of_each = [wire_us[(times >= us) & (times < us + 1e6)] for us in times]
        # Of frames at one time each counts those behind it.
        first = {us: times_us.index(us) for us in times_us}
        expected = [
            some.sum() - wire_us[first[us] : place].sum()
            for place, (us, some) in enumerate(zip(times_us, of_each, strict=True))
        ]
        assert (loads * 1e6).tolist() == pytest.approx(expected)


@pytest.mark.parametrize(
    ("times_us", "step_us"),
    [
        ([0, 100, 200, 300], 1),  # periodic frames show no step
        ([0, 100, 250], 1),  # nor do two distances
        ([0, 100, 250, 450], 50),
        ([0, 10, 24, 40], 2),
        ([0, 0, 30, 60], 30),  # of two at once the step is seen
        ([0, 0, 0], 0),
    ],
)
def test_the_step_of_stamps_is_their_common_divisor(times_us: list[float], step_us: float) -> None:
    assert can_timing.step_us(stretch_of(times_us)) == step_us


@pytest.mark.parametrize(
    ("times_us", "taken", "steps_back", "sorted_us"),
    [
        ([0, 5, 9000, 9500], [0, 1, 2, 3], 0, 0),
        # A millisecond back is of another queue, and a little more a clock that was set back.
        ([9000, 8001, 9500], [1, 0, 2], 0, 0),
        ([9000, 7999, 9500, 9600], [1, 2, 3], 1, 0),
        ([0, 1, 2, 9000, 5000, 5001], [0, 1, 2, 3], 1, 0),
        ([10**9, 0, 1, 2, 10**6, 5], [1, 2, 3, 4], 2, 0),
        # Three steps back of up to half a second are queues, whose frames are sorted.
        ([0, 500_000, 0, 500_001, 100_000, 500_002, 2], [0, 2, 6, 4, 1, 3, 5], 0, 500_000),
        ([0, 3000, 1000, 6000, 4000, 9000, 7000], [0, 2, 1, 4, 3, 6, 5], 0, 2000),
        # Three longer ones are not, and for two clocks they come forward again too seldom.
        ([*[200_000 * place for place in (0, 1, 2, 3, 0, 1, 2, 3, 0, 0, 1, 2, 3, 0)]], [8, 9, 10, 11, 12], 3, 0),
    ],
)
def test_the_longest_stretch_of_a_clock_is_taken(
    times_us: list[int], taken: list[int], steps_back: int, sorted_us: float, tmp_path: Path
) -> None:
    frames = log(tmp_path, [(10**7 + us, "181#00") for us in times_us])
    found = can_timing.longest_stretch(frames)
    assert found.taken.tolist() == taken
    assert found.steps_back == steps_back
    assert found.sorted_us == pytest.approx(sorted_us, abs=0.5)
    assert found.times_us.tolist() == sorted(frames.times_us[found.taken].tolist())
    assert found.length_us == found.times_us[-1] - found.times_us[0]


def test_stamps_of_two_clocks_are_refused(tmp_path: Path) -> None:
    frames = log(tmp_path, [(10**7 + us, "181#00") for us in (0, 600_000, 0, 600_000, 0, 300_000, 600_000, 0)])
    words = "its stamps jump back 3 times by about 0.6 s, and forward again: they are those of two clocks; export the "
    with pytest.raises(BusplanError, match=words + "frames of each by themselves, and give one"):
        can_timing.longest_stretch(frames)


def test_what_is_wrong_with_a_log_is_said(tmp_path: Path) -> None:
    frames = log(tmp_path, [(us, "181#00") for us in (0, 10)])._replace(broken="a reason")
    stretch = stretch_of([0, 10])._replace(steps_back=2, sorted_us=1234.5)
    assert [*can_timing.faults(frames, stretch)] == [
        "The log is cut or damaged after frame 2, read up to there: a reason.",
        "Its clock was set back 2 times: the longest stretch between is used.",
        "Its frames are up to 1.23 ms out of order, as from several queues: sorted.",
    ]
    assert [*can_timing.faults(frames._replace(broken=""), stretch_of([0, 10]))] == []


@pytest.mark.parametrize(
    ("times_us", "is_periodic"),
    [
        ([10_000 * place for place in range(101)], True),
        ([10_000 * place for place in range(12)], False),  # a tenth of a second in a log of a second
        ([10_000 * place for place in range(120) if place % 12 != 5], True),  # 10 are missing of 110
        ([10_000 * place for place in range(120) if place % 11 != 5], False),  # 11 of 109
        ([10_000 * place + 2900 * (place % 2) for place in range(120)], True),  # 14.5 % about the mean
        ([10_000 * place + 3100 * (place % 2) for place in range(120)], False),  # 15.5 %
        ([10_000 * place for place in range(9)], False),  # too few
    ],
)
def test_a_message_is_periodic_where_its_frames_are_even_for_a_second(
    times_us: list[int], is_periodic: bool, tmp_path: Path
) -> None:
    frames = [(us, "181#00") for us in times_us] + [(us, "7FF#0011") for us in (0, 1_000_000)]
    found = messages(tmp_path, sorted(frames))
    assert [*found] == [(0x181, False), (0x7FF, False)]
    sent = found[0x181, False]
    assert (sent.periods is not None) == is_periodic
    assert sent.times_us.tolist() == pytest.approx(times_us, abs=0.5)
    if is_periodic and times_us[-1] == 1_190_000:
        # Lost frames count: 119 periods, and not 109.
        assert sent.mean.value == pytest.approx(10_000)
        assert sent.mean.uncertainty == pytest.approx(0, abs=0.1)
    elif not is_periodic:
        mean = (times_us[-1] - times_us[0]) / (len(times_us) - 1)
        assert sent.mean.value == pytest.approx(mean)
        assert sent.mean.uncertainty is None


def test_frames_are_by_identifier_with_what_any_of_them_has(tmp_path: Path) -> None:
    lines = ["181#00", "00000181#0011", "123##1001122", "123##0" + "00" * 8, "123#00", "124##100", "181#001122"]
    found = messages(tmp_path, [(100 * place, line) for place, line in enumerate(lines)])
    rows = {
        key: (sent.frames.tolist(), sent.most_bytes, sent.is_fd, sent.switches, sent.extended)
        for key, sent in found.items()
    }
    assert rows == {
        (0x123, False): ([2, 3, 4], 8, True, False, False),
        (0x124, False): ([5], 1, True, True, False),
        (0x181, False): ([0, 6], 3, False, True, False),
        (0x181, True): ([1], 2, False, True, True),
    }


# --- bit rates --------------------------------------------------------------------------------------------


def test_a_bit_rate_is_as_high_as_frames_need_that_do_not_overlap(tmp_path: Path) -> None:
    """A bus of 500 kbit/s, full: a frame each 2 us for each of its bits, which are not all alike."""
    lines = ["181#" + "55" * size for size in (8, 0, 3, 1)] * 30
    bits = log(tmp_path, [(place, line) for place, line in enumerate(lines)]).bits
    ends_us = np.cumsum(bits) * 2
    frames = log(tmp_path, [(int(us), line) for us, line in zip(ends_us, lines, strict=True)])
    stretch = can_timing.longest_stretch(frames)
    least = can_timing.least_bit_rate(frames, stretch)
    # Of 30 frames: the most bits of 30 behind the first, or before the last, in their time, a step and a delay.
    step_us = can_timing.step_us(stretch)
    assert step_us == 4
    sums = [
        (min(bits[at + 1 : at + 31].sum(), bits[at : at + 30].sum()), ends_us[at + 30] - ends_us[at])
        for at in range(len(bits) - 30)
    ]
    for found, late_us in ((least.likely, 100), (least.surely, 1000)):
        assert found == pytest.approx(max(1000 * sent / (us + step_us + late_us) for sent, us in sums))
    assert least.rates.max() == least.likely
    assert (len(least.rates), least.rates[-5:].tolist()) == (len(bits), [pytest.approx(least.rates[-5]), 0, 0, 0, 0])
    assert can_timing.possible_bit_rates(least) == [500, 800, 1000]
    assert can_timing.shown_bit_rate(frames, stretch, [250, 500, 800]) == 500
    assert can_timing.shown_bit_rate(frames, stretch, [250, 800]) is None
    can_timing.require_bit_rate(least.surely, least)
    with pytest.raises(BusplanError, match=rf"bit rate 250: frames of the log need at least {least.surely:.3g} kbit/s"):
        can_timing.require_bit_rate(250, least)
    assert can_timing.stamps_of_no_bus(1000) == ""
    assert can_timing.stamps_of_no_bus(1001).startswith("its frames need 1,001 kbit/s, more than a CAN bus has: the ")


@pytest.mark.parametrize(
    ("at_rate", "later", "shown"), [(10, 0, 500), (9, 0, None), (12, 3, 500), (12, 4, None), (12, 50, None)]
)
def test_a_bit_rate_is_shown_by_ten_frames_and_four_fifths_of_those_that_follow_closely(
    at_rate: int, later: int, shown: float | None, tmp_path: Path
) -> None:
    bits = int(log(tmp_path, [(0, "181#55")]).bits[0])
    # At 500 kbit/s a bit takes 2 us; a frame that comes 7 % later seems to be at 465 kbit/s.
    apart_us = [2 * bits] * at_rate + [round(2 * bits * 1.07)] * later
    frames = log(tmp_path, [(int(us), "181#55") for us in np.cumsum([0, *apart_us])])
    assert can_timing.shown_bit_rate(frames, can_timing.longest_stretch(frames), [500.0]) == shown


@pytest.mark.parametrize(
    ("times_us", "late_us"),
    [
        ([0, 100, 300, 400], 0),  # each as soon as the bus allows, or later
        ([0, 100, 250, 350], 50 + 200),  # one comes 50 us too soon, and may be as late as the longest frame
        ([0, 100, 200, 400], 0),  # stamps of the starts
        ([0, 51, 200, 401], 49 + 200),  # the second by its start
        ([0, 100, 299, 399], 1),  # by no more than a step of the stamps
    ],
)
def test_stamps_are_late_by_what_frames_come_closer_than_they_are_sent(times_us: list[float], late_us: float) -> None:
    """Of frames of 100, 100, 200 and 100 us."""
    wire_us = np.array([100.0, 100, 200, 100])
    assert can_timing.late_stamps_us(stretch_of(times_us), wire_us) == pytest.approx(late_us)


# --- CANopen ----------------------------------------------------------------------------------------------


def test_identifiers_have_the_names_of_the_predefined_connection_set(tmp_path: Path) -> None:
    """CiA 301, tables 39 and 40: names of the objects by function code, node-ID in the lower 7 bits."""
    nodes = {
        0x080: "emergency",
        0x180: "TPDO1",
        0x200: "RPDO1",
        0x280: "TPDO2",
        0x300: "RPDO2",
        0x380: "TPDO3",
        0x400: "RPDO3",
        0x480: "TPDO4",
        0x500: "RPDO4",
        0x580: "SDO answer",
        0x600: "SDO request",
        0x700: "heartbeat",
    }
    sizes = {"emergency": {8}, "SDO answer": {8}, "SDO request": {8}, "heartbeat": {1}}
    expected: dict[tuple[int, int], Role | None] = {}
    for base, name in nodes.items():
        for size in (0, 1, 7, 8):
            fits = size in sizes.get(name, range(9))
            expected |= {(base + node, size): Role(name, node) if fits else None for node in (1, 127)}
            if base != 0x80:
                expected[base, size] = None
    for identifier, name, most in ((0x000, "NMT", 2), (0x080, "SYNC", 1), (0x100, "TIME", 6)):
        expected |= {(identifier, size): Role(name, None) if size <= most else None for size in (0, most, most + 1)}
    expected |= {(identifier, 8): None for identifier in (0x001, 0x101, 0x681, 0x781, 0x7FF)}
    expected |= {(identifier, 0): None for identifier in (0x001, 0x101, 0x681)}
    for size in range(9):
        some = {identifier: what for (identifier, of), what in expected.items() if of == size}
        lines = [(100 * place, f"{identifier:03X}#{'00' * size}") for place, identifier in enumerate(some)]
        found = messages(tmp_path, lines) if lines else {}
        assert {identifier: role(sent) for (identifier, _), sent in found.items()} == some
    others = messages(tmp_path, [(0, "00000181#0011"), (1, "181##00011"), (2, "182#00")])
    assert [role(sent) for sent in others.values()] == [None, None, Role("TPDO1", 2)]


@pytest.mark.parametrize(
    ("lines", "is_canopen"),
    [
        (["080#"], True),
        (["080#0011"], False),  # two bytes are no counter
        (["181#00", "201#00", "000#0101"], False),
        (["705#05", "705#7F", "705#84"], True),  # with the toggle bit of node guarding
        (["705#00"], True),
        (["705#05", "705#06"], False),  # 6 is no state
        (["585#" + "00" * 8, "605#" + "00" * 8], True),
        (["585#" + "00" * 8, "606#" + "00" * 8], False),  # of two nodes
        (["605#" + "00" * 8], False),
        (["585#" + "00" * 8], False),
    ],
)
def test_a_log_is_canopen_by_its_sync_its_states_or_an_answered_sdo(
    lines: list[str], is_canopen: bool, tmp_path: Path
) -> None:
    frames = log(tmp_path, [(100 * place, line) for place, line in enumerate(lines)])
    found = can_timing.frames_by_identifier(frames, can_timing.longest_stretch(frames))
    assert is_likely(found.values(), frames) == is_canopen
