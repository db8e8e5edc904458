"""Verdicts in words that a person can act on."""

from collections.abc import Iterator, Mapping

from busplan.analysis.capacity.cycle import TIME
from busplan.analysis.capacity.figures import CapacityFigures
from busplan.analysis.capacity.verdict import Verdict
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.cures import changeable, listed
from busplan.forms.lines import Line, plural, us
from busplan.sections.profile import Profile


def period(value_us: float) -> str:
    """Write a period as people say it.

    Examples
    --------
    >>> period(4000.0), period(250.0), period(1234.5), period(2e6)
    ('4 ms', '250 us', '1.2345 ms', '2 s')
    """
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if value_us >= size:
            return f"{value_us / size:.12g} {unit}"
    return f"{value_us:.12g} us"


def verdict_lines(verdict: Verdict, profile: Profile) -> Iterator[Line]:
    """Say what the verdict is, what the bus carries, what to change, and what to beware of."""
    yield _headline(verdict, profile)
    if not verdict.models_agree:
        yield Line(f"The {verdict.deciding.timing_model} model decides.")
    figures = verdict.deciding
    yield Line(f"Largest term: {figures.binding_term}, {us(binding_us(figures))} us of {us(figures.required_us)} us.")
    yield Line(_carries(verdict))
    yield _advice(verdict, profile)
    yield from execution_line(profile)
    for warning in warnings(profile, nodes=figures.nodes, most=figures.max_nodes):
        yield Line(warning, "warning")


def binding_us(figures: CapacityFigures) -> float:
    """Size of the largest term [us]."""
    return max(float(term.us) for term in figures.terms)


def warnings(profile: Profile, *, nodes: int, most: int) -> list[str]:
    """What to beware of, whatever the verdict.

    Parameters
    ----------
    profile
        The network.
    nodes
        Nodes on the bus [1].
    most
        Largest number of nodes that the report speaks of [1].
    """
    return bus_of(profile).warnings(network_of(profile), nodes=[number for number in (nodes, most) if number])


def execution_line(profile: Profile) -> Iterator[Line]:
    """Say how the execution time is known, wherever a figure is shown that rests on it; nothing where nobody says."""
    grade = profile.node.execution.grade
    if grade is not None:
        text = f"The execution time behind these figures is {grade}."
        yield Line(text, "warning" if grade == "assumed" else "plain")


def _headline(verdict: Verdict, profile: Profile) -> Line:
    subject = f"{profile.name} at {period(verdict.period_us)}"
    figures = verdict.deciding
    same = all(other.exceeded == figures.exceeded for other in verdict.others)
    if verdict.models_agree and same:
        others = "".join(f"; {other.timing_model} agrees" for other in verdict.others)
        text = f"{subject}: {story(figures, profile)} ({figures.timing_model} model{others})."
    else:
        loud = "" if verdict.models_agree else " THE MODELS DISAGREE."
        stories = "; ".join(f"{one.timing_model}: {story(one, profile)}" for one in verdict.all_figures)
        text = f"{subject}:{loud} {stories}."
    return Line(text, "good" if verdict.all_well else "bad")


def story(figures: CapacityFigures, profile: Profile) -> str:
    """Say of one set of figures whether it fits, and by how much or why not."""
    if figures.fits:
        safe = "" if figures.safe else f", but only with an unsafe {bus_of(profile).safety}"
        return (
            f"fits, {us(figures.margin_us)} us to spare, {figures.utilisation:.1%} of "
            f"{us(figures.available_us)} us used{safe}"
        )
    reasons = ", and ".join(_reason(key, figures, profile) for key in figures.exceeded)
    return f"does not fit, {reasons}"


def _reason(key: str, figures: CapacityFigures, profile: Profile) -> str:
    limit = bus_of(profile).limit(key)
    if limit is not None:
        return limit.words(network_of(profile))
    needed = f"{us(figures.required_us)} us needed of {us(figures.available_us)} us"
    return f"{us(-figures.margin_us)} us short, {needed}"


def _carries(verdict: Verdict) -> str:
    answers = dict.fromkeys((one.max_nodes, one.max_axes, one.limited_by) for one in verdict.all_figures)
    if len(answers) == 1:
        ((nodes, axes, limit),) = answers
        return f"The bus carries {_nodes(nodes, axes)}, limited by {limit}."
    stories = (
        f"{_nodes(one.max_nodes, one.max_axes)} by the {one.timing_model} model, limited by {one.limited_by}"
        for one in verdict.all_figures
    )
    return f"The bus carries {'; '.join(stories)}."


def _nodes(nodes: int, axes: int) -> str:
    return f"{plural(nodes, 'node')} ({plural(axes, 'axis')})"


def _advice(verdict: Verdict, profile: Profile) -> Line:
    change, figures = verdict.change, verdict.deciding
    if change is None:
        return _no_advice(verdict, profile)
    meanings = bus_of(profile).change_meanings
    settings = ", ".join(_setting(key, value, meanings) for key, value in change.changes.items())
    spare = f"{us(change.figures.margin_us)} us to spare"
    if verdict.all_well:
        more = plural(change.nodes - figures.max_nodes, "more node")
        carried = _nodes(change.nodes, change.nodes * profile.node.axes)
        return Line(f"Cheapest way to {more} ({figures.timing_model} model): {settings}, which carries {carried}.")
    models = " and ".join(one.timing_model for one in verdict.all_figures)
    purpose = "make it safe" if all(one.fits for one in verdict.all_figures) else "make it fit"
    return Line(f"Cheapest way to {purpose} ({models}): {settings}, which leaves {spare}.")


def _no_advice(verdict: Verdict, profile: Profile) -> Line:
    """Say that there is no change to advise, and why."""
    bus, figures = bus_of(profile), verdict.deciding
    if not verdict.all_well:
        if all(one.fits for one in verdict.all_figures):
            return Line(bus.no_safe_setting, "bad")
        return Line(f"No change of {listed(changeable(profile), 'or')} alone makes it fit.", "bad")
    if figures.limited_by == TIME:
        return Line(f"No change of {listed(changeable(profile, structure=False), 'or')} alone carries more nodes.")
    limit = bus.limit(figures.limited_by)
    most = "" if limit is None else f"{limit.most(network_of(profile)):g} {limit.key}"
    return Line(f"No setting carries more nodes: {most} are the {bus.limits_of}'s limit.")


def _setting(key: str, value: object, meanings: Mapping[str, str]) -> str:
    meaning = f" ({meanings[key]})" if key in meanings else ""
    return f"{key} = {value}{meaning}"
