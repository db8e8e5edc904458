"""Answer of `busplan plan`."""

from collections.abc import Iterator
from functools import partial

from busplan.buses.figure import AXES, NODES
from busplan.forms.blocks import (
    Block,
    Code,
    JsonDocument,
    Part,
    Record,
    Report,
    Sentence,
    ShownValue,
    Words,
    figure_value,
    sentence,
)
from busplan.forms.columns import sentence_text
from busplan.forms.numbers import listed, nouns, period_value
from busplan.profile.keys import flat
from busplan.questions.fit.figures import after_reset
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.constraints import CIRCLE
from busplan.questions.plan.freedoms import PERIOD, freedoms
from busplan.questions.plan.option import Option
from busplan.questions.plan.options_report import options_table
from busplan.questions.plan.planning import Plan
from busplan.questions.plan.relaxations import Relaxation
from busplan.questions.words.documents import document, with_profile
from busplan.questions.words.key_values import NewValues, change_meanings, settings_sentence
from busplan.questions.words.sentences import margin_parts, reset_sentence, warning_sentences
from busplan.sections.profile import Profile
from busplan.sections.transactions import TRANSACTION_KINDS


def plan_report(plan: Plan) -> Report:
    """Report of `plan`."""
    return Report(
        Sentence(("Plan of ", Code(plan.profile.name))),
        lambda: tuple(_blocks(plan)),
        partial(plan_document, plan),
        lambda: with_profile(plan.profile.name, plan_records(plan)),
    )


def _blocks(plan: Plan) -> Iterator[Block]:
    """The recommendation, or what stands in its way; a row for each step of the search, and what could be reached."""
    yield _headline(plan)
    yield from (_relaxed(plan, one) for one in plan.relaxations)
    yield from _warnings(plan)
    yield options_table(plan)
    mark = "" if plan.recommended is None else "* recommended. "
    yield Sentence((f"{mark}'Held by' is what keeps a row from passing, or its value from being better.",))
    if not all(option.proven for option in plan.options):
        yield Sentence(("? not proven: the search for a period was cut short (--max-circles).",))
    for one in plan.impossible:
        proven = "" if one.proven else " (not proven: the search was cut short, --max-circles)"
        reason = ShownValue(one.reason, "reason")
        yield sentence(f"{one.title.capitalize()}: none, {{}}{proven}.", reason)


# --- sentences ------------------------------------------------------------------------------------------------


def settings(profile: Profile, changes: NewValues) -> str:
    """Write changes as in a profile.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> settings(load("paper-4ms").profile, {"bus.nodes": 20, "bus.speed": "S400"})
    'bus.nodes = 20, bus.speed = "S400" (if all nodes can)'
    """
    return sentence_text(_settings(profile, changes))


def _settings(profile: Profile, changes: NewValues) -> Sentence:
    # The number of nodes is the goal here, so the note on a second bus does not apply.
    meanings = {key: words for key, words in change_meanings(bus_of(profile)).items() if key != "bus.nodes"}
    return settings_sentence(changes, meanings=meanings)


def _headline(plan: Plan) -> Sentence:
    option, subject = plan.recommended, _goal(plan)
    if option is None or plan.binding is not None:
        why = ShownValue("" if plan.binding is None else plan.binding.why, "why")
        none = Words("NO PLAN", "fails")
        return Sentence((*subject, ": ", none, f". No change of {_freed(plan)} is enough: ", why, "."), "fails")
    judged = plan.goal.tolerance.judges_contour
    circle = (" and passes the circle" if judged else ", and its circle is not judged") if plan.with_circle else ""
    margin = margin_parts(option.deciding)
    result = (Words("fits", "passes"), " with a margin of ", *margin, f"{circle}.")
    if not option.changes:
        return Sentence((*subject, ": nothing to change; it ", *result), "passes")
    first = (
        "" if plan.period_is_kept else f"the period must change, for no change of {_freed(plan, PERIOD)} is enough: "
    )
    changes = _settings(plan.goal, option.changes)
    return Sentence((*subject, f": {first}set ", *changes.parts, "; then it ", *result), "passes")


def _freed(plan: Plan, before: str | None = None) -> str:
    """What may be changed, in words; only what is cheaper than the freedom of a key."""
    known = [one for one in freedoms(plan.goal) if one.name in plan.free]
    cost = next((one.cost for one in known if before in one.keys), None)
    labels = [one.label for one in known if cost is None or one.cost < cost]
    return listed(labels, "and") if labels else "anything else"


