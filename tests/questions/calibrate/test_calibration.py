"""Calibration: what the model put in comes out again, against NumPy."""

from collections.abc import Callable
from itertools import count
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan import BusplanError, CalibrateAnswer
from busplan.buses.ieee1394.constants import c
from busplan.sections.base import value_at
from tests.registers import at_least

Make = Callable[..., busplan.Profile]
Rows = list[tuple[int, float]]
MODELS = ("paper", "standard")
IDLE: dict[str, object] = {"node.execution": {"kind": "linear", "base_us": 0, "per_byte_us": 0}}


def latency_us(profile: busplan.Profile, kind: str, size: int, model: str = "standard") -> float:
    """Latency of one transaction of the farthest node."""
    rows = busplan.latency(profile, payload_bytes=size, timing_model=model).transactions
    (latency,) = (row.phases["latency_us"] for row in rows if row.transaction == kind)
    assert latency is not None
    return latency


def of_execution(profile: busplan.Profile, rows: Rows, model: str = "standard") -> list[tuple[Any, ...]]:
    """Measurements whose T_exec is known."""
    idle = busplan.load_profile(profile, changes=IDLE)
    packets_us = {size: latency_us(idle, "write", size, model) for size in {size for size, _ in rows}}
    return [(size, value + packets_us[size]) for size, value in rows]


def run(profile: busplan.Profile, rows: Any, **options: Any) -> CalibrateAnswer:
    return busplan.calibrate(profile, rows, source="m.csv", **options)


def outlying(answer: CalibrateAnswer) -> set[int]:
    """Rows that are not in the fit, from 1."""
    return {outlier.line for outlier in answer.outliers}


@pytest.mark.parametrize("model", MODELS)
def test_table_1_is_its_latency_less_its_packets(model: str) -> None:
    bench = busplan.load_profile("paper-two-node")
    idle = busplan.load_profile(bench, changes={"node.execution": {"kind": "linear", "base_us": 0, "per_byte_us": 0}})
    answer = busplan.calibrate(bench, "table-1.csv", timing_model=model)
    assert answer.execution.grade == "derived"
    printed = {4: 48.7, 16: 48.9, 32: 57.9, 64: 68.1, 128: 99.9, 256: 158.5, 512: 246.0, 1024: 460.0}
    times_us = [us - latency_us(idle, "write", size, model) for size, us in printed.items()]
    assert answer.execution.payload_bytes == tuple(printed)
    assert answer.execution.time_us == pytest.approx(times_us, abs=0.000501)
    assert (answer.section["residual"], answer.section["measured_gap_count"]) == (model, 63)
    # Each payload stands there once: nothing is left over, and no outlier can be told.
    assert (answer.uncertainty_us, answer.outliers, answer.unchecked_bytes) == (None, (), tuple(printed))


@settings(max_examples=at_least(5, 40))
@given(data=st.data())
def test_latencies_of_a_profile_give_its_own_execution_time(
    any_profile: st.SearchStrategy[busplan.Profile], data: st.DataObject
) -> None:
    split: dict[str, object] = {
        "node.read_response": "split",
        "node.write_response": "split",
        "cycle.schedule": "individual",
    }
    profile = busplan.load_profile(data.draw(any_profile), changes=split)
    model = data.draw(st.sampled_from([model for model in MODELS if _has(profile, model)]))
    most = int(c.by_key("MAX_PAYLOAD_BYTES")[value_at(profile, "bus.speed")])
    sizes = data.draw(st.lists(st.integers(1, most), min_size=2, max_size=8, unique=True))
    plain = busplan.load_profile(profile, changes={"node.execution.worst_extra_us": 0.0})
    rows = [(size, latency_us(plain, kind, size, model), kind) for size in sizes for kind in ("read", "write")]
    execution = profile.node_groups[0].node.execution
    answer = run(profile, rows, timing_model=model)
    assert answer.execution.payload_bytes == tuple(sorted(sizes))
    assert answer.execution.time_us == pytest.approx([execution.execution_us(size) for size in sorted(sizes)], abs=1e-3)
    assert not answer.outliers


def _has(profile: busplan.Profile, model: str) -> bool:
    """Whether a timing model can express a profile."""
    return model in {result.timing_model for result in busplan.capacity(profile).results}


