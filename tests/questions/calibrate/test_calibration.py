"""Calibration: what the model put in comes out again, against NumPy and SciPy."""

from collections.abc import Callable
from importlib import import_module
from itertools import count
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.buses.ieee1394.constants import MAX_PAYLOAD_BYTES
from busplan.buses.ieee1394.cycle import Ieee1394Cycle
from busplan.buses.ieee1394.timing import Phases, TimingModelName
from busplan.errors import BusplanError
from busplan.profile.measurements import Measurement, parse_measurements
from busplan.profile.shipped import load, locate_measurements
from busplan.profile.toml import override
from busplan.questions.calibrate.calibration import Calibration, calibrate
from busplan.questions.fit.network import network_of
from busplan.questions.latency.figures import with_payload
from busplan.sections.execution import LinearExecution, TableExecution
from busplan.sections.profile import Profile
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

Make = Callable[..., Profile]
MODELS: tuple[TimingModelName, ...] = ("paper", "standard")


def phases(profile: Profile, kind: TransactionKind, *, model: TimingModelName, payload_bytes: int) -> Phases:
    """Phases of one transaction of the farthest node."""
    cycle = Ieee1394Cycle(network_of(with_payload(profile, payload_bytes)), model)
    (found,) = (one.phases for one in cycle.exchanges if one.kind == kind)
    return found


def table_1() -> tuple[Measurement, ...]:
    return parse_measurements(locate_measurements("table-1.csv").path.read_bytes(), name="table-1.csv")


def written(rows: list[tuple[int, float]]) -> list[Measurement]:
    return [Measurement(line, "write", size, value, None) for line, (size, value) in enumerate(rows, start=2)]


def of_execution(
    profile: Profile, rows: list[tuple[int, float]], model: TimingModelName = "standard"
) -> list[Measurement]:
    """Measurements whose T_exec is known."""
    plain = profile.model_copy(
        update={
            "node": profile.alike_nodes[0].node.model_copy(
                update={"execution": LinearExecution(kind="linear", base_us=0, per_byte_us=0)}
            )
        }
    )
    return written(
        [
            (size, value + float(phases(plain, "write", model=model, payload_bytes=size).latency_us))
            for size, value in rows
        ]
    )


