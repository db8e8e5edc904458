"""Answer of `busplan plan`: its sentences, the table of its options, and its document."""

from collections.abc import Iterator, Mapping
from typing import Any

from busplan.buses.figure import AXES, MARGIN_CORRECTED, NODES, SAFE_AXES, SAFE_NODES
from busplan.english import listed, nouns
from busplan.forms import blocks
from busplan.forms.numbers import MISSING, period_value
from busplan.profile.edit import whole
from busplan.profile.kinds import flat
from busplan.questions.base import sentences
from busplan.questions.fit.figures import COUNTS, CycleFigures
from busplan.questions.fit.network import PERIOD
from busplan.questions.plan import Option, PlanAnswer, Relaxation
from busplan.sections.base import TRANSACTION_KINDS


def plan_report(plan: PlanAnswer) -> blocks.Report:
    """Report of `plan`: the recommendation, or what stands in its way, and a row for each step of the search."""
    records = [_record(plan, option) for option in plan.options]
    rows = [{**record, "changes": [f"{key}={value}" for key, value in flat(record["changes"])]} for record in records]
    return blocks.Report(
        blocks.Sentence(("Plan of ", blocks.Code(plan.profile.name))),
        tuple(_blocks(plan)),
        sentences.document(
            "plan",
            profile=plan.profile.name,
            goal=sentences.fields(plan.options[0].figures, "nodes", "axes"),
            free=[freedom.name for freedom in plan.free],
            **sentences.fields(plan, "period_is_kept", "recommended_changes"),
            binding=None if plan.binding is None else {"constraint": plan.binding.key, "reason": plan.binding.why},
            relaxations=[sentences.fields(relaxation, "relaxed", "changes") for relaxation in plan.relaxations],
            options=records,
        ),
        sentences.with_profile(plan.profile.name, rows),
    )


def _blocks(plan: PlanAnswer) -> Iterator[blocks.Block]:
    yield _headline(plan)
    yield from (_relaxed(plan, relaxation) for relaxation in plan.relaxations)
    yield from sentences.warning_sentences(plan.warnings)
    yield from sentences.reset_sentence(plan.after_reset)
    yield _options_table(plan)
    if idle := [option.title.removeprefix("+ ") for option in plan.options if _is_idle(plan, option)]:
        yield blocks.Sentence((f"No help: {', '.join(idle)}.",))
    mark = "" if plan.recommended is None else "* recommended. "
    circle = " No circle was run: a plan is of the bus alone." if plan.profile.asks_for_circle else ""
    yield blocks.Sentence((f"{mark}'Held by' names the limit that keeps a row from fitting.{circle}",))


def settings(meanings: Mapping[str, str], changes: sentences.NewValues) -> blocks.Sentence:
    """Write changes as in a profile.

    Examples
    --------
    >>> from busplan.forms.numbers import sentence_text
    >>> sentence_text(settings({"bus.speed": "if all nodes support it"}, {"bus.nodes": 20, "bus.speed": "S400"}))
    'bus.nodes = 20, bus.speed = "S400" (if all nodes support it)'
    """
    # The number of nodes is the goal here, so the note on a second bus does not apply.
    return sentences.settings_sentence(
        changes, meanings={key: words for key, words in meanings.items() if key != "bus.nodes"}
    )


def _headline(plan: PlanAnswer) -> blocks.Sentence:
    option, subject = plan.recommended, _goal(plan)
    if option is None or plan.binding is not None:
        why = blocks.ShownValue("" if plan.binding is None else plan.binding.why, "why")
        none = blocks.Words("NO PLAN", "fails")
        return blocks.Sentence((*subject, ": ", none, f". No change of {_freed(plan)} is enough: ", why, "."), "fails")
    margin = () if option.cycle is None else (" with a corrected margin of ", *sentences.margin_parts(option.cycle))
    result = (blocks.Words("fits", "passes"), *margin, ".")
    if not option.changes:
        if not plan.wanted:
            return blocks.Sentence((*subject, ": nothing to change; it ", *result), "passes")
        written: dict[str, Any] = dict(flat({key: whole(value) for key, value in plan.wanted.items()}))
        wanted = settings(plan.meanings, written)
        return blocks.Sentence((*subject, ": ", *wanted.parts, " is all that changes; it ", *result), "passes")
    first = "" if plan.period_is_kept else f"the period must change: no change of {_freed(plan, PERIOD)} is enough; "
    changes = settings(plan.meanings, option.changes)
    return blocks.Sentence((*subject, f": {first}set ", *changes.parts, "; then it ", *result), "passes")


