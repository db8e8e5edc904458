"""Rows of a sweep as text: the same characters that `capacity` writes, in any chunking."""

import csv
import io
import json
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest

from busplan.buses.ieee1394.timing import TimingModelName
from busplan.forms import RowsForm, html, markdown, terminal
from busplan.forms.blocks import Report, ShownValue, Table
from busplan.forms.csv_rows import to_csv
from busplan.forms.numbers import sentence_text
from busplan.printable import to_json
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.capacity.report import capacity_records
from busplan.questions.fit.figures import capacity
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.blocks import Column, SweepBlock, figure_names, sweep
from busplan.questions.sweep.digest import Digest
from busplan.questions.sweep.grid import Listed, Steps, Values, checked_grid
from busplan.questions.sweep.rows import rows_writer
from busplan.sections.profile import Profile

ValuesIn = Callable[[object], Iterator[ShownValue]]

BOTH: tuple[TimingModelName, ...] = ("paper", "standard")
FIGURES = figure_names(load("paper-4ms").profile)
AXES: dict[str, Values] = {
    "bus.nodes": Steps(1, 16, 1, 3),
    "bus.gap_count": Listed((63, "optimal")),
    "cycle.period_us": Listed((250, 333.3, 4000)),
}


def blocks(chunk_points: int = 5) -> list[SweepBlock]:
    profile = load("paper-4ms").profile
    grid = checked_grid(profile, AXES, with_circle=False)
    return list(sweep(profile, grid, timing_models=BOTH, chunk_points=chunk_points))


def written(form: RowsForm, parts: list[SweepBlock], columns: Sequence[str], *, complete: bool = True) -> str:
    """What a sweep writes of some of its blocks."""
    profile = load("paper-4ms").profile
    found: list[bytes] = []
    table = Sweep(profile, checked_grid(profile, AXES, with_circle=False), BOTH, tuple(columns))
    writer = rows_writer(form, table, found.append)
    for part in parts:
        writer.add(part)
    writer.finish(complete=complete)
    return b"".join(found).decode()


def points() -> list[tuple[dict[str, object], Profile]]:
    profile = load("paper-4ms").profile
    grid = checked_grid(profile, AXES, with_circle=False)
    changes = [chunk.point(0) for chunk in grid.chunks(1)]
    return [(change, override(profile, change)) for change in changes]


@pytest.mark.parametrize("chunk_points", [1, 7])
def test_csv_is_what_capacity_writes_for_each_point(chunk_points: int) -> None:
    columns = (*AXES, *FIGURES)
    found = written("csv", blocks(chunk_points), columns)
    expected = []
    for changes, profile in points():
        rows = csv.reader(io.StringIO(to_csv(capacity_records(capacity(profile, timing_models=BOTH)))))
        assert next(rows) == list(FIGURES)
        expected += [[str(value) for value in changes.values()] + row for row in rows]
    assert list(csv.reader(io.StringIO(found))) == [list(columns), *expected]


def test_jsonl_is_what_capacity_writes_for_each_point() -> None:
    columns = (*AXES, *FIGURES)
    _, *lines = written("jsonl", blocks(), columns).splitlines()
    expected = [
        {**changes, **json.loads(to_json(row))}
        for changes, profile in points()
        for row in capacity_records(capacity(profile, timing_models=BOTH))
    ]
    assert [json.loads(line) for line in lines] == expected
    # Not only equal: 4.0 stays 4.0.
    assert [repr(json.loads(line)["period_us"]) for line in lines] == [repr(row["period_us"]) for row in expected]


def test_jsonl_begins_with_what_a_reader_must_know() -> None:
    header = json.loads(written("jsonl", [], FIGURES))
    assert (header["schema"], header["command"], header["profile"]) == (1, "sweep", "paper-4ms")
    assert (header["points"], header["rows"], header["varied"]["bus.gap_count"]) == (18, 36, 2)


