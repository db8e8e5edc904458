"""What `busplan explain` says: figures in their places, steps as they were computed, how well inputs are known."""

from collections.abc import Callable, Iterator

import pytest

from busplan.buses import kind_named
from busplan.buses.figure import Figure
from busplan.forms import render
from busplan.forms.blocks import Calculation, Chapter, Code, Report, ShownValue, Table, Words
from busplan.forms.numbers import sentence_text
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.explain.derivation import assumptions, explain, figures_of
from busplan.questions.explain.report import assumptions_report, assumptions_table, explain_report

ValuesIn = Callable[[object], Iterator[ShownValue]]

FIGURES = figures_of(kind_named("ieee1394"))


def sections(figure: str, **changes: object) -> list[Chapter]:
    """The derivations of a figure of paper-1ms."""
    profile = override(load("paper-1ms").profile, {key.replace("__", "."): value for key, value in changes.items()})
    found = explain_report(explain(profile, figure)).blocks()
    return [block for block in found if isinstance(block, Chapter)]


@pytest.mark.parametrize(("command", "figures"), FIGURES.items())
def test_every_figure_stands_at_its_place(
    command: str, figures: dict[str, Figure], values_of_the_document: Callable[[Report], int]
) -> None:
    profile = load("paper-1ms").profile
    # Of each command every third figure: all have the same steps.
    for key in list(figures)[::3]:
        found = explain(profile, f"{command}.{key}")
        steps = sum(len(one.steps) for one in found.derivations)
        inputs = sum(len(one.inputs) for one in found.derivations)
        # All inputs, and of the steps those that have a figure and no words.
        assert inputs <= values_of_the_document(explain_report(found)) <= inputs + steps, key


def test_the_title_has_the_result_the_caption_the_least_known_grade(values_in: ValuesIn) -> None:
    (section,) = sections("required_us", node__execution__grade="assumed")
    assert sentence_text(section.title) == "required_us of paper-1ms at 1 ms, paper model: 207.1175 us"
    (period, result) = values_in(section.title)
    assert (period.value, period.key) == (1000.0, "period_us")
    assert (result.value, result.key) == (207.11747005208332, "required_us")
    about, steps, inputs = section.blocks
    assert isinstance(steps, Calculation)
    assert isinstance(inputs, Table)
    assert inputs.caption is not None
    assert sentence_text(inputs.caption) == "Inputs of this figure; the weakest grade is assumed."
    assert inputs.stacks
    assert "What the whole cycle needs" in str(about)


def test_a_step_says_nothing_twice() -> None:
    for figure in ("failures", "hops", "required_us", "exceeded", "centre_offset_mm"):
        for section in sections(figure):
            (steps,) = (block for block in section.blocks if isinstance(block, Calculation))
            for step in steps.steps:
                result = step.result.text if isinstance(step.result, Words) else None
                said = [one for one in (step.formula, step.numbers, result) if one]
                assert len(set(said)) == len(said), step
                assert step.symbol != step.formula


def test_what_a_figure_is_made_of_is_named_and_nothing_is_none() -> None:
    def result(figure: str) -> str:
        (section,) = sections(figure)
        return sentence_text(section.title).partition(": ")[2]

    assert result("failures") == "none"
    assert result("cheapest_change") == "bus.gap_count = 10"
    assert result("contributions").startswith("reversal, drive_lag, drive_offset")
    assert result("centre_offset_mm") == "0.003879726, 0.003915455 mm"
    assert result("fits") == "yes"


def test_the_assumptions_are_a_table_of_their_own(values_of_the_document: Callable[[Report], int]) -> None:
    profile = load("paper-4ms").profile
    found = assumptions(profile)
    report = assumptions_report(profile, found)
    assert values_of_the_document(report) == len(found)
    table = assumptions_table(found)
    assert [column.heading for column in table.columns] == ["name", "value", "unit", "grade", "source", "meaning"]
    assert table.stacks
    for row, one in zip(table.rows, found, strict=True):
        name, value, *others = row.cells
        assert (name, others) == (Code(one.name), [one.unit, one.grade, one.source, one.meaning])
        assert isinstance(value, ShownValue)
        assert (value.value, value.unit) == (one.value, one.unit)
    text = render(report, "table")
    assert text.startswith("What the figures of paper-4ms rest on, the least well known first\n")
    assert "\nFigures to explain\n" in text
