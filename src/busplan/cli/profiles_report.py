"""Answer of `busplan profiles`."""

from collections.abc import Sequence

from busplan.english import nouns
from busplan.forms.blocks import Chapter, Code, Record, Report, Sentence, count_value, sentence
from busplan.forms.numbers import period_value
from busplan.questions.base.sentences import document
from busplan.sections.profile import Profile


def profiles_report(profiles: Sequence[Profile]) -> Report:
    """Report of `profiles`: the profiles that every command takes by name.

    Parameters
    ----------
    profiles
        The shipped profiles.
    """
    records = [_record(profile) for profile in profiles]
    return Report(
        Sentence(("Shipped profiles",)),
        list(map(_section, records)),
        document("profiles", profiles=records),
        records,
    )


def _record(profile: Profile) -> Record:
    """Name, main figures and description."""
    return {
        "name": profile.name,
        "nodes": sum(alike.nodes for alike in profile.node_groups),
        "period_us": profile.cycle.period_us if profile.has_cycle else None,
        "timing_model": profile.bus.timing_model,
        "description": " ".join(profile.description.split()),
    }


def _section(record: Record) -> Chapter:
    title = sentence(
        f"{{}}: {{}} {nouns(record['nodes'], 'node')} at {{}}, {record['timing_model']} model leads",
        Code(record["name"]),
        count_value(record["nodes"], "nodes"),
        period_value(record["period_us"]),
    )
    return Chapter(title, (Sentence((record["description"],)),))