points = st.lists(st.tuples(st.integers(1, 2048), st.floats(0, 500)), min_size=2, max_size=30)


@given(points=points)
def test_figures_by_payload_and_the_uncertainty_agree_with_numpy(make: Make, points: Rows) -> None:
    answer = run(make(), of_execution(make(), points))
    left = [(size, value) for (size, value), line in zip(points, count(1)) if line not in outlying(answer)]
    assert [fit.payload_bytes for fit in answer.payloads] == sorted({size for size, _ in points})
    residuals = []
    for fit in answer.payloads:
        kept = np.array([value for size, value in left if size == fit.payload_bytes])
        assert fit.measurements == len(kept) + fit.left_out
        assert fit.execution_us == pytest.approx(np.median(kept), abs=1e-5)
        assert fit.deviation_us == (pytest.approx(kept.std(ddof=1), abs=1e-5) if len(kept) > 1 else None)
        residuals += [*(kept - np.median(kept))]
    free = len(left) - len(answer.payloads)
    spread_us = np.sqrt(np.square(residuals).sum() / free) if free else 0.0
    # Nothing is better known than its last digit of 0.1 us.
    expected = pytest.approx(max(spread_us, 0.1 / np.sqrt(12)), abs=0.002)
    assert answer.uncertainty_us == (expected if free else None)


# --- outliers ---------------------------------------------------------------------------------------------


def test_outliers_are_named_and_do_not_pull_the_fit(make: Make) -> None:
    random = Random(1)
    rows = [(size, 30 + 0.35 * size + random.gauss(0, 0.2)) for size in (4, 64, 256, 1024) for _ in range(9)]
    bad = {3: 900.0, 17: 1.0, 35: 700.0}
    spoilt = [(size, bad.get(index, value)) for index, (size, value) in enumerate(rows)]
    profile = make()
    answer, clean = (run(profile, of_execution(profile, data)) for data in (spoilt, rows))
    assert (outlying(answer), outlying(clean)) == ({4, 18, 36}, set())
    # Two are slow executions, the slowest at 4 bytes; the third is fast, and the others contradict it.
    assert [outlier.off_us > 0 for outlier in answer.outliers] == [True, False, True]
    assert answer.worst_extra_us == pytest.approx(900 - 30 - 0.35 * 4, abs=0.5)
    assert (clean.worst_extra_us, answer.execution.grade) == (None, "measured")
    for size in (4, 64, 256, 1024):
        assert answer.execution.execution_us(size) == pytest.approx(clean.execution.execution_us(size), abs=0.5)


@pytest.mark.parametrize(
    "rows",
    [
        [(size, 100.0 + size + away) for size in (4, 64) for away in (-20, -10, 0, 10, 20)],
        [(4, 36.0)] * 20 + [(4, 36.1)],
        [(size, 30 + 5e-4 * size**2) for size in (4, 16, 64, 256, 1024) for _ in range(3)],
        [(4, 52.0), (4, 200.0), (64, 90.0)],
    ],
    ids=["even scatter", "steps of a timer", "a bend", "too few to tell"],
)
def test_what_nothing_contradicts_is_no_outlier(make: Make, rows: Rows) -> None:
    assert run(make(), of_execution(make(), rows)).outliers == ()


@pytest.mark.parametrize(
    ("rows", "outliers", "unchecked"),
    [
        ([(4, 52.0), (4, 52.4), (4, 200.0)], {3}, ()),
        ([(4, 52.0), (4, 200.0)], set(), (4,)),
        ([(4, 52.0)] * 3 + [(64, 200.0)] * 2, set(), (64,)),
        ([(4, 52.0)] * 3 + [(64, 200.0)] * 3 + [(128, 53.0)] * 3, set(), ()),
    ],
)
def test_it_takes_three_measurements_of_a_payload_to_tell(
    make: Make, rows: Rows, outliers: set[int], unchecked: object
) -> None:
    answer = run(make(), of_execution(make(), rows))
    assert (outlying(answer), answer.unchecked_bytes) == (outliers, unchecked)


