"""Published beside computed: the data are what is printed, and the residuals are what the equations leave."""

from typing import Any

import pytest

import busplan

# As printed in Table I: payload, T_lant, T1+T2, T1+T2 theory.
TABLE_1 = [
    (4, 48.7, 6, 3.19),
    (16, 48.9, 6.3, 3.44),
    (32, 57.9, 6.6, 3.76),
    (64, 68.1, 7.5, 4.41),
    (128, 99.9, 9.1, 5.71),
    (256, 158.5, 11.5, 8.32),
    (512, 246.0, 16.9, 13.53),
    (1024, 460.0, 27.4, 23.94),
]
# As printed in Table II: payload, developed system, the two figures of the reference.
TABLE_2 = [
    (4, 48.7, 61, 58),
    (32, 57.9, 75, 70),
    (64, 68.1, 90, 70),
    (128, 99.9, 118, 108),
    (256, 158.5, 172, 166),
    (512, 246.0, 277, 272),
]


@pytest.fixture(scope="module")
def everything() -> list[Any]:
    (kind,) = busplan.evidence("ieee1394").kinds
    return [row for section in kind.sections for row in section.comparisons]


@pytest.fixture(scope="module")
def comparisons() -> list[Any]:
    """The paper's own."""
    (kind,) = busplan.evidence(paper=True).kinds
    return [row for section in kind.sections for row in section.comparisons]


@pytest.fixture(scope="module")
def beside(everything: list[Any]) -> list[Any]:
    """What is known beside the paper."""
    return [row for row in everything if row.section.startswith(("dVRK", "IEEE 1394"))]


def test_evidence_of_the_bus_is_that_of_the_paper_and_what_is_known_beside_it(
    everything: list[Any], comparisons: list[Any], beside: list[Any]
) -> None:
    assert everything == [*comparisons, *beside]
    assert beside


def chosen(comparisons: list[Any], section: str, method: str) -> dict[str, Any]:
    return {row.quantity: row for row in comparisons if row.section == section and row.method == method}


def test_the_data_hold_the_printed_tables(comparisons: list[Any]) -> None:
    theory, halves, latencies = (
        {row.quantity: row.published for row in comparisons if row.section == f"Table I: {name}"}
        for name in ("T1+T2, theory", "T1+T2, measured", "T_lant, measured")
    )
    rows = {f"{size} bytes": printed for size, *printed in TABLE_1}
    assert {size: [latencies[size], halves[size], theory[size]] for size in theory} == rows
    first, second = (
        {row.quantity: row.published for row in comparisons if row.section.endswith(f"{name} figure")}
        for name in ("first", "second")
    )
    assert first == {f"{size} bytes": own / other for size, own, other, _ in TABLE_2}
    assert second == {f"{size} bytes": own / other for size, own, _, other in TABLE_2}


def test_theory_column_to_its_two_decimals(comparisons: list[Any]) -> None:
    rows = chosen(comparisons, "Table I: T1+T2, theory", "eq (15)")
    assert [round(rows[f"{size} bytes"].computed, 2) for size, *_ in TABLE_1] == [row[3] for row in TABLE_1]


def test_the_standards_clock_explains_the_bench_better_on_every_row(comparisons: list[Any]) -> None:
    section = "Table I: T1+T2, measured"
    paper, standard = (chosen(comparisons, section, f"{model} model") for model in ("paper", "standard"))
    assert len(paper) == len(standard) == len(TABLE_1)
    for quantity, row in standard.items():
        assert row.relative_residual is not None
        assert paper[quantity].relative_residual is not None
        assert abs(row.relative_residual) <= 0.12
        assert abs(row.relative_residual) < abs(paper[quantity].relative_residual or 0.0)


