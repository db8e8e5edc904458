"""The verdict of `capacity` in sentences."""

from collections.abc import Iterator, Mapping, Sequence

from busplan.analysis.capacity.cycle import TIME
from busplan.analysis.capacity.figures import CapacityFigures
from busplan.analysis.capacity.verdict import Verdict
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.cures import changeable, listed
from busplan.answers.key_values import settings_sentence
from busplan.buses.figure import AVAILABLE, MARGIN, MAX_AXES, MAX_NODES, REQUIRED, UTILISATION
from busplan.forms.blocks import Code, Part, Sentence, ShownValue, count_value, figure_value, joined, sentence
from busplan.forms.numbers import nouns, period_value
from busplan.sections.profile import Profile

Places = Mapping[str, str]
"""JSON pointer to the figures of each timing model."""
NO_PLACES: Places = {}


def verdict_sentences(verdict: Verdict, profile: Profile, *, places: Places = NO_PLACES) -> Iterator[Sentence]:
    """Say the verdict, what the bus carries, the advised change, and warnings.

    Parameters
    ----------
    verdict
        The verdict.
    profile
        The network.
    places
        JSON pointers to its figures.
    """
    figures = verdict.deciding
    at = places.get(figures.timing_model, "")
    yield _headline(verdict, profile, places)
    if not verdict.models_agree:
        yield sentence(f"The {figures.timing_model} model decides.")
    largest = max(figures.terms, key=lambda term: term.us)
    yield sentence(
        f"Largest term: {figures.binding_term}, {{}} of {{}}.",
        ShownValue(largest.us, largest.key, "us", 3, at=_place(at, largest.key)),
        figure_value(REQUIRED, figures.required_us, at=_place(at, REQUIRED.key)),
    )
    yield _carries(verdict, places)
    yield _advice(verdict, profile, places)
    yield from execution_sentence(profile)
    yield from warning_sentences(profile, nodes=figures.nodes, most=figures.max_nodes)


def warnings(profile: Profile, *, nodes: int, most: int) -> list[str]:
    """Warnings, whatever the verdict.

    Parameters
    ----------
    profile
        The network.
    nodes
        Nodes on the bus [1].
    most
        Largest number of nodes in the report [1]; 0 if it has none.
    """
    return bus_of(profile).warnings(network_of(profile), nodes=[number for number in (nodes, most) if number])


def warning_sentences(profile: Profile, *, nodes: int, most: int) -> Iterator[Sentence]:
    """Warnings as sentences; see `warnings`."""
    return (Sentence((words,), "warns") for words in warnings(profile, nodes=nodes, most=most))


def execution_sentence(profile: Profile) -> Iterator[Sentence]:
    """Say how the execution time behind the figures is known; nothing if the profile has no grade."""
    grade = profile.node.execution.grade
    if grade is not None:
        text = f"The execution time behind these figures is {grade}."
        yield sentence(text, state="warns" if grade == "assumed" else "neutral")


def _place(at: str, key: str) -> str:
    return f"{at}/{key}" if at else ""


def _headline(verdict: Verdict, profile: Profile, places: Places) -> Sentence:
    figures = verdict.deciding
    at = _place(places.get(figures.timing_model, ""), "period_us")
    subject = (Code(profile.name), " at ", period_value(verdict.period_us, at=at))
    same = all(other.exceeded == figures.exceeded for other in verdict.others)
    parts: list[Part] = []
    if verdict.models_agree and same:
        others = "".join(f"; {other.timing_model} agrees" for other in verdict.others)
        own = story(figures, profile, at=places.get(figures.timing_model, ""))
        parts = [": ", *own, f" ({figures.timing_model} model{others})."]
    else:
        parts = [": " if verdict.models_agree else ": THE MODELS DISAGREE. "]
        for number, one in enumerate(verdict.all_figures):
            own = story(one, profile, at=places.get(one.timing_model, ""))
            parts += [f"{'; ' if number else ''}{one.timing_model}: ", *own]
        parts.append(".")
    return Sentence((*subject, *parts), "passes" if verdict.all_well else "fails")