def run(profile: Profile, measurements: list[Measurement] | tuple[Measurement, ...], **options: object) -> Calibration:
    return calibrate(profile, measurements, source="m.csv", **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("model", [None, *MODELS])
def test_table_1_gives_the_table_of_the_shipped_profile(model: TimingModelName | None) -> None:
    bench = load("paper-two-node").profile
    result = run(bench, table_1(), timing_model=model, grade="derived")
    shipped, found = bench.alike_nodes[0].node.execution, result.execution
    assert isinstance(shipped, TableExecution)
    assert isinstance(found, TableExecution)
    assert (found.payload_bytes, found.grade) == (shipped.payload_bytes, shipped.grade)
    assert (result.way, result.outliers) == ("measured-halves", ())
    # A table goes through its points, but for the whole nanoseconds that it is written in.
    assert result.largest.residual_us == pytest.approx(0, abs=0.000501)
    assert (result.fit_keys, result.uncertainty_us) == ({"residual": "none", "measured_gap_count": 63}, None)
    for time_us, size, one in zip(found.time_us, found.payload_bytes, table_1(), strict=True):
        # T4 + T5 is the 6.0 us of 4 bytes: less their 32 bits by `standard`, with what the payload adds by `paper`.
        assert one.request_and_acknowledge_us is not None
        bits = 8 * (size - 4) if model == "paper" else -32
        second_us = 6.0 + bits / 393.216
        assert time_us == pytest.approx(one.latency_us - one.request_and_acknowledge_us - second_us, abs=0.000501)
    if model != "paper":
        assert [round(one, 1) for one in found.time_us] == list(shipped.time_us)


# At 4 bytes, one hop and gap count 63, (13) is 3 hop + 252 / C + 1.63 + bits / 393.216 + 0.25, of 192 bits in `paper`
# and of 160 in `standard`; a hop is 0.023 + 14 / C.
@pytest.mark.parametrize(
    ("model", "half_us"),
    [
        ("paper", 3 * (0.023 + 14 / 393.216) + 252 / 393.216 + 1.63 + 192 / 393.216 + 0.25),
        ("standard", 3 * (0.023 + 14 / 98.304) + 252 / 98.304 + 1.63 + 160 / 393.216 + 0.25),
    ],
)
def test_what_the_model_leaves_of_table_1_is_measured_less_equation_13(model: TimingModelName, half_us: float) -> None:
    bench = load("paper-two-node").profile
    result = run(bench, table_1(), timing_model=model)
    assert run(bench, table_1()).timing_model == "standard"
    for fit in result.payloads:
        modelled = phases(bench, "write", model=model, payload_bytes=fit.payload_bytes).request_and_acknowledge_us
        assert fit.request_and_acknowledge_us is not None
        assert fit.unexplained_us == pytest.approx(fit.request_and_acknowledge_us - modelled, abs=1e-12)
    assert result.payloads[0].unexplained_us == pytest.approx(6 - half_us, abs=1e-9)


@given(data=st.data())
def test_latencies_of_a_profile_give_its_own_execution_time(
    any_profile: st.SearchStrategy[Profile], data: st.DataObject
) -> None:
    split: dict[str, object] = {
        "node.read_response": "split",
        "node.write_response": "split",
        "cycle.schedule": "individual",
    }
    profile = override(data.draw(any_profile), split)
    model = data.draw(st.sampled_from(MODELS))
    most = int(MAX_PAYLOAD_BYTES[profile.bus.speed])
    sizes = data.draw(st.lists(st.integers(1, most), min_size=2, max_size=8, unique=True))
    measurements = [
        Measurement(line, kind, size, float(phases(profile, kind, model=model, payload_bytes=size).latency_us), None)
        for line, (size, kind) in enumerate(((size, kind) for size in sizes for kind in TRANSACTION_KINDS), start=2)
    ]
    own = profile.alike_nodes[0].node.execution
    line = run(profile, measurements, timing_model=model).execution
    assert isinstance(line, LinearExecution)
    assert isinstance(own, LinearExecution)
    assert line.base_us == pytest.approx(own.base_us, abs=2e-3)
    assert line.per_byte_us == pytest.approx(own.per_byte_us, abs=2e-6)
    result = run(profile, measurements, timing_model=model, form="table")
    assert isinstance(result.execution, TableExecution)
    assert result.execution.payload_bytes == tuple(sorted(sizes))
    assert result.execution.time_us == pytest.approx([own.execution_us(size) for size in sorted(sizes)], abs=1e-3)
    assert all(abs(fit.read_less_write_us or 0) < 1e-5 for fit in result.payloads)
    assert not result.outliers


def outlying(result: Calibration) -> set[int]:
    """Lines that are not in the fit."""
    return {one.line for one in result.outliers}


points = st.lists(st.tuples(st.integers(1, 2048), st.floats(0, 500)), min_size=2, max_size=30)


@given(points=points)
def test_lines_agree_with_scipy(make: Make, points: list[tuple[int, float]]) -> None:
    profile = make()
    measurements = of_execution(profile, points)
    sizes = sorted({size for size, _ in points})
    if len(sizes) == 1:
        with pytest.raises(BusplanError, match=r"all payloads are .* bytes: a line needs two, or use --form table"):
            run(profile, measurements)
        return
    result = run(profile, measurements, form="table")
    left = [(size, value) for (size, value), line in zip(points, count(2)) if line not in outlying(result)]
    sizes = sorted({size for size, _ in left})
    if len(sizes) == 1:
        return
    medians = [float(np.median([value for one, value in left if one == size])) for size in sizes]
    # Loaded by whoever runs this test, and not by whoever collects it.
    slope = import_module("scipy.stats").theilslopes(medians, sizes, method="joint").slope
    base = float(np.median(np.array(medians) - slope * np.array(sizes)))
    if round(base, 3) < 0 or round(slope, 6) < 0:
        with pytest.raises(BusplanError, match="no part of an execution time is negative"):
            run(profile, measurements)
        return
    line = run(profile, measurements).execution
    assert isinstance(line, LinearExecution)
    assert (line.base_us, line.per_byte_us) == pytest.approx((base, slope), abs=2e-3)


@given(points=points)
def test_figures_by_payload_and_residuals_agree_with_numpy(make: Make, points: list[tuple[int, float]]) -> None:
    result = run(make(), of_execution(make(), points), form="table")
    lines = [(size, value) for (size, value), line in zip(points, count(2)) if line not in outlying(result)]
    for fit in result.payloads:
        own = np.array([value for size, value in lines if size == fit.payload_bytes])
        assert fit.measurements == len(own) + fit.left_out
        if not len(own):
            continue
        assert fit.execution_us == pytest.approx(np.median(own), abs=1e-5)
        assert fit.range_us == pytest.approx(np.ptp(own), abs=1e-5)
        # In whole nanoseconds; `execution_us` is rounded itself, so that rounding it again could go the other way.
        assert fit.fitted_us is not None
        assert fit.fitted_us == round(fit.fitted_us, 3)
        assert fit.fitted_us == pytest.approx(fit.execution_us, rel=0, abs=0.000501)
        if len(own) > 1:
            assert fit.deviation_us == pytest.approx(own.std(ddof=1), abs=1e-5)
        else:
            assert fit.deviation_us is None
    residuals = np.array([one.residual_us for one in result.residuals])
    assert result.rms_residual_us == pytest.approx(np.sqrt((residuals**2).mean()))
    assert abs(result.largest.residual_us or 0.0) == pytest.approx(abs(residuals).max())


@pytest.mark.parametrize("form", ["table", "linear"])
def test_outliers_are_named_and_do_not_pull_the_fit(make: Make, form: str) -> None:
    random = Random(1)
    rows = [(size, 30 + 0.35 * size + random.gauss(0, 0.2)) for size in (4, 64, 256, 1024) for _ in range(9)]
    bad = {3: 900.0, 17: 1.0, 35: 700.0}
    spoilt = [(size, bad.get(index, value)) for index, (size, value) in enumerate(rows)]
    profile = make()
    found, clean = (run(profile, of_execution(profile, data), form=form) for data in (spoilt, rows))
    assert {one.line for one in found.outliers} == {5, 19, 37}
    assert len(clean.outliers) == 0
    # Two are slow executions, the slowest at 4 bytes; the third is fast, and the others contradict it.
    assert [one.off_us > 0 for one in found.outliers] == [True, False, True]
    assert found.worst_extra_us == pytest.approx(900 - 30 - 0.35 * 4, abs=0.5)
    assert clean.worst_extra_us is None
    assert found.execution.grade == "measured"
    for size in (4, 64, 256, 1024):
        assert found.execution.execution_us(size) == pytest.approx(clean.execution.execution_us(size), abs=0.5)


@pytest.mark.parametrize("form", ["table", "linear"])
def test_wide_but_even_scatter_has_no_outliers(make: Make, form: str) -> None:
    rows = [(size, 100.0 + size + away) for size in (4, 64) for away in (-20, -10, 0, 10, 20)]
    assert run(make(), of_execution(make(), rows), form=form).outliers == ()


def test_steps_of_a_timer_are_no_outliers(make: Make) -> None:
    rows = [(4, 48.0)] * 20 + [(4, 48.1)]
    assert run(make(), of_execution(make(), rows), form="table").outliers == ()


def test_a_latency_below_its_packets_is_refused_each_with_its_line(make: Make) -> None:
    need = phases(
        make(node__execution__base_us=0.0, node__execution__per_byte_us=0.0), "write", model="standard", payload_bytes=4
    )
    need_us = float(need.latency_us)
    with pytest.raises(BusplanError) as raised:
        run(make(), written([(4, 50.0), (4, 0.05), (4, need_us - 1e-6), (4, need_us)]))
    needed = f"is below the {need.latency_us:.3f} us that the packets alone take in the standard model"
    assert raised.value.problems == (
        f"m.csv:3: latency 0.05 us at 4 bytes {needed}",
        f"m.csv:4: latency {need.latency_us:g} us at 4 bytes {needed}",
    )


def test_latencies_in_ms_are_asked_about(make: Make) -> None:
    with pytest.raises(BusplanError, match="every latency is too short: is latency_us in us"):
        run(make(), written([(4, 0.0487), (16, 0.0489)]))


def test_a_latency_below_its_own_halves_is_refused(make: Make) -> None:
    with pytest.raises(
        # 6.0 us, and 6.0 less the 32 bits of payload at 393.216 Mbit/s.
        BusplanError,
        match=r"m.csv:2: latency 11 us at 4 bytes is below the 11.919 us that its T1 \+ T2 and T4 \+ T5 are",
    ):
        run(make(), [Measurement(2, "write", 4, 11.0, 6.0)])


def test_a_payload_that_no_packet_carries_is_refused(make: Make) -> None:
    with pytest.raises(BusplanError, match=r"m.csv:2: payload 513 bytes is over the 512 bytes of S100"):
        run(make(bus__speed="S100"), written([(513, 500.0)]))


def test_the_profile_gives_form_and_distance_and_the_bus_the_model(make: Make) -> None:
    own = {"kind": "table", "payload_bytes": [4, 64], "time_us": [30.0, 50.0]}
    near, far = (
        run(make(node__execution=own, bus__nodes=nodes, bus__timing_model="paper"), written([(12, 60)]))
        for nodes in (1, 8)
    )
    found = (near.timing_model, near.execution.kind, near.way, near.method)
    assert found == ("standard", "table", "timing-model", "median")
    assert near.payloads[0].packets_us < far.payloads[0].packets_us


@pytest.mark.parametrize("model", MODELS)
def test_a_fit_says_which_model_and_gap_count_it_was_fitted_against(make: Make, model: TimingModelName) -> None:
    result = run(make(bus__gap_count="optimal", bus__nodes=3), written([(12, 90), (40, 99)]), timing_model=model)
    # Three hops: the smallest safe gap count of the table is 8.
    assert result.fit_keys == {"residual": model, "measured_gap_count": 8}


@given(points=points)
def test_the_uncertainty_of_a_fit_is_the_spread_about_it(make: Make, points: list[tuple[int, float]]) -> None:
    profile = make()
    result = run(profile, of_execution(profile, points), form="table")
    left = [(size, value) for (size, value), line in zip(points, count(2)) if line not in outlying(result)]
    free = len(left) - len({size for size, _ in left})
    if not free:
        assert result.uncertainty_us is None
        return
    medians = {size: np.median([value for one, value in left if one == size]) for size, _ in left}
    spread_us = np.sqrt(sum((value - medians[size]) ** 2 for size, value in left) / free)
    # Nothing is better known than its last digit of 0.1 us.
    assert result.uncertainty_us == pytest.approx(max(spread_us, 0.1 / np.sqrt(12)), abs=0.002)


def test_a_wild_row_of_table_1_is_told_where_it_breaks_the_order() -> None:
    for halves in [True, False]:
        for index, off_us in [
            (index, off_us) for index in range(8) for off_us in (-60.0, 50.0, 148.0) if off_us > 0 or index > 3
        ]:
            bench = load("paper-two-node").profile
            rows = [one if halves else one._replace(request_and_acknowledge_us=None) for one in table_1()]
            assert run(bench, rows).outliers == ()
            wild = rows[index]
            rows[index] = wild._replace(latency_us=wild.latency_us + off_us)
            times_us = [36.8, 36.7, 45.4, 54.7, 84.9, 141.1, 223.2, 426.7]
            times_us[index] += off_us
            before, behind = times_us[:index][-1:], times_us[index + 1 :][:1]
            is_slow, is_fast = (
                bool(behind and times_us[index] > behind[0]),
                bool(before and times_us[index] < before[0]),
            )
            for form in ("table", "linear"):
                result = run(bench, rows, form=form)
                assert result.execution.grade == "measured"
                if not (is_slow or is_fast):
                    # A slower execution of that payload, or of all larger ones; nothing says otherwise.
                    assert (result.outliers, result.worst_extra_us) == ((), None)
                    continue
                (one,) = result.outliers
                assert (one.line, one.off_us > 0) == (wild.line, is_slow)
                assert [fit.left_out for fit in result.payloads] == [int(at == index) for at in range(8)]
                assert (len(result.residuals), result.measurements) == (7, 8)
                # The line bends less than Table I does.
                assert result.worst_extra_us == (pytest.approx(off_us, abs=25) if is_slow else None)


def test_a_tail_of_slow_executions_loses_none_of_them(make: Make) -> None:
    for seed in range(60):
        random = Random(seed)
        rows = [(size, 40 + 0.1 * size + random.expovariate(1 / 2.0)) for size in (4, 16, 64, 256) for _ in range(10)]
        result = run(make(), of_execution(make(), rows), form="table")
        assert [one for one in result.outliers if one.off_us < 0] == []
        slow = [one for one in result.outliers if one.off_us > 0]
        assert len(result.residuals) + len(slow) == len(rows)
        assert (result.worst_extra_us is None) == (not slow)
        if slow:
            covered_us = [float(result.execution.execution_us(size)) + (result.worst_extra_us or 0) for size, _ in rows]
            assert all(time_us <= most_us + 1e-6 for (_, time_us), most_us in zip(rows, covered_us, strict=True))


@settings(max_examples=15)
@given(
    seed=st.integers(0, 10**6),
    repetitions=st.integers(3, 5),
    bend=st.sampled_from([0.0, 2e-5]),
    halves=st.booleans(),
    data=st.data(),
)
def test_one_value_far_off_is_found_in_every_form_and_nothing_in_a_smooth_table(
    make: Make, seed: int, repetitions: int, bend: float, halves: bool, data: st.DataObject
) -> None:
    random, noise_us = Random(seed), 0.2
    sizes = [size for size in (4, 16, 32, 64, 96, 128, 192, 256) for _ in range(repetitions)]
    rows = [(size, 30 + 0.35 * size + bend * size**2 + random.uniform(-noise_us, noise_us)) for size in sizes]
    at = data.draw(st.integers(0, len(rows) - 1))
    far_us = data.draw(st.sampled_from([-1, 1])) * data.draw(st.floats(max(20 * noise_us, 6.0), 25.0))
    profile = make()
    for kind in TRANSACTION_KINDS:
        smooth = [
            one._replace(
                transaction=kind, request_and_acknowledge_us=6.0 if halves else None, latency_us=one.latency_us + 5
            )
            for one in of_execution(profile, rows)
        ]
        spoilt = list(smooth)
        spoilt[at] = smooth[at]._replace(latency_us=smooth[at].latency_us + far_us)
        for form in ("table", "linear"):
            assert run(profile, smooth, form=form).outliers == ()
            result = run(profile, spoilt, form=form)
            assert [one.line for one in result.outliers] == [smooth[at].line]


@pytest.mark.parametrize("form", ["table", "linear"])
def test_two_wild_values_do_not_hide_each_other(make: Make, form: str) -> None:
    rows = [(size, 50 + 0.01 * size + (size % 3) / 10) for size in (4, 8, 16, 32, 64, 128, 256)]
    rows[2], rows[4] = (16, 200.0), (64, 190.0)
    result = run(make(), of_execution(make(), rows), form=form)
    assert [one.line for one in result.outliers] == [4, 6]
    assert result.worst_extra_us == pytest.approx(150, abs=1)


def test_an_execution_time_that_bends_has_no_outliers(make: Make) -> None:
    for bend, power in ((6.0, 0.5), (0.02, 1.5), (5e-4, 2.0)):
        rows = [(size, 30 + bend * size**power) for size in (4, 16, 32, 64, 128, 256, 512, 1024)]
        assert run(make(), of_execution(make(), rows), form="table").outliers == ()


@pytest.mark.parametrize(
    ("rows", "outliers", "unchecked"),
    [
        ([(4, 52.0), (4, 52.4), (4, 200.0)], [4], ()),
        ([(4, 52.0), (4, 200.0)], [], (4,)),
        ([(4, 52.0), (64, 200.0)], [], (4, 64)),
        (
            [(size, time_us) for size in (4, 16, 64, 128) for time_us in (52.0, 52.1)] + [(32, 52.0), (32, 200.0)],
            [11],
            (),
        ),
        # The slowest of all payloads may just be slower; a slow one before it is not.
        ([(4, 52.0), (8, 52.1), (16, 52.0), (32, 200.0)], [], ()),
        ([(4, 52.0), (8, 200.0), (16, 52.0), (32, 52.1)], [3], ()),
        ([(4, 52.0), (8, 20.0), (16, 52.0), (32, 52.1)], [3], ()),
        ([(4, 52.0)] * 3 + [(64, 200.0)] * 3 + [(128, 53.0)] * 3, [], ()),
    ],
)
def test_what_few_measurements_tell(
    make: Make, rows: list[tuple[int, float]], outliers: list[int], unchecked: object
) -> None:
    result = run(make(), of_execution(make(), rows), form="table")
    assert [one.line for one in result.outliers] == outliers
    assert result.unchecked_bytes == unchecked
    assert result.execution.grade == "measured"


def test_the_half_of_an_outlier_is_taken_off_nothing_else() -> None:
    rows = list(table_1())
    rows[0] = rows[0]._replace(latency_us=200.0, request_and_acknowledge_us=9.0)
    result = run(load("paper-two-node").profile, rows)
    assert [one.line for one in result.outliers] == [rows[0].line]
    # T4 + T5 of 16 bytes, the smallest that is left: 6.3 us, less data, its length and its CRC of 192 bits.
    assert isinstance(result.execution, TableExecution)
    assert result.execution.time_us[0] == pytest.approx(48.9 - 6.3 - 6.3 + 192 / 393.216, abs=0.0011)
    assert (result.payloads[0].fitted_us, result.payloads[0].residual_us, result.outliers[0].residual_us) == (None,) * 3