def test_latency_of_the_paper_model_leaves_what_both_its_halves_leave(comparisons: list[Any]) -> None:
    # T_exec is derived from the same table, so this is arithmetic and no validation: the report says so.
    whole = chosen(comparisons, "Table I: T_lant, measured", "paper model")
    half = chosen(comparisons, "Table I: T1+T2, measured", "paper model")
    latencies = busplan.latency("paper-two-node", payload_bytes=[size for size, *_ in TABLE_1], timing_model="paper")
    execution_us = {row.payload_bytes: row.phases["execution_us"] or 0.0 for row in latencies.transactions}
    for size, latency_us, first_us, _ in TABLE_1:
        # The response to a write carries no payload: at 4 bytes both halves are 6.0 us, of which 32 bits are payload.
        second_us = latency_us - first_us - execution_us[size]
        assert second_us == pytest.approx(6.0 - 32 / 393.216, abs=0.05)
        quantity = f"{size} bytes"
        second = half[quantity].computed - second_us
        assert whole[quantity].residual == pytest.approx((half[quantity].residual or 0.0) + second, abs=1e-9)


def test_ratios_to_the_reference(comparisons: list[Any]) -> None:
    title = "Table II: T_lant as a share of reference [48]'s, first figure"
    rows = chosen(comparisons, title, "standard model")
    assert rows["4 bytes"].published == pytest.approx(48.7 / 61)
    assert len([row for row in comparisons if row.section.startswith("Table II")]) == 2 * 2 * len(TABLE_2)


def test_can_is_202_times_slower_as_printed(comparisons: list[Any]) -> None:
    assert pytest.approx(202, abs=0.5) == 10500 / 51.9
    quotients = [row for row in comparisons if row.quantity == "CAN / T_lant"]
    assert [row.published for row in quotients] == [202, 202]
    latencies = {row.method: row for row in comparisons if row.quantity == "T_lant, 8 bytes"}
    # 36.8 and 36.7 us at 4 and 16 bytes: a third of the way at 8.
    assert latencies["paper model"].computed == pytest.approx(36.8 - 0.1 / 3 + 2 * (3.1035817 + 64 / 393.216), abs=1e-6)


def test_the_can_row_is_135_us_of_wire_and_10_ms_of_host(comparisons: list[Any]) -> None:
    (wire,) = (row for row in comparisons if row.method == "CAN frame on the wire")
    assert (wire.published, wire.computed) == (10500, 55 + 10 * 8)  # bits at 1 Mbit/s, worst-case stuffing
    assert wire.residual == -10365


def test_every_figure_has_the_grade_of_its_source(comparisons: list[Any], beside: list[Any]) -> None:
    sections = {row.section for row in (*comparisons, *beside) if row.grade == "measured"}
    assert {section.partition(":")[0] for section in sections} == {
        *("Table I", "Section IV-A", "Figs. 9 and 10", "dVRK", "IEEE 1394"),
    }
    assert {row.grade for row in (*comparisons, *beside)} == {"published", "measured", "derived", None}
    assert all((row.grade is None) == (row.published is None) for row in (*comparisons, *beside))


def test_the_kit_gains_less_on_the_bus_alone_than_was_measured_with_its_host(beside: list[Any]) -> None:
    rows = chosen(beside, "dVRK: I/O time, individual schedule divided by broadcast schedule", "standard model")
    assert rows["gain, of the bus alone"].published == 4
    # By hand, 8 hops and gap count 21: 309.555 us one by one, 135.053 us by broadcasts with isochronous requests.
    assert rows["gain, of the bus alone"].computed == pytest.approx(309.555 / 135.053, rel=1e-5)
    # 16 calls against 3, each longer than T_reset, 725 / 98.304 us: both cycles are lines in the host's time.
    reset_us = 725 / 98.304
    host_us = reset_us + (4 * 135.053 - 309.555) / (16 - 4 * 3)
    assert rows["host time that makes it 4"].computed == pytest.approx(host_us, abs=0.01)


