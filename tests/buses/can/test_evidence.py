"""Published figures of CAN, each met to the last digit that its source prints."""

from collections.abc import Callable
from subprocess import CompletedProcess

import pytest

from busplan.buses import kind_named
from busplan.questions.evidence import EvidenceSection, sections_of

SECTIONS = [*sections_of(kind_named("can"), "can"), *sections_of(kind_named("can"), "paper")]
SYSTEM = SECTIONS[-1]
SEEN = {"CAN: bits of frames of 8 bytes that hardware counted", "CAN: the load of a log"}
"""What frames on a bus had."""
PRINTED = [one for one in SECTIONS[:-1] if one.title not in SEEN]


@pytest.mark.parametrize("section", PRINTED, ids=lambda one: one.title)
def test_each_published_figure_is_met_as_printed(section: EvidenceSection) -> None:
    for one in section.comparisons:
        decimals = len(str(one.published).partition(".")[2])
        assert round(one.computed, decimals) == one.published, one.quantity


def test_what_was_not_read_again_is_graded_so() -> None:
    grades = {section.title: {one.grade for one in section.comparisons} for section in SECTIONS}
    assert grades.pop("CAN: the worst instance is not the first") == {"recalled"}
    assert {grade for title in SEEN for grade in grades.pop(title)} == {"measured", "derived"}
    assert set.union(*grades.values()) == {"published"}


def test_what_a_bus_had_lies_between_no_stuff_bits_and_the_most() -> None:
    over: list[float] = []
    for section in SECTIONS:
        for one in section.comparisons if section.title in SEEN else ():
            assert one.relative_residual is not None
            if one.method == "worst stuffing":
                over.append(one.relative_residual)
            elif one.method == "no stuffing":
                assert one.relative_residual < 0
            else:
                assert abs(one.relative_residual) < 0.04, one.quantity
    # What verdicts say of the model.
    assert f"takes {100 * min(over):.0f} to {100 * max(over):.0f}% more" in kind_named("can").timing_models[0].error


def test_the_papers_can_system_spends_its_time_in_the_host() -> None:
    (one,) = SYSTEM.comparisons
    assert (one.published, one.computed, SYSTEM.data) == (10500, 135, "paper")
    assert "the other 10.4 ms are the host's, and no figure of the bus" in SYSTEM.note


def test_a_verdict_says_what_nobody_has_tested(run: Callable[..., CompletedProcess[str]]) -> None:
    bounds = "bounds of their stuff bits (8 frames that hardware counted)"
    words = f"{bounds}, response times (two worked examples); never measured: the cycle"
    for command in (("capacity", "can-servo-8"), ("evidence", "can")):
        assert words in " ".join(run(*command).stdout.split())
