"""Published beside computed: the data are what is printed, and the residuals are what the equations leave."""

import pytest

from busplan.analysis.circle.roundness import circle_test
from busplan.analysis.paper import BENCH_PROFILE, CIRCLE_PROFILES, paper_sections, published
from busplan.buses.ieee1394 import table_1
from busplan.buses.published import Comparison
from busplan.profile.shipped import load

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
def comparisons() -> list[Comparison]:
    circles = [circle_test(load(name).profile).results[0] for name in CIRCLE_PROFILES]
    sections = paper_sections(load(BENCH_PROFILE).profile, circles=circles)
    return [one for section in sections for one in section.comparisons]


def chosen(comparisons: list[Comparison], section: str, method: str) -> dict[str, Comparison]:
    return {one.quantity: one for one in comparisons if one.section == section and one.method == method}


def test_the_data_hold_the_printed_tables() -> None:
    assert [tuple(row) for row in table_1.TABLE_1] == TABLE_1
    two = published()["table_2"]
    columns = ("payload_bytes", "latency_us", "reference_first_us", "reference_second_us")
    assert list(zip(*(two[column] for column in columns), strict=True)) == TABLE_2


def test_theory_column_to_its_two_decimals(comparisons: list[Comparison]) -> None:
    rows = chosen(comparisons, "Table I: T1+T2, theory", "eq (15)")
    assert [round(rows[f"{size} bytes"].computed, 2) for size, *_ in TABLE_1] == [row[3] for row in TABLE_1]


def test_the_standards_clock_explains_the_bench_better_on_every_row(comparisons: list[Comparison]) -> None:
    section = "Table I: T1+T2, measured"
    paper, standard = (chosen(comparisons, section, f"{model} model") for model in ("paper", "standard"))
    assert len(paper) == len(standard) == len(TABLE_1)
    for quantity, one in standard.items():
        assert one.relative_residual is not None
        assert paper[quantity].relative_residual is not None
        assert abs(one.relative_residual) <= 0.12
        assert abs(one.relative_residual) < abs(paper[quantity].relative_residual or 0.0)


def test_latency_of_the_paper_model_leaves_what_both_its_halves_leave(comparisons: list[Comparison]) -> None:
    # T_exec is derived from the same table, so this is arithmetic and no validation: the report says so.
    whole = chosen(comparisons, "Table I: T_lant, measured", "paper model")
    half = chosen(comparisons, "Table I: T1+T2, measured", "paper model")
    execution = load(BENCH_PROFILE).profile.alike_nodes[0].node.execution
    for size, latency_us, first_us, _ in TABLE_1:
        # The response to a write carries no payload: at 4 bytes both halves are 6.0 us, of which 32 bits are payload.
        second_us = latency_us - first_us - execution.execution_us(size)
        assert second_us == pytest.approx(6.0 - 32 / 393.216, abs=0.05)
        quantity = f"{size} bytes"
        second = half[quantity].computed - second_us
        assert whole[quantity].residual == pytest.approx((half[quantity].residual or 0.0) + second, abs=1e-9)


def test_ratios_to_the_reference(comparisons: list[Comparison]) -> None:
    title = "Table II: T_lant as a share of reference [48]'s, first figure"
    rows = chosen(comparisons, title, "standard model")
    assert rows["4 bytes"].published == pytest.approx(48.7 / 61)
    assert len([one for one in comparisons if one.section.startswith("Table II")]) == 2 * 2 * len(TABLE_2)


def test_can_is_202_times_slower_as_printed(comparisons: list[Comparison]) -> None:
    assert pytest.approx(202, abs=0.5) == 10500 / 51.9
    quotients = [one for one in comparisons if one.quantity == "CAN / T_lant"]
    assert [one.published for one in quotients] == [202, 202]
    latencies = {one.method: one for one in comparisons if one.quantity == "T_lant, 8 bytes"}
    # 36.8 and 36.7 us at 4 and 16 bytes: a third of the way at 8.
    assert latencies["paper model"].computed == pytest.approx(36.8 - 0.1 / 3 + 2 * (3.1035817 + 64 / 393.216), abs=1e-6)


def test_equation_15_is_the_sum_of_rounded_terms(comparisons: list[Comparison]) -> None:
    ways = {one.method: one for one in comparisons if one.section == "Equation (15): its constant"}
    assert ways["terms rounded first"].computed == pytest.approx(3.11, abs=1e-12)
    assert ways["eqs (4)-(6)"].residual == pytest.approx(-6.418e-3, abs=1e-6)


def test_the_gaps_of_the_standard_are_four_times_the_papers(comparisons: list[Comparison]) -> None:
    rows = {(one.quantity, one.method): one for one in comparisons if one.section.startswith("Equation (10)")}
    assert rows["T_sum, gap count 63", "paper model"].computed == pytest.approx(7.90, abs=5e-3)
    assert rows["T_sum, gap count 63", "standard model"].computed == pytest.approx(31.60, abs=5e-3)
    assert rows["standard / paper", "standard model"].computed == 4.0
    assert all(one.published is one.residual is None for one in rows.values())


def test_the_circles_of_figs_9_and_10_within_2_percent(comparisons: list[Comparison]) -> None:
    circles = [one for one in comparisons if one.section == "Figs. 9 and 10: the circle test"]
    assert [one.published for one in circles] == [48.656, 0.0036, 0.0187, 12.164, 0.0049, 0.0219]
    assert all(one.computed == pytest.approx(one.published, rel=0.02) for one in circles)
    assert [one.computed for one in circles if one.unit == "s"] == [48.656, 12.164]


def test_sercos_is_below_10_percent_in_one_of_two_circles(comparisons: list[Comparison]) -> None:
    published = [one.published or 0.0 for one in comparisons if one.section.endswith("SERCOS")]
    assert published == pytest.approx([0.0036 / 0.0448, 0.0049 / 0.0448])
    assert [share < 0.1 for share in published] == [True, False]
