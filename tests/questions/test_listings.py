"""What `busplan paper`, `profiles` and `rule` say."""

from collections import Counter
from collections.abc import Callable, Iterator
from subprocess import CompletedProcess

import busplan
from busplan.forms import render
from busplan.forms.blocks import Chapter, Report, ShownValue, Snippet, Table
from busplan.gate.rules import NEVER_SUPPRESSED, all_rules, rule_report, rules_report

Run = Callable[..., CompletedProcess[str]]
ValuesIn = Callable[[object], Iterator[ShownValue]]


def test_paper_has_every_comparison_once(values_of_the_document: Callable[[Report], int], values_in: ValuesIn) -> None:
    answer = busplan.evidence(paper=True)
    sections, report, figures = answer.kinds[0].sections, answer.report(), answer.to_dict()["figures"]
    shown = [(value.key, value.value) for value in values_in(tuple(report.blocks))]
    assert len(shown) == values_of_the_document(report)
    for key in ("computed", "residual", "relative_residual"):
        assert Counter(own for name, own in shown if name == key) == Counter(one[key] for one in figures)
    blocks = [block for block in report.blocks if isinstance(block, Chapter)]
    assert [str(block.title.parts[0]) for block in blocks] == [section.title for section in sections]
    assert [block.blocks[0].parts[0] for block in blocks] == [section.note for section in sections]  # type: ignore[union-attr]


def test_no_residual_of_the_paper_is_rounding_dust() -> None:
    text = render(busplan.evidence(paper=True).report(), "table")
    assert "e-" not in text.replace("time-", "")
    assert "-0.0 " not in text
    assert "-0.0\n" not in text
    row = "no payload  us         3.11  published        3.104   -0.0064  -0.2                3.110    0.0000  0.0\n"
    assert row in text


def test_evidence_has_every_comparison_once(
    values_of_the_document: Callable[[Report], int], values_in: ValuesIn
) -> None:
    answer = busplan.evidence("ieee1394")
    report, figures = answer.report(), answer.to_dict()["figures"]
    shown = [value.value for value in values_in(tuple(report.blocks)) if value.key == "computed"]
    assert values_of_the_document(report) > len(shown)
    assert Counter(shown) == Counter(one["computed"] for one in figures)
    assert {one["data"] for one in figures} == {"paper", "dvrk", "ieee1394"}


def test_each_profile_is_a_section(run: Run) -> None:
    text = run("profiles").stdout
    assert "paper-two-node: 1 node at 4 ms, paper model leads\n" in text
    assert "\n\n\n" not in text
    assert "### Shipped profiles\n\n#### `can-fd-arm-7`" in run("profiles", "--format", "markdown").stdout


def test_the_rules_are_one_table() -> None:
    rules = list(all_rules().values())
    (table,) = rules_report(rules).blocks
    assert isinstance(table, Table)
    assert [row.cells[0][0] for row in table.rows] == [rule.code for rule in rules]


def test_a_rule_is_explained_with_what_suppresses_it(values_in: ValuesIn) -> None:
    for code in all_rules():
        rule = all_rules()[code]
        report = rule_report(rule)
        text = render(report, "table")
        assert text.startswith(f"{code} {rule.name} ({rule.severity}): {rule.summary}\n{rule.explanation}\n")
        snippets = [block for block in report.blocks if isinstance(block, Snippet)]
        if code in NEVER_SUPPRESSED:
            assert text.endswith("\nIt cannot be suppressed.\n")
            assert snippets == []
        else:
            assert snippets == [Snippet((f"# busplan: ignore[{code}] reason",))]
        assert not any(isinstance(value, ShownValue) for value in values_in(tuple(report.blocks)))
