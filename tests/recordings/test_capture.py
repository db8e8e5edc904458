"""Files of captures: all forms of stamps, what stands between, and files that are cut or damaged."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.recordings.ethercat import EthercatFrames, read_ethercat
from busplan.recordings.statistics import grid, lateness, quantile
from tests.oracles.ethercat_recording import Machine, ethernet, pcap, pcapng, simulated, statistics

MACHINE = Machine()
PACKETS = simulated(MACHINE, 40)


def read(content: bytes, tmp_path: Path) -> EthercatFrames:
    path = tmp_path / "capture"
    path.write_bytes(content)
    return read_ethercat(path, progress=lambda _done, _total: None)


FORMS = {
    **{
        f"pcap {order} {nano}": (pcap(PACKETS, order=order, nano=nano), 1 if nano else 1000)
        for order in "<>"
        for nano in (True, False)
    },
    **{
        f"pcapng {order} {resolution}": (pcapng(PACKETS, order=order, resolution=resolution), step)
        for order in "<>"
        for resolution, step in ((9, 1), (6, 1000), (None, 1000), (8, 10))
    },
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_has_the_same_stamps_to_its_step(form: str, tmp_path: Path) -> None:
    content, step_ns = FORMS[form]
    frames = read(content, tmp_path)
    exact = np.array([round(time * 1000) for time, _ in PACKETS])
    assert len(frames.times_ns) == len(PACKETS)
    assert np.array_equal(frames.times_ns - 1_700_000_000 * 10**9, exact // step_ns * step_ns)
    assert frames.returned.tolist() == [packet[6] & 2 != 0 for _, packet in PACKETS]
    assert [part.data_bytes for part in frames.layouts[frames.layout[0]]] == [80, 8]


def test_stamps_in_binary_fractions(tmp_path: Path) -> None:
    content = pcapng(PACKETS[:2], start_s=0)
    # Of 2^-9 s instead of 10^-9 s.
    frames = read(content.replace(b"\x09\x00\x01\x00\x09", b"\x09\x00\x01\x00\x89"), tmp_path)
    assert frames.times_ns[0] == round(PACKETS[0][0] * 1000) * 10**9 // 2**9


def test_tags_and_other_protocols(tmp_path: Path) -> None:
    tagged = ethernet(MACHINE.datagrams, index=1, counters=MACHINE.counters, tag=b"\x81\x00\x00\x05")
    twice = ethernet(MACHINE.datagrams, index=1, counters=MACHINE.counters, tag=b"\x88\xa8\x00\x05\x81\x00\x00\x05")
    plain = ethernet(MACHINE.datagrams, index=1, counters=MACHINE.counters)
    others = [b"\xff" * 12 + b"\x08\x00" + bytes(46), b"", b"\xff" * 13, plain[:14] + b"\x10\x40" + plain[16:]]
    frames = read(
        pcapng([(float(time), packet) for time, packet in enumerate([tagged, *others, twice, plain])]), tmp_path
    )
    assert (len(frames.times_ns), frames.others, len(frames.layouts)) == (3, 4, 1)


@given(st.integers(0, 4000), st.booleans())
def test_a_file_may_end_anywhere(tmp_path_factory: pytest.TempPathFactory, end: int, is_ng: bool) -> None:
    whole = pcapng(PACKETS) if is_ng else pcap(PACKETS)
    try:
        frames = read(whole[:end], tmp_path_factory.mktemp("cut"))
    except BusplanError:
        assert end < 400
        return
    assert np.array_equal(
        frames.times_ns, read(whole, tmp_path_factory.mktemp("whole")).times_ns[: len(frames.times_ns)]
    )
    assert frames.notes.broken_at is None or frames.notes.broken_at <= end


@given(st.integers(24, 3000), st.binary(min_size=1, max_size=40), st.booleans())
def test_damage_is_no_failure_of_the_program(
    tmp_path_factory: pytest.TempPathFactory, at: int, damage: bytes, is_ng: bool
) -> None:
    whole = pcapng(PACKETS) if is_ng else pcap(PACKETS)
    try:
        read(whole[:at] + damage + whole[at + len(damage) :], tmp_path_factory.mktemp("damaged"))
    except BusplanError:
        return


def test_a_cut_file_says_where(tmp_path: Path) -> None:
    content = pcapng(PACKETS)
    frames = read(content[:-10], tmp_path)
    assert len(frames.times_ns) == len(PACKETS) - 1
    size = 32 + len(PACKETS[-1][1]) + -len(PACKETS[-1][1]) % 4
    assert frames.notes.broken_at == len(content) - size
    assert read(content, tmp_path).notes.broken_at is None


def test_an_interface_that_is_no_ethernet_is_left_out(tmp_path: Path) -> None:
    link = pcapng([])[28:]
    content = pcapng([])[:28] + link.replace(b"\x01\x00\x00\x00", b"\x69\x00\x00\x00", 1)
    both = content.replace(link[8:10], b"\x69\x00", 0) + pcapng(PACKETS)[28 + len(link) :]
    assert link[8:10] == b"\x01\x00"
    other = both[:36] + b"\x69\x00" + both[38:]
    with pytest.raises(BusplanError, match="no whole EtherCAT frame"):
        read(other, tmp_path)
    with pytest.raises(BusplanError, match="link type 105, expected 1, Ethernet"):
        read(pcap(PACKETS)[:20] + b"\x69\x00\x00\x00", tmp_path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_packets_that_the_recorder_dropped_are_counted(order: str, tmp_path: Path) -> None:
    content = pcapng(PACKETS, order=order)
    assert read(content, tmp_path).notes.dropped == 0
    for code, counted in ((5, 12), (7, 12), (4, 0)):
        assert read(content + statistics(code, 12, order=order), tmp_path).notes.dropped == counted
    # Statistics count from the start on: the last ones count.
    both = content + statistics(5, 3, order=order) + statistics(5, 12, order=order)
    assert read(both, tmp_path).notes.dropped == 12
    before = pcapng(PACKETS, order=order, dropped_before={3: 2, 20: 5})
    assert read(before, tmp_path).notes.dropped == 7
    assert len(read(before, tmp_path).times_ns) == len(PACKETS)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=200), st.floats(0.5, 1))
def test_a_quantile_is_not_exceeded_by_its_share(values: list[float], share: float) -> None:
    found = quantile(np.array(values), share)
    assert found.value in values
    assert sum(value <= found.value for value in values) >= share * len(values) - 1e-6
    assert sum(value < found.value for value in values) < share * len(values) + 1e-6


def test_the_uncertainty_of_a_quantile_is_what_repetitions_scatter() -> None:
    random = np.random.default_rng(2)
    found = [quantile(random.exponential(10, 2000), 0.95) for _ in range(300)]
    scatter = float(np.std([each.value for each in found]))
    assert np.mean([each.uncertainty for each in found]) == pytest.approx(scatter, rel=0.15)
    medians = [quantile(random.normal(0, 3, 400), 0.5) for _ in range(300)]
    assert np.mean([each.uncertainty for each in medians]) == pytest.approx(
        np.std([each.value for each in medians]), rel=0.15
    )


@given(st.integers(1, 10**6), st.floats(0.01, 0.15), st.integers(50, 3000), st.integers(0, 5))
def test_a_period_is_found_whatever_is_missing(seed: int, scatter: float, count: int, missing: int) -> None:
    random = np.random.default_rng(seed)
    places = np.arange(count + missing)
    kept = np.sort(random.choice(places[1:-1], count - 2, replace=False))
    kept = np.concatenate(([0], kept, [count + missing - 1]))
    times = kept * 100.0 + random.uniform(0, 100 * scatter, count)
    found = grid(times - times[0])
    assert found is not None
    assert found.missing == missing
    assert found.period_us == pytest.approx(100, abs=8 * found.uncertainty_us + 1e-9)


@pytest.mark.parametrize("shape", ["uniform", "normal", "exponential"])
@pytest.mark.parametrize("count", [10, 40, 400, 4000])
def test_the_latest_event_is_found_within_its_u(shape: str, count: int) -> None:
    random, within, ever_more = np.random.default_rng(3), 0, 0.0
    for _ in range(100):
        late = getattr(random, shape)(size=count)
        found = grid(np.arange(count) * 1000.04 + late - late[0])
        assert found is not None
        latest, spread = lateness(found, 1), float(late.max() - late.min())
        assert latest.uncertainty is not None
        within += abs(latest.value - spread) <= 2 * latest.uncertainty
        ever_more = max(ever_more, latest.value / spread)
    assert within >= 90
    # By the kindest clock it is no more than there was.
    assert ever_more <= 1 + 1e-3


def test_clocks_that_drift_are_in_the_u_of_the_latest_event() -> None:
    random, within = np.random.default_rng(4), 0
    for _ in range(30):
        late, count = random.uniform(0, 10, 20_000), 20_000
        times = np.arange(count) * 1000.0 + late
        found = grid(times + 20e-6 * times**2 / (2 * times[-1]) - times[0])
        assert found is not None
        latest = lateness(found, 1)
        assert latest.uncertainty is not None
        within += abs(latest.value - float(late.max() - late.min())) <= 2 * latest.uncertainty
    assert within >= 27