def _freed(plan: PlanAnswer, before: str | None = None) -> str:
    """Freedoms, in words; only those cheaper than the freedom of a key."""
    cost = next((freedom.cost for freedom in plan.free if before in freedom.keys), None)
    labels = [freedom.label for freedom in plan.free if cost is None or freedom.cost < cost]
    return listed(labels, "and") if labels else "anything else"


def _relaxed(plan: PlanAnswer, relaxation: Relaxation) -> blocks.Sentence:
    """Say what would be enough, and what to set then."""
    changes = settings(plan.meanings, relaxation.changes)
    return blocks.Sentence((f"Enough would be to free the {relaxation.label}: ", *changes.parts, "."))


def _goal(plan: PlanAnswer) -> tuple[blocks.Part, ...]:
    """The goal of the plan."""
    goal, figures = plan.goal, plan.options[0].figures
    if not plan.goal.has_cycle:
        return (blocks.Code(goal.name),)
    return (
        *(blocks.Code(goal.name), " with "),
        *(blocks.attribute_value(NODES, figures), f" {nouns(figures.nodes, 'node')} ("),
        *(blocks.attribute_value(AXES, figures), f" {nouns(figures.axes, 'axis')}) at "),
        period_value(goal.cycle.period_us),
    )


def _record(plan: PlanAnswer, option: Option) -> blocks.Record:
    figures, profile, others = option.figures, option.profile, option.others
    values = {**figures.values(), "slice_ratio": profile.cycle.slice_ratio if profile.has_cycle else None}
    return {
        "title": option.title,
        "changes": plan.all_changes(option),
        "recommended": option.recommended,
        **sentences.fields(figures, "timing_model", "verdict", "fits"),
        "fits_other_model": all(model.fits for model in others) if others else None,
        "margin_us": values["margin_us"],
        "margin_other_model_us": min((one.margin_us for one in others if isinstance(one, CycleFigures)), default=None),
        **{key: values[key] for key in ("bias_us", "margin_corrected_us", "uncertainty_us", "binding_term")},
        "held_by": option.held_by,
        **{key: values[key] for key in ("nodes", "axes", *COUNTS, "period_us", "slice_ratio")},
        **{key: values[key] for key in figures.bus_figures.planned},
        # Of the first nodes; a bus of messages alone has none.
        **{
            f"{kind}_bytes": next((int(group.bytes_of(kind)) for group in profile.node_groups), None)
            for kind in TRANSACTION_KINDS
        },
    }


def _options_table(plan: PlanAnswer) -> blocks.Table:
    """Settings and results of each step that changes something; the recommended one has a mark."""
    has_counts = any(option.cycle and option.cycle.safe_nodes is not None for option in plan.options)
    columns = (
        blocks.TableColumn("free to change", kind="words"),
        blocks.TableColumn("", kind="words"),
        blocks.TableColumn("set", kind="words", wraps=True),
        blocks.TableColumn("largest term", kind="words", rank=2),
        blocks.TableColumn("held by", kind="words"),
        blocks.TableColumn(MARGIN_CORRECTED.label, "us"),
        *(blocks.TableColumn(heading, group="safe", rank=1) for heading in ("nodes", "axes") if has_counts),
    )
    shown = (option for option in plan.options if not _is_idle(plan, option))
    return blocks.Table(columns, tuple(_row(option, has_counts=has_counts) for option in shown), heads=2)


def _is_idle(plan: PlanAnswer, option: Option) -> bool:
    """Whether a step of the search changes nothing that the step before it did not."""
    place = plan.options.index(option)
    return place > 0 and option.changes == plan.options[place - 1].changes


def _row(option: Option, *, has_counts: bool) -> blocks.TableRow:
    cycle = option.cycle
    cells: tuple[blocks.Cell, ...] = (
        option.title,
        "*" * option.recommended,
        sentences.settings_sentence(option.changes, meanings={}) if option.changes else MISSING,
        cycle.bus_figures.term_label(cycle.binding_term) if cycle else MISSING,
        blocks.ShownValue(option.held_by, "held_by"),
        blocks.Sentence(sentences.margin_parts(cycle, unit=False)) if cycle else MISSING,
        *(blocks.attribute_value(figure, cycle) for figure in (SAFE_NODES, SAFE_AXES) if has_counts),
    )
    return blocks.TableRow(cells, highlighted=option.recommended)