@pytest.mark.parametrize(("chunk_points", "complete"), [(1, True), (5, False), (100, True)])
def test_the_json_document_holds_the_rows_of_json_lines(chunk_points: int, complete: bool) -> None:
    columns, parts = (*AXES, *FIGURES), blocks(chunk_points)
    # A sweep that was stopped has written some of its blocks.
    parts = parts if complete else parts[:1]
    document = json.loads(written("json", parts, columns, complete=complete))
    header, *lines = map(json.loads, written("jsonl", parts, columns).splitlines())
    assert document.pop("rows") == lines
    assert document.pop("complete") is complete
    assert header.pop("rows") == 36
    assert document == header


def test_a_json_document_without_rows_is_one() -> None:
    assert json.loads(written("json", [], FIGURES, complete=False))["rows"] == []


def test_what_does_not_exist_is_null_and_empty() -> None:
    (block,) = blocks(100)
    missing = Column(np.full(block.chunk.shape, np.nan))
    holed = block._replace(models=tuple({**one, "phase_margin_deg": missing} for one in block.models))
    assert '"phase_margin_deg": null}' in written("jsonl", [holed], ("fits", "phase_margin_deg"))
    assert written("csv", [holed], ("fits", "phase_margin_deg")).splitlines()[1] == "true,"
    top = Digest(swept(("bus.nodes", "phase_margin_deg")), sort_by="phase_margin_deg", ascending=True, top=3)
    top.add(holed)
    assert top.rows == []


def swept(columns: tuple[str, ...]) -> Sweep:
    profile = named("p")
    return Sweep(profile, checked_grid(profile, AXES, with_circle=False), BOTH, columns)


@pytest.mark.parametrize(("ascending", "top"), [(True, 1), (False, 4), (True, 1000)])
def test_top_rows_are_those_of_a_whole_sort(ascending: bool, top: int) -> None:
    kept = Digest(swept(("bus.nodes", "margin_us", "max_axes")), sort_by="max_axes", ascending=ascending, top=top)
    rows = []
    for block in blocks():
        kept.add(block)
        rows += [block.row(index, ("bus.nodes", "margin_us", "max_axes")) for index in range(2 * block.chunk.points)]
    rows.sort(key=lambda row: int(str(row["max_axes"])) * (1 if ascending else -1))
    assert kept.rows == rows[:top]


def test_without_a_sort_the_top_rows_are_the_first() -> None:
    kept = Digest(swept(("bus.nodes", "timing_model")), sort_by=None, ascending=False, top=3)
    for block in blocks(1):
        kept.add(block)
    assert [row["timing_model"] for row in kept.rows] == ["paper", "standard", "paper"]


def named(name: str) -> Profile:
    return load("paper-4ms").profile.model_copy(update={"name": name})


def test_the_summary_counts_points_under_each_model(values_in: ValuesIn) -> None:
    grid = checked_grid(named("p"), AXES, with_circle=False)
    digest = Digest(Sweep(named("p"), grid, BOTH, ()), top=0)
    for block in blocks(4):
        digest.add(block)
    pairs = [capacity(profile, timing_models=BOTH).results for _, profile in points()]
    by_hand = (sum(paper.fits for paper, _ in pairs), sum(standard.verdict == "fits" for _, standard in pairs))
    assert by_hand[1] <= sum(standard.fits for _, standard in pairs) < by_hand[0] < 18
    unsafe = sum(not capacity(profile).results[0].gap_count_safe for _, profile in points())
    lines = [sentence_text(one) for one in digest.sentences()]
    assert lines[0] == (
        f"p: 18 points; {by_hand[0]} fit by the closed form of the paper model, {by_hand[1]} shown to fit "
        "(standard model)."
    )
    refused = sum(bool(standard.circle_refused_by) for _, standard in pairs)
    assert lines[1] == f"The circle cannot be run at {refused} points: servo.step_us."
    assert (len(lines) == 3) == (unsafe > 0)
    partial = Digest(Sweep(named("p"), grid, BOTH, ()), top=0)
    partial.add(blocks(5)[0])
    stopped = next(partial.sentences())
    assert "3 points of 18 (interrupted)" in sentence_text(stopped)
    # Only the whole grid's number is in the document.
    assert [(value.value, value.key) for value in values_in(stopped)][:2] == [(3, ""), (18, "points")]


