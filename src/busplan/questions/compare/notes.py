"""What the figures of a machine rest on, kind of bus by kind of bus, in sentences."""

from collections.abc import Iterator

from busplan.buses import kind_named
from busplan.forms.blocks import Code, Sentence, joined
from busplan.forms.numbers import listed, period
from busplan.questions.compare.kinds import KindComparison, MachineOnKind, NotOnKind
from busplan.questions.fit.certainty import limits_behind
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.words.sentences import evidence_sentence, reset_sentence
from busplan.sections.profile import Profile


def notes(found: KindComparison) -> Iterator[Sentence]:
    """Say of each kind what stands in the way and what nobody has tested, and what of the profile is left out.

    Parameters
    ----------
    found
        The comparison.
    """
    for one in found.kinds:
        if isinstance(one, NotOnKind):
            why = "; ".join(one.why)
            yield Sentence((f"{kind_named(one.kind).title} cannot have this machine: {why}.",), "warns")
        else:
            said = [*_obstacles(one), *reset_sentence(one.after_reset, one.profile), *_circle(one)]
            said += _execution(one, found.profile)
            said += evidence_sentence(bus_of(one.profile))
            if said:
                yield joined(Sentence((f"{bus_of(one.profile).title}:",)), *said)
    yield from _left_out(found)


def _left_out(found: KindComparison) -> Iterator[Sentence]:
    """What of the profile is left out, once for the kinds that leave out the same."""
    titles: dict[tuple[str, ...], list[str]] = {}
    for one in found.compared:
        if one.left_out:
            titles.setdefault(one.left_out, []).append(bus_of(one.profile).title)
    for left_out, names in titles.items():
        keys = joined(*(Sentence((Code(key),)) for key in left_out), by=", ")
        yield Sentence((f"Left out on {listed(names, 'and')}: ", *keys.parts, "."))


def _obstacles(one: MachineOnKind) -> Iterator[Sentence]:
    """The limits that are broken, and why no period is shown to fit."""
    bus, network = bus_of(one.profile), network_of(one.profile)
    broken = [limit.words(network) for limit in map(bus.limit, limits_behind(one.figures)) if limit]
    if broken:
        yield Sentence((f"At {period(one.figures.period_us)} {'; '.join(broken)}.",))
    if one.smallest.us is None:
        yield Sentence((f"No period is shown to fit: {one.smallest.why}.",))


def _circle(one: MachineOnKind) -> Iterator[Sentence]:
    """Why the circle fails or cannot be run."""
    if one.circle is not None and one.circle.problems:
        at = f"{one.smallest.us:.3f} us"
        yield Sentence((f"The circle at {at}: {', and '.join(one.circle.problems)}.",))


def _execution(one: MachineOnKind, profile: Profile) -> Iterator[Sentence]:
    """What the execution times of the profile stand for."""
    bus, own = bus_of(one.profile), bus_of(profile)
    owns_any = own.has_execution(network_of(profile))
    if one.is_own:
        return
    if not bus.has_execution(network_of(one.profile)):
        if owns_any:
            yield Sentence(("No execution time is in its cycle.",))
        return
    said = f"Execution times are assumed to be as long as on {own.title}; here they are: {bus.starter.base}"
    none = "" if owns_any else f"; no execution time is in the cycle of {own.title} as this profile sets it"
    yield Sentence((f"{said}{none}.",))