def test_reads_that_are_slower_than_writes_are_no_outliers(make: Make) -> None:
    writes = of_execution(make(), [(4, 40.0 + off) for off in (0.0, 0.1, 0.2, 0.3) * 3])
    rows = [(size, us, "write") for size, us in writes] + [(size, us + 9.0, "read") for size, us in writes[:4]]
    assert run(make(), rows).outliers == ()


def test_a_tail_of_slow_executions_loses_none_of_them(make: Make) -> None:
    for seed in range(at_least(20)):
        random = Random(seed)
        rows = [(size, 40 + 0.1 * size + random.expovariate(1 / 2.0)) for size in (4, 16, 64, 256) for _ in range(10)]
        answer = run(make(), of_execution(make(), rows))
        assert [outlier for outlier in answer.outliers if outlier.off_us < 0] == []
        assert (answer.worst_extra_us is None) == (not answer.outliers)
        if answer.worst_extra_us is not None:
            most_us = {
                size: float(answer.execution.execution_us(size)) + answer.worst_extra_us for size in (4, 16, 64, 256)
            }
            assert all(time_us <= most_us[size] + 1e-6 for size, time_us in rows)


@settings(max_examples=at_least(7))
@given(seed=st.integers(0, 10**6), repetitions=st.integers(3, 5), bend=st.sampled_from([0.0, 2e-5]), data=st.data())
def test_one_value_far_off_is_found_and_nothing_in_smooth_ones(
    make: Make, seed: int, repetitions: int, bend: float, data: st.DataObject
) -> None:
    random, noise_us, profile = Random(seed), 0.2, make()
    sizes = [size for size in (4, 16, 32, 64, 96, 128, 192, 256) for _ in range(repetitions)]
    rows = [(size, 30 + 0.35 * size + bend * size**2 + random.uniform(-noise_us, noise_us)) for size in sizes]
    at = data.draw(st.integers(0, len(rows) - 1))
    far_us = data.draw(st.sampled_from([-1, 1])) * data.draw(st.floats(max(20 * noise_us, 6.0), 25.0))
    smooth = of_execution(profile, rows)
    spoilt = [(size, us + far_us * (place == at)) for place, (size, us) in enumerate(smooth)]
    assert run(profile, smooth).outliers == ()
    assert outlying(run(profile, spoilt)) == {at + 1}


# --- what is refused --------------------------------------------------------------------------------------


def test_a_latency_below_its_packets_is_refused_each_with_its_line(make: Make) -> None:
    need_us = latency_us(busplan.load_profile(make(), changes=IDLE), "write", 4)
    with pytest.raises(BusplanError) as raised:
        run(make(), [(4, 50.0), (4, 0.05), (4, need_us - 1e-6), (4, need_us)])
    needed = f"is below the {need_us:.3f} us that the packets alone take in the standard model"
    assert raised.value.problems == (
        f"m.csv:2: latency 0.05 us at 4 bytes {needed}",
        f"m.csv:3: latency {need_us:g} us at 4 bytes {needed}",
    )


def test_latencies_in_ms_are_asked_about(make: Make) -> None:
    with pytest.raises(BusplanError, match="every latency is too short: is latency_us in us"):
        run(make(), [(4, 0.0487), (16, 0.0489)])


def test_a_payload_that_no_packet_carries_is_refused(make: Make) -> None:
    with pytest.raises(BusplanError, match=r"m.csv:1: payload 513 bytes is over the 512 bytes of S100"):
        run(make(bus__speed="S100"), [(513, 500.0)])


def test_the_profile_gives_the_distance_and_the_model_is_the_one_that_decides(make: Make) -> None:
    near, far = (run(make(bus__nodes=nodes), [(12, 60)]) for nodes in (1, 8))
    assert near.timing_model == "standard"
    assert near.payloads[0].packets_us < far.payloads[0].packets_us


@pytest.mark.parametrize("model", MODELS)
def test_a_fit_says_which_model_and_gap_count_it_was_fitted_against(make: Make, model: str) -> None:
    answer = run(make(bus__gap_count="optimal", bus__nodes=3), [(12, 90), (40, 99)], timing_model=model)
    # Three hops: the smallest safe gap count of the table is 8.
    assert (answer.section["residual"], answer.section["measured_gap_count"]) == (model, 8)