def test_a_varied_gap_count_below_the_safe_one_is_counted() -> None:
    profile = load("paper-4ms").profile
    grid = checked_grid(profile, {"bus.gap_count": Steps(0, 1, 1, 64)}, with_circle=False)
    digest = Digest(Sweep(profile, grid, BOTH, ()), top=0)
    for block in sweep(profile, grid, timing_models=BOTH):
        digest.add(block)
    # Two hops need 7: 0 to 6 are unsafe.
    *_, last = digest.sentences()
    assert (sentence_text(last), last.state) == ("At 7 points the gap count is unsafe (gap_count_safe).", "warns")


@pytest.mark.parametrize("follows", [False, True])
def test_a_payload_that_the_axes_do_not_change_is_said_to_be_so(follows: bool) -> None:
    own = override(named("p"), {"payload.read_bytes_per_axis": 8} if follows else {})
    digest = Digest(Sweep(own, checked_grid(own, {"node.axes": Steps(1, 1, 1, 3)}, with_circle=False), BOTH, ()), top=0)
    said = [sentence_text(one) for one in digest.sentences()]
    words = (
        "The payload does not depend on the axes of a node: payload.read_bytes_per_axis and "
        "payload.write_bytes_per_axis say what each adds."
    )
    assert (words in said) is not follows


COLUMNS = ("bus.gap_count", "timing_model", "margin_us", "utilisation", "exceeded", "fits", "phase_margin_deg")


def reported(*, sort_by: str | None = None, top: int = 7) -> Report:
    """The answer with a circle's figure that does not exist."""
    profile = load("paper-4ms").profile
    grid = checked_grid(profile, AXES, with_circle=False)
    digest = Digest(Sweep(named("<b>p|q"), grid, BOTH, COLUMNS), top=top, sort_by=sort_by, ascending=True)
    parts = []
    for block in blocks():
        missing = Column(np.full(block.chunk.shape, np.nan))
        parts.append(block._replace(models=tuple({**one, "phase_margin_deg": missing} for one in block.models)))
        digest.add(parts[-1])
    text = written("json", parts, COLUMNS)
    return digest.report(lambda: json.loads(text))


@pytest.mark.parametrize("sort_by", [None, "margin_us"])
def test_each_figure_of_a_row_stands_in_the_document(
    sort_by: str | None, values_of_the_document: Callable[[Report], int]
) -> None:
    assert values_of_the_document(reported(sort_by=sort_by)) == 7 * len(COLUMNS)


def test_a_row_that_does_not_fit_says_so_and_columns_are_the_registers() -> None:
    *_, table = reported(sort_by="margin_us", top=36).blocks()
    assert isinstance(table, Table)
    assert [(column.heading, column.unit) for column in table.columns] == [
        *((name, "") for name in COLUMNS[:3]),
        ("utilisation", "%"),
        *((name, "") for name in COLUMNS[4:]),
    ]
    fits = [row.cells[5] for row in table.rows]
    assert {(one.value, one.state) for one in fits if isinstance(one, ShownValue)} == {
        (False, "fails"),
        (True, "neutral"),
    }


def test_the_rows_of_the_answer_are_a_table_in_every_form_for_people() -> None:
    report = reported(sort_by="margin_us", top=2)
    lines = terminal.text(report).splitlines()
    assert lines[0].startswith("<b>p|q: 18 points; ")
    assert "2 of 36 rows, smallest margin_us first." in lines
    assert lines[-2].split()[-4:] == ["time", "no", "!", "-"]
    assert lines[-1] == "! fails."
    text = markdown.text(report)
    assert text.startswith("### Sweep of `<b>p|q`\n")
    assert [line.count(" | ") for line in text.splitlines() if line.startswith("| ")] == [6] * 4
    assert "**no**" in text
    page = html.page(report)
    assert '<data value="false"' in page
    assert "<b>p" not in page