def story(figures: CapacityFigures, profile: Profile, *, at: str = "") -> tuple[Part, ...]:
    """Say whether a cycle fits, and by how much or why not.

    Parameters
    ----------
    figures
        The figures.
    profile
        The network.
    at
        JSON pointer to them.
    """
    available = figure_value(AVAILABLE, figures.available_us, at=_place(at, AVAILABLE.key))
    if figures.fits:
        safe = "" if figures.safe else f", but only with an unsafe {bus_of(profile).safety}"
        return sentence(
            f"fits, {{}} to spare, {{}} of {{}} used{safe}",
            figure_value(MARGIN, figures.margin_us, at=_place(at, MARGIN.key)),
            figure_value(UTILISATION, figures.utilisation, at=_place(at, UTILISATION.key))._replace(decimals=1),
            available,
        ).parts
    needed = figure_value(REQUIRED, figures.required_us, at=_place(at, REQUIRED.key))
    short = ShownValue(-figures.margin_us, MARGIN.key, "us", 3)
    broken = (bus_of(profile).limit(key) for key in figures.exceeded)
    reasons = (
        sentence("{} short, {} needed of {}", short, needed, available)
        if limit is None
        else Sentence((limit.words(network_of(profile)),))
        for limit in broken
    )
    return "does not fit, ", *joined(*reasons, by=", and ").parts


def _carries(verdict: Verdict, places: Places) -> Sentence:
    answers = dict.fromkeys((one.max_nodes, one.max_axes, one.limited_by) for one in verdict.all_figures)
    same = len(answers) == 1
    stories = (
        joined(
            _nodes(one.max_nodes, one.max_axes, at=places.get(one.timing_model, "")),
            sentence(f"{'' if same else f' by the {one.timing_model} model'}, limited by {one.limited_by}"),
            by="",
        )
        for one in ((verdict.deciding,) if same else verdict.all_figures)
    )
    return Sentence(("The bus carries ", *joined(*stories, by="; ").parts, "."))


def _nodes(nodes: int, axes: int, *, at: str = "") -> Sentence:
    return sentence(
        f"{{}} {nouns(nodes, 'node')} ({{}} {nouns(axes, 'axis')})",
        count_value(nodes, MAX_NODES.key, at=_place(at, MAX_NODES.key)),
        count_value(axes, MAX_AXES.key, at=_place(at, MAX_AXES.key)),
    )


def _advice(verdict: Verdict, profile: Profile, places: Places) -> Sentence:
    change, figures = verdict.change, verdict.deciding
    if change is None:
        return _no_advice(verdict, profile)
    at = places.get("change", "")
    settings = settings_sentence(
        change.changes, meanings=bus_of(profile).change_meanings, at=_place(at, "changes"), quotes=False
    ).parts
    if verdict.all_well:
        more = change.nodes - figures.max_nodes
        return Sentence(
            (
                *("Cheapest way to ", count_value(more), f" more {nouns(more, 'node')} "),
                *(f"({figures.timing_model} model): ", *settings, ", which carries "),
                *_nodes(change.nodes, change.nodes * profile.node.axes).parts,
                ".",
            )
        )
    models = " and ".join(one.timing_model for one in verdict.all_figures)
    purpose = "make it safe" if all(one.fits for one in verdict.all_figures) else "make it fit"
    spare = figure_value(MARGIN, change.figures.margin_us, at=_place(at, MARGIN.key))
    return Sentence((f"Cheapest way to {purpose} ({models}): ", *settings, ", which leaves ", spare, " to spare."))


def _no_advice(verdict: Verdict, profile: Profile) -> Sentence:
    """Say that no change is advised, and why."""
    bus, figures = bus_of(profile), verdict.deciding
    if not verdict.all_well:
        if all(one.fits for one in verdict.all_figures):
            return sentence(bus.no_safe_setting, state="fails")
        return sentence(f"No change of {listed(changeable(profile), 'or')} alone makes it fit.", state="fails")
    if figures.limited_by == TIME:
        return sentence(f"No change of {listed(changeable(profile, structure=False), 'or')} alone carries more nodes.")
    limit = bus.limit(figures.limited_by)
    if limit is None:
        return sentence(f"No setting carries more nodes: that is the {bus.limits_of}'s limit.")
    most = count_value(limit.most(network_of(profile)))
    return sentence(f"No setting carries more nodes: {{}} {limit.key} are the {bus.limits_of}'s limit.", most)


def places_of(results: Sequence[CapacityFigures], *, start: int, change: int) -> dict[str, str]:
    """JSON pointers to the figures of one period in the document of `capacity`.

    Parameters
    ----------
    results
        Figures of the period, one set for each timing model.
    start
        Index of the first one in all results.
    change
        Index of the period in the verdicts.
    """
    own = {one.timing_model: f"/results/{start + number}" for number, one in enumerate(results)}
    return {**own, "change": f"/verdicts/{change}/cheapest_change"}
