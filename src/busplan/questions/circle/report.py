"""Answer of `busplan circle-test`: its verdict in sentences, tables and the drawing."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

from busplan.english import listed
from busplan.forms import blocks
from busplan.forms.charts import Drawing, Panel
from busplan.forms.numbers import period, period_value
from busplan.questions.base.sentences import FigureColumn, document, figure_table, with_profile
from busplan.questions.circle import (
    CIRCLE_BY_KEY,
    JITTER,
    NEGLIGIBLE_MM,
    CircleFigures,
    CircleTestAnswer,
    telling_measures,
)
from busplan.questions.circle.drawing import dial, magnified
from busplan.questions.circle.failures import MARGINS
from busplan.questions.circle.shape import ContourProfile
from busplan.sections.base import value_at
from busplan.sections.profile import Profile


def _circle_sentences(profile: Profile, result: CircleFigures) -> Iterator[blocks.Sentence]:
    """Sentences on tolerances and limits that the circle holds or breaks, and on the error source to attack first."""
    period, feed = _setup_values(result)
    subject = (blocks.Code(profile.name), " at ", period, " and ", feed)
    is_open = result.passed is None and result.stable is not None
    verdict = blocks.Words(result.verdict_word, "warns" if is_open else "passes" if result.passed else "fails")
    if result.failures:
        yield blocks.Sentence((*subject, ": ", verdict, ", ", *_failure_words(result).parts, "."), verdict.state)
        yield from _attack(result)
        return
    if profile.tolerance.judged:
        holds = blocks.Words("the circle holds", verdict.state)
        measures = blocks.joined(*_held(profile, result), by=", ").parts
        yield blocks.Sentence((*subject, ": ", holds, ", ", *measures, f"{_but(profile, result)}."), verdict.state)
    elif result.sources_matter is False:
        none = blocks.Words("no error source of this profile matters", verdict.state)
        labels = [CIRCLE_BY_KEY[key].label for key in telling_measures(profile)]
        least = f"{listed(labels, 'and')} below {NEGLIGIBLE_MM * 1e3:g} um"
        words = f"; {least}, so the test says nothing about the roundness of a machine{_are_zero(profile)}."
        yield blocks.Sentence((*subject, ": ", none, words), verdict.state)
    else:
        yield blocks.Sentence((*subject, ": ", *_unjudged(profile, result), "."), verdict.state)
    yield blocks.sentence(
        "The loop is stable, with a phase margin of {}{} or more and a gain margin of {}{} or more.",
        *(
            part
            for key, unit in MARGINS.items()
            for part in (
                blocks.ShownValue(getattr(profile.tolerance, key), key, unit, None),
                "" if key in profile.tolerance.model_fields_set else " (default)",
            )
        ),
    )


def _held(profile: Profile, result: CircleFigures) -> Iterator[blocks.Sentence]:
    """Each measure with a tolerance, and that tolerance."""
    for key in profile.tolerance.judged:
        measure = CIRCLE_BY_KEY[key]
        most = blocks.ShownValue(getattr(profile.tolerance, key), key, "um")
        yield blocks.sentence(f"{measure.label} {{}} of {{}}", blocks.attribute_value(measure, result), most)


def _but(profile: Profile, result: CircleFigures) -> str:
    """Why a held tolerance says little of a machine; empty where an error of its mechanics matters."""
    absent = _absent(profile)
    if {*_MECHANICS} <= {*absent}:
        return f"; but {listed(absent, 'and')} are 0 in this profile, so it says little"
    return "; but no error source of this profile matters, so it says little" if result.sources_matter is False else ""


_MECHANICS: Final = ("friction at reversals", "backlash", "squareness")
"""Error sources of the mechanics in words."""


def _are_zero(profile: Profile) -> str:
    """Usual error sources of a machine that a profile does not have, in words; empty if it has all."""
    absent = _absent(profile)
    return f": {listed(absent, 'and')} {'is' if len(absent) == 1 else 'are'} 0" if absent else ""


def _absent(profile: Profile) -> list[str]:
    """Usual error sources of a machine that a profile does not have."""
    axes = ("servo", "servo.x", "servo.y")
    usual = {
        "drive lag": [f"{axis}.drive_lag_us" for axis in axes],
        "friction at reversals": [f"{axis}.reversal_mm_s" for axis in axes],
        "backlash": ["mechanics.backlash_mm"],
        "squareness": ["mechanics.squareness_um_per_m"],
        "jitter": ["delivery.jitter_us"],
    }
    return [name for name, keys in usual.items() if not any(value_at(profile, key) for key in keys)]


def _unjudged(profile: Profile, result: CircleFigures) -> tuple[blocks.Part, ...]:
    """Measure that needs a tolerance, and its key."""
    key = telling_measures(profile)[0]
    measure = CIRCLE_BY_KEY[key]
    value = blocks.attribute_value(measure, result)
    return (
        f"{measure.label} ",
        value,
        "; ",
        blocks.Words("no tolerance set", "warns"),
        ": ",
        blocks.Code(f"tolerance.{key}"),
    )


def _attack(result: CircleFigures) -> Iterator[blocks.Sentence]:
    """Sentence on the error source to attack first for the first contour measure that fails."""
    measure, attack = result.failed_measure, result.to_attack
    if measure is None:
        return
    label = CIRCLE_BY_KEY[measure].label
    if attack is not None:
        source, removed_mm = attack
        what = "Shorten the period" if source.source == "period" else f"Attack {source.words}"
        yield blocks.sentence(
            f"{what} first: without it the {label} is {{}}, {{}} less.",
            blocks.attribute_value(CIRCLE_BY_KEY[measure], source),
            blocks.ShownValue(removed_mm, "removed_mm", "um", 3),
        )
    elif result.contributions is not None:
        yield blocks.Sentence((f"No error source of the profile, when removed, reduces the {label}.",))


def _setup_values(result: CircleFigures) -> tuple[blocks.ShownValue, blocks.ShownValue]:
    """Period and feed of a test."""
    return period_value(result.period_us), blocks.attribute_value(CIRCLE_BY_KEY["feed_mm_per_min"], result)


def _failure_words(result: CircleFigures) -> blocks.Sentence:
    """Tolerances and limits that the circle breaks, in words, without a full stop."""
    phrases = (
        blocks.Sentence(tuple(part if isinstance(part, str) else blocks.ShownValue(*part) for part in failure.parts()))
        for failure in result.failures
    )
    return blocks.joined(*phrases, by=", and ")


def _servo_sentence(profile: Profile, result: CircleFigures) -> Iterator[blocks.Sentence]:
    """Sentence on the grade of the servo values behind the figures; none without a simulation."""
    if result.stable is None:
        return
    if result.ideal_drive:
        yield blocks.Sentence(("The profile has no [servo]: an ideal drive was simulated.",), "warns")
        return
    state: blocks.State = "warns" if result.servo_grade == "assumed" else "neutral"
    yield blocks.Sentence((f"The servo values that the profile gives are {profile.servo.grades_text}.",), state)


_SHOWN: Final = (
    *("mean_contour_error_mm", "max_contour_error_mm", "radial_deviation_min_mm", "radial_deviation_max_mm"),
    *("circular_deviation_mm", "radius_deviation_mm", "phase_margin_deg", "gain_margin_db", "crossover_hz"),
    *("path", "radius_mm", "feed_mm_per_min", "period_us", "step_us", "duration_s", "setpoints", "loop"),
    *("update", "delay_us", "jitter_us"),
    *("stable", "passed"),
)
"""Figures of the table, in order."""
_HOST_ROWS: Final = ("update", "delay_us")
"""Rows of the table for loops on the host alone."""
ACT_TOGETHER: Final = blocks.Sentence(
    ("Sources interact: their increases need not add up. A source with a negative one hides another.",)
)
_LEAST_FALL_MM: Final = 1e-6
NO_SOURCES: Final = blocks.Sentence(("The profile has no error source that could be removed.",))


def circle_report(test: CircleTestAnswer) -> blocks.Report:
    """Report of `circle-test`."""
    return blocks.Report(
        blocks.Sentence(("Circle test of ", blocks.Code(test.profile.name))),
        tuple(_blocks(test)),
        circle_document(test),
        with_profile(test.profile.name, circle_records(test)),
    )


def _blocks(test: CircleTestAnswer) -> Iterator[blocks.Block]:
    """Verdict of each period, the periods side by side, and the error sources of each circle."""
    for result in test.results:
        yield from _circle_sentences(test.profile, result)
    simulated = (result for result in test.results if result.stable is not None)
    yield from _servo_sentence(test.profile, next(simulated, test.results[0]))
    if any(test.runs):
        yield _circle_table([result for result, run in zip(test.results, test.runs, strict=True) if run is not None])
    yield from _falling(test)
    if test.with_contributions:
        ranked = [result for result in test.results if result.contributions is not None]
        yield from (_contributions_table(result) for result in ranked if result.contributions)
        if ranked:
            yield ACT_TOGETHER if any(result.contributions for result in ranked) else NO_SOURCES
    for result, shape in zip(test.results, test.shapes, strict=True):
        # A cycle that does not fit has no circle; the verdict says why.
        if shape is not None:
            yield _circle_chart(shape.contour, result, test.profile)


def _falling(test: CircleTestAnswer) -> Iterator[blocks.Sentence]:
    """Sentence on why the largest error falls with a longer period, if it does."""
    circles = [result for result in test.results if result.max_contour_error_mm is not None]
    circles.sort(key=lambda result: result.period_us)
    for before, after in pairwise(circles):
        if (after.max_contour_error_mm or 0.0) < (before.max_contour_error_mm or 0.0) - _LEAST_FALL_MM:
            chord_mm = after.feed_mm_per_min / 60e6 * after.period_us
            inside_mm = chord_mm**2 / (8 * after.radius_mm)
            yield blocks.sentence(
                "The largest contour error falls from {} to {}: between set-points the path is a chord, up to {} "
                "inside the circle, and the ramp has circle.ramp_periods periods, so it is gentler. Both reduce an "
                "error outside the circle.",
                period_value(before.period_us),
                period_value(after.period_us),
                blocks.ShownValue(inside_mm, "inside_mm", "um", 3),
            )
            return


def _circle_table(results: Sequence[CircleFigures]) -> blocks.Table:
    """Figures of the circle test, the periods side by side."""
    columns = [FigureColumn(blocks.TableColumn(period(result.period_us)), result) for result in results]
    hidden = () if any(result.loop == "host" for result in results) else _HOST_ROWS
    hidden = hidden if any(result.jitter_us for result in results) else (*hidden, JITTER.key)
    rows = ((CIRCLE_BY_KEY[key], 0) for key in _SHOWN if key not in hidden)
    return figure_table(rows, columns, caption=blocks.Sentence(("Figures of the circle test",)))


def _contributions_table(result: CircleFigures) -> blocks.Table:
    """Error sources, ranked, each with a bar on a common scale."""
    ranked = result.contributions or ()
    removed = [source.removed_mm for source in ranked]
    least, most = min((0.0, *removed)), max((0.0, *removed))
    rows = []
    for source in ranked:
        added = blocks.ShownValue(source.removed_mm, "removed_mm", "um", 3, signed=True)
        left = (
            blocks.attribute_value(CIRCLE_BY_KEY[key], source)
            for key in ("max_contour_error_mm", "circular_deviation_mm")
        )
        rows.append(
            blocks.TableRow((source.words, blocks.Bar(added, least, most) if most > least else "", added, *left))
        )
    columns = (
        blocks.TableColumn("source", kind="words"),
        blocks.TableColumn("", kind="drawing"),
        blocks.TableColumn("adds", "um"),
        blocks.TableColumn("max", "um", group="without it"),
        blocks.TableColumn("G", "um", group="without it"),
    )
    caption = blocks.sentence(
        "Increase of the largest contour error by each source, at {} and {}",
        *_setup_values(result),
    )
    return blocks.Table(columns, tuple(rows), caption)


def _circle_chart(
    contour: ContourProfile | None, result: CircleFigures, profile: Profile
) -> blocks.Chart | blocks.Sentence:
    """The circle with its error magnified, or the reason why it is not drawn."""
    if contour is None:
        return blocks.Sentence(("Not drawn: ", *_failure_words(result).parts, "."))
    setup = _setup_values(result)
    tolerance_mm = profile.tolerance.max_contour_error_mm
    scale = magnified(contour.largest_mm, tolerance_mm=tolerance_mm)
    if scale is None:
        return blocks.sentence("At {} and {} there is no contour error to draw.", *setup)
    part = "at constant speed" if result.path == "trapezoid" else "on the turn"
    caption = blocks.sentence(f"Contour error {part}, at {{}} and {{}}", *setup)
    if result.max_contour_error_mm is not None:
        largest = blocks.attribute_value(CIRCLE_BY_KEY["max_contour_error_mm"], result)
        caption = blocks.sentence(f"The contour error {part} is {{}} or less, at {{}} and {{}}", largest, *setup)
    tolerance = blocks.ShownValue(tolerance_mm, "max_contour_error_mm", "um")
    limit = (
        blocks.sentence("the profile has no tolerance of the largest contour error.")
        if tolerance_mm is None
        else blocks.sentence("the tolerance of {} lies outside the drawing.", tolerance)
        if scale.tolerance_mm is None
        else blocks.sentence("the tolerance of {} dashed.", tolerance)
    )
    times = blocks.sentence(
        "Magnified {} times; rings every {}; bold: the nominal circle; the dot is the start of "
        "the turn, the arrow its direction; ",
        blocks.ShownValue(scale.magnification(result.radius_mm), decimals=0),
        blocks.ShownValue(scale.ring_um * scale.unit.per_um, unit=scale.unit.name),
    )
    drawing = Drawing(
        "Circle with its contour error magnified", (Panel(dial(contour, scale, profile.circle.direction)),)
    )
    return blocks.Chart(drawing, caption, blocks.joined(times, limit, by=""))


def circle_records(test: CircleTestAnswer) -> list[blocks.Record]:
    """A flat row for each period: the centre in two columns, failures by name, a column for each error source."""
    sources = sorted({part.source for result in test.results for part in result.contributions or ()})
    records = []
    for result in test.results:
        record = result._asdict()
        offset = record.pop("centre_offset_mm") or (None, None)
        record |= {"centre_offset_x_mm": offset[0], "centre_offset_y_mm": offset[1]}
        record["failures"] = [failure.name for failure in result.failures]
        removed = {part.source: part.removed_mm for part in record.pop("contributions") or ()}
        if test.with_contributions:
            record |= {f"removed_{source}_mm": removed.get(source) for source in sources}
        records.append(record)
    return records


def circle_document(test: CircleTestAnswer) -> blocks.JsonDocument:
    """Document of `busplan circle-test --format json`."""
    results = []
    for result in test.results:
        record = result._asdict()
        record["failures"] = [failure.document() for failure in result.failures]
        record["centre_offset_mm"] = result.centre_offset_mm and list(result.centre_offset_mm)
        ranked = record.pop("contributions")
        if test.with_contributions:
            record["contributions"] = None if ranked is None else [source._asdict() for source in ranked]
        results.append(record)
    return document("circle-test", profile=test.profile.name, results=results)


TRACE_COLUMNS: Final = (
    "period_us",
    "time_us",
    "command_x_mm",
    "command_y_mm",
    "x_mm",
    "y_mm",
    "contour_error_mm",
)

_BLOCK: Final = 4096
"""Rows converted to Python numbers at a time."""


def trace_records(test: CircleTestAnswer, *, every: int) -> Iterator[blocks.Record]:
    """Rows of every n-th step of each simulated period."""
    for result, run in zip(test.results, test.runs, strict=True):
        if run is None:
            continue
        trace = run.trace(every=every)
        columns = (
            trace.time_us,
            trace.command_x_mm,
            trace.command_y_mm,
            trace.x_mm,
            trace.y_mm,
            trace.contour_error_mm,
        )
        for start in range(0, len(trace.time_us), _BLOCK):
            # Python floats take four times the memory of numpy floats.
            block = [column[start : start + _BLOCK].tolist() for column in columns]
            for values in zip(*block, strict=True):
                yield dict(zip(TRACE_COLUMNS, (result.period_us, *values), strict=True))