def _relaxed(plan: Plan, one: Relaxation) -> Sentence:
    """Say what would be enough, and what to set then."""
    changes = _settings(plan.goal, one.changes).parts if one.changes else ("nothing to change",)
    if one.value is not None:
        value = ShownValue(one.value, one.relaxed)
        return Sentence((f"Enough would be {one.relaxed} = ", value, ": ", *changes, "."))
    what = "leave out the circle" if one.relaxed == CIRCLE else f"free the {_label(plan, one.relaxed)}"
    return Sentence((f"Enough would be to {what}: ", *changes, "."))


def _label(plan: Plan, name: str) -> str:
    return next(one.label for one in freedoms(plan.goal) if one.name == name)


def _goal(plan: Plan) -> tuple[Part, ...]:
    """The goal of the plan."""
    goal, network = plan.goal, network_of(plan.goal)
    nodes, axes = int(network.nodes), int(network.axes)
    return (
        *(Code(goal.name), " with "),
        *(figure_value(NODES, nodes), f" {nouns(nodes, 'node')} ("),
        *(figure_value(AXES, axes), f" {nouns(axes, 'axis')}) at "),
        period_value(goal.cycle.period_us),
    )


def _warnings(plan: Plan) -> Iterator[Sentence]:
    option = plan.recommended
    profile = plan.goal if option is None else option.profile
    nodes = int(network_of(profile).nodes)
    yield from warning_sentences(profile, nodes=nodes, most=nodes)
    if option is not None:
        yield from reset_sentence(after_reset(option.profile, option.deciding), option.profile)


# --- plain data -----------------------------------------------------------------------------------------------


def _options(plan: Plan) -> list[Record]:
    return [_record(plan, option) for option in plan.options]


def _record(plan: Plan, option: Option) -> Record:
    one, profile = option.deciding, option.profile
    others = option.others
    return {
        "title": option.title,
        "changes": plan.all_changes(option),
        "recommended": option.recommended,
        "timing_model": one.timing_model,
        "verdict": one.verdict,
        "fits": one.fits,
        "circle_refused_by": list(one.circle_refused_by),
        "fits_other_model": all(other.fits for other in others) if others else None,
        "margin_us": one.margin_us,
        "margin_other_model_us": min((other.margin_us for other in others), default=None),
        "bias_us": one.bias_us,
        "margin_corrected_us": one.margin_corrected_us,
        "uncertainty_us": one.uncertainty_us,
        "binding_term": one.binding_term,
        "passes": option.passes,
        "held_by": option.held_by,
        "proven": option.proven,
        "circle_passed": option.circle_passed,
        "circle_failures": list(option.circle_failures or ()),
        "nodes": one.nodes,
        "axes": one.axes,
        "max_nodes": one.max_nodes,
        "max_axes": one.max_axes,
        "limited_by": one.limited_by,
        "safe_nodes": one.safe_nodes,
        "safe_axes": one.safe_axes,
        "safe_limited_by": one.safe_limited_by,
        "period_us": one.period_us,
        "slice_ratio": profile.cycle.slice_ratio,
        **{key: getattr(one, key) for key in bus_of(profile).figures.planned},
        **{f"{kind}_bytes": int(getattr(network_of(profile).groups[0], f"{kind}_bytes")) for kind in TRANSACTION_KINDS},
    }


def plan_records(plan: Plan) -> list[Record]:
    """One row for each option, with its changes and failures as text."""
    return [
        {
            **record,
            "changes": [f"{key}={value}" for key, value in flat(record["changes"])],
            "circle_failures": "; ".join(record["circle_failures"]),
        }
        for record in _options(plan)
    ]


def plan_document(plan: Plan) -> JsonDocument:
    """Document of `busplan plan --format json`."""
    recommended = None if plan.recommended is None else plan.all_changes(plan.recommended)
    goal = network_of(plan.goal)
    return document(
        "plan",
        profile=plan.profile.name,
        goal={"nodes": int(goal.nodes), "axes": int(goal.axes)},
        free=list(plan.free),
        period_is_kept=plan.period_is_kept,
        recommended_changes=recommended,
        binding=None if plan.binding is None else {"constraint": plan.binding.key, "why": plan.binding.why},
        relaxations=[one._asdict() for one in plan.relaxations],
        options=_options(plan),
        impossible=[one._asdict() for one in plan.impossible],
    )
