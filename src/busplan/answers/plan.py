"""`busplan plan`: for people, and as plain data."""

from typing import Any, Final

from busplan.analysis.network import bus_of
from busplan.analysis.planning.cures import changeable, listed
from busplan.analysis.planning.options import Option, Plan
from busplan.answers.documents import Document, Row, document
from busplan.answers.verdict_sentences import period, warnings
from busplan.buses.bus import Value
from busplan.forms.lines import BLANK, Line, plural, table, us
from busplan.sections.profile import Profile


def plan_lines(plan: Plan, *, with_circle: bool) -> list[Line]:
    """The recommendation, a row for each option, and what does not exist."""
    lines = [_headline(plan, with_circle=with_circle)]
    lines.extend(Line(warning, "warning") for warning in _warnings(plan))
    lines.extend((BLANK, *_table(plan.options)))
    lines.append(Line("* recommended. Margins in us; 'held by' is what keeps the value from being better."))
    if not all(option.proven for option in plan.options):
        lines.append(Line("? not proven: the search for a smaller period was cut short (--max-circles)."))
    for one in plan.impossible:
        proven = "" if one.proven else " (not proven: the search was cut short, --max-circles)"
        lines.append(Line(f"{one.title.capitalize()}: none, {one.reason}{proven}."))
    return lines


def settings(profile: Profile, changes: dict[str, Value]) -> str:
    """Write changes as a profile has them.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> settings(load("paper-4ms").profile, {"bus.nodes": 20, "bus.speed": "S400"})
    'bus.nodes = 20, bus.speed = "S400" (if all nodes can)'
    """
    # A number of nodes is what was asked for, never what a second bus would leave.
    meanings = bus_of(profile).change_meanings
    meaning = {key: f" ({meanings[key]})" for key in changes if key in meanings and key != "bus.nodes"}
    return ", ".join(f"{key} = {_value(value)}{meaning.get(key, '')}" for key, value in changes.items())


def goal_words(profile: Profile) -> str:
    """Say what is planned for."""
    nodes = profile.bus.nodes
    return f"{profile.name} with {plural(nodes, 'node')} ({plural(nodes * profile.node.axes, 'axis')})"


_OF_MODELS: Final = (
    ("", ""),
    (" both timing models", " in the tighter one"),
    (" every timing model", " in the tightest one"),
)
"""What fits, and in which there is least to spare: of one timing model, of two and of more."""


def _headline(plan: Plan, *, with_circle: bool) -> Line:
    option, circle = plan.recommended, " and passes the circle" if with_circle else ""
    subject = f"{goal_words(plan.goal)} at {period(plan.goal.cycle.period_us)}"
    models, tighter = _OF_MODELS[min(len(bus_of(plan.goal).timing_models), len(_OF_MODELS)) - 1]
    if option is None:
        why = _why_none(plan)
        bus = bus_of(plan.goal)
        safe = "" if bus.safety_figure is None else f" with a safe {bus.safety}"
        return Line(
            f"{subject}: NO PLAN. Of {listed(changeable(plan.goal), 'and')}, no change of what is left open "
            f"fits{models}{safe}{circle}{why}.",
            "bad",
        )
    spare = min(one.margin_us for one in (option.deciding, *option.others))
    result = f"fits{models} with {us(spare)} us to spare{tighter}{circle}"
    if not option.changes:
        return Line(f"{subject}: nothing to change; it {result}.", "good")
    return Line(f"{subject}: set {settings(plan.goal, option.changes)}; then it {result}.", "good")


def _why_none(plan: Plan) -> str:
    failures = next((one.circle_failures for one in plan.options if one.circle_failures), None)
    return f"; as it is, {failures[0]}" if failures else ""


def _warnings(plan: Plan) -> list[str]:
    option = plan.recommended
    profile = plan.goal if option is None else option.profile
    found = warnings(profile, nodes=profile.bus.nodes, most=profile.bus.nodes)
    limit = profile.limits.max_utilisation
    if option is not None and limit is not None and option.deciding.utilisation > limit:
        found.append(
            f"Warning: {option.deciding.utilisation:.1%} of the slice is used, and limits.max_utilisation allows "
            f"{limit:.1%}: `busplan check` will say so."
        )
    return found