def test_the_kit_runs_at_periods_that_its_cycles_fit(beside: list[Any]) -> None:
    rows = chosen(beside, "dVRK: the periods that it runs at", "standard model")
    assert [row.published for row in rows.values()] == pytest.approx([1e6 / 1500, 1e6 / 6000])
    assert all((row.residual or 0.0) < 0 for row in rows.values())


def test_the_hub_and_a_board_of_the_kit(beside: list[Any]) -> None:
    (block,) = chosen(beside, "dVRK: the block of the hub", "standard model").values()
    assert block.computed == block.published == 4 * (8 * 33 + 1)
    boards = chosen(beside, "dVRK: the broadcast of one board", "standard model")
    hop_us = 0.023 + 14 / 98.304
    by_hand = {f"{hops} hop{'s' * (hops > 1)}": 2 * hops * hop_us + 1.63 + 8 * 92 / 393.216 for hops in (1, 8)}
    assert {name: row.computed for name, row in boards.items()} == pytest.approx(by_hand)


def test_the_times_of_the_boards_are_the_firmwares(beside: list[Any]) -> None:
    times = chosen(beside, "dVRK: when a board broadcasts, firmware up to Rev 7", "standard model").values()
    assert [round(row.computed, 2) for row in times] == [row.published for row in times] == [3.05, 5.21]


def test_what_is_known_of_the_standard_beside_the_paper(beside: list[Any]) -> None:
    delays = [row for row in beside if row.section.startswith("IEEE 1394: delays")]
    assert [(row.quantity, row.published) for row in delays] == [
        ("PHY", 0.144),
        ("PHY", 0.144),
        ("cable of 4.5 m", pytest.approx(4.5 * 5.05e-3)),
    ]
    assert [abs(row.relative_residual or 0.0) < 0.02 for row in delays] == [False, True, True]
    met = [row for row in beside if row.section.startswith("IEEE 1394: smallest")]
    assert [(row.published, row.computed) for row in met] == [(23, 23), (23, 23)]
    trips = [row for row in beside if row.section.startswith("IEEE 1394: a round trip")]
    assert [row.published for row in trips] == [100, 140]
    assert all(row.computed < 0.25 * (row.published or 0.0) for row in trips)


def test_equation_15_is_the_sum_of_rounded_terms(comparisons: list[Any]) -> None:
    ways = {row.method: row for row in comparisons if row.section == "Equation (15): its constant"}
    assert ways["terms rounded first"].computed == pytest.approx(3.11, abs=1e-12)
    assert ways["eqs (4)-(6)"].residual == pytest.approx(-6.418e-3, abs=1e-6)


def test_the_gaps_of_the_standard_are_four_times_the_papers(comparisons: list[Any]) -> None:
    rows = {(row.quantity, row.method): row for row in comparisons if row.section.startswith("Equation (10)")}
    assert rows["T_sum, gap count 63", "paper model"].computed == pytest.approx(7.90, abs=5e-3)
    assert rows["T_sum, gap count 63", "standard model"].computed == pytest.approx(31.60, abs=5e-3)
    assert rows["standard / paper", "standard model"].computed == 4.0
    assert all(row.published is row.residual is None for row in rows.values())


def test_the_circles_of_figs_9_and_10_within_2_percent(comparisons: list[Any]) -> None:
    circles = [row for row in comparisons if row.section == "Figs. 9 and 10: the circle test"]
    assert [row.published for row in circles] == [48.656, 0.0036, 0.0187, 12.164, 0.0049, 0.0219]
    assert all(row.computed == pytest.approx(row.published, rel=0.02) for row in circles)
    assert [row.computed for row in circles if row.unit == "s"] == [48.656, 12.164]


def test_sercos_is_below_10_percent_in_one_of_two_circles(comparisons: list[Any]) -> None:
    published = [row.published or 0.0 for row in comparisons if row.section.endswith("SERCOS")]
    assert published == pytest.approx([0.0036 / 0.0448, 0.0049 / 0.0448])
    assert [share < 0.1 for share in published] == [True, False]