_SHORT: Final = {
    "bus.nodes": "{} nodes",
    "cycle.slice_ratio": "ratio {}",
    "payload.read_bytes": "read {} bytes",
    "payload.write_bytes": "write {} bytes",
}


def _short(profile: Profile, changes: dict[str, Value]) -> str:
    words = {**_SHORT, **bus_of(profile).change_words}
    payloads = {value for key, value in changes.items() if key.startswith("payload.")}
    if len(changes) == 2 and len(payloads) == 1 and all(key.startswith("payload.") for key in changes):  # noqa: PLR2004
        return f"payload {payloads.pop()} bytes"
    parts = (
        period(float(value)) if key == "cycle.period_us" else words.get(key, f"{key} = {{}}").format(_value(value))
        for key, value in changes.items()
    )
    return ", ".join(parts) or "-"


def _value(value: Value) -> str:
    return f"{value:.12g}" if isinstance(value, float) else f'"{value}"' if isinstance(value, str) else str(value)


def _table(options: tuple[Option, ...]) -> list[Line]:
    first = options[0]
    models = [one.timing_model for one in (first.deciding, *first.others)]
    return table(
        [
            "",
            "option",
            "set",
            "largest\nterm",
            "held\nby",
            "circle",
            *(f"margin\n{model}" for model in models),
            "most\nnodes",
            "most\naxes",
        ],
        (_cells(option) for option in options),
        left=6,
    )


def _cells(option: Option) -> list[str]:
    circle = {None: "-", True: "passes", False: "FAILS"}[option.circle_passed]
    return [
        "*" * option.recommended + "?" * (not option.proven),
        option.title,
        _short(option.profile, option.changes),
        option.deciding.binding_term,
        option.bounded_by or "-",
        circle,
        *(us(one.margin_us) for one in (option.deciding, *option.others)),
        str(option.deciding.max_nodes),
        str(option.deciding.max_axes),
    ]


def plan_rows(plan: Plan) -> list[Row]:
    """One row an option."""
    return [_row(plan, option) for option in plan.options]


def _row(plan: Plan, option: Option) -> Row:
    one, profile = option.deciding, option.profile
    others = option.others
    return {
        "title": option.title,
        "changes": plan.all_changes(option),
        "recommended": option.recommended,
        "timing_model": one.timing_model,
        "fits": one.fits,
        "fits_other_model": all(other.fits for other in others) if others else None,
        "margin_us": one.margin_us,
        "margin_other_model_us": min((other.margin_us for other in others), default=None),
        "binding_term": one.binding_term,
        "bounded_by": option.bounded_by,
        "proven": option.proven,
        "circle_passed": option.circle_passed,
        "circle_failures": list(option.circle_failures or ()),
        "nodes": one.nodes,
        "axes": one.axes,
        "max_nodes": one.max_nodes,
        "max_axes": one.max_axes,
        "limited_by": one.limited_by,
        "period_us": one.period_us,
        "slice_ratio": profile.cycle.slice_ratio,
        **{key: getattr(one, key) for key in bus_of(profile).planned_figures},
        "read_bytes": profile.payload.read_bytes,
        "write_bytes": profile.payload.write_bytes,
    }


def plan_csv_rows(plan: Plan) -> list[Row]:
    """The same, the changes and failures as words."""
    return [
        {
            **row,
            "changes": [f"{key}={value}" for key, value in row["changes"].items()],
            "circle_failures": "; ".join(row["circle_failures"]),
        }
        for row in plan_rows(plan)
    ]


def plan_document(plan: Plan) -> Document:
    """Answer of `busplan plan`."""
    recommended: dict[str, Any] | None = None if plan.recommended is None else plan.all_changes(plan.recommended)
    return document(
        "plan",
        profile=plan.profile.name,
        goal={"nodes": plan.goal.bus.nodes, "axes": plan.goal.bus.nodes * plan.goal.node.axes},
        recommended_changes=recommended,
        options=plan_rows(plan),
        impossible=[one._asdict() for one in plan.impossible],
    )
