"""Figures that others have published or measured, beside computed ones, for each kind of bus."""

from collections.abc import Callable, Mapping, Sequence
from math import hypot
from typing import Any, NamedTuple

from busplan.buses import kind_named, kind_names
from busplan.buses.bus import Bus
from busplan.buses.parts import COVERAGE
from busplan.buses.published import Comparison, EvidenceSection, Tested, parts_tested, published
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.progress import Progress
from busplan.questions.circle.figures import CircleFigures
from busplan.questions.circle.roundness import circle_test
from busplan.questions.evidence.paper import BENCH_PROFILE, CIRCLE_PROFILES, PAPER, circle_sections
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.profile import Profile


class KindEvidence(NamedTuple):
    """What is known of one kind of bus; no section where nothing is."""

    kind: str
    title: str
    """What the kind is called."""
    tested: Tested
    """Which parts of it figures of others test."""
    sections: tuple[EvidenceSection, ...]


def bus_evidence(bus: Bus) -> tuple[EvidenceSection, ...]:
    """Compare what is known of a kind of bus with what its equations give.

    Parameters
    ----------
    bus
        The kind.
    """
    networks = {name: network_of(load(name).profile) for name in bus.evidence_profiles}
    own = bus.evidence(networks, {name: published(name) for name in bus.evidence_data})
    rows = (_section(table, name, bus) for name in bus.evidence_data for table in published(name).get("evidence", ()))
    return (*own, *rows)


def _section(table: Mapping[str, Any], data: str, bus: Bus) -> EvidenceSection:
    """The rows of one table [[evidence]] of a data file: each a profile with some keys set, and a published figure."""
    base = override(load(table.get("profile", bus.evidence_profiles[0])).profile, table.get("set", {}))
    note = f"{table['source']}. {table.get('note', '')}".strip()
    return EvidenceSection(table["title"], note, tuple(_row(row, table, base, bus) for row in table["rows"]), data)


def _row(row: Mapping[str, Any], table: Mapping[str, Any], base: Profile, bus: Bus) -> Comparison:
    """Compute what a row compares: the sum of some figures of a profile, or of constants of the kind."""
    found = figures(override(base, row.get("set", {})), model=bus.deciding_model)
    parts = [bus.constants[key] if key in bus.constants else getattr(found, key) for key in table["figures"]]
    doubts = [float(one.us) for one in found.doubts if one.key == table.get("doubt")]
    return Comparison(
        table["title"],
        row["quantity"],
        table["unit"],
        row["published"],
        table.get("method", f"{bus.deciding_model} model"),
        row.get("share", 1.0) * sum(plain(one) for one in parts),
        table["grade"],
        COVERAGE * row.get("share", 1.0) * hypot(*doubts) if doubts else None,
    )


def known_kinds(kind: str | None) -> tuple[str, ...]:
    """The kind of a name, or all of them without one.

    Raises
    ------
    BusplanError
        No such kind.
    """
    if kind is None:
        return kind_names()
    if kind not in kind_names():
        raise BusplanError(f"{kind}: no such kind of bus; there are {', '.join(kind_names())}")
    return (kind,)


def paper_circles(*, progress: Progress | None = None) -> Sequence[CircleFigures]:
    """Run the circle tests of the paper, those of `CIRCLE_PROFILES` in this order.

    Parameters
    ----------
    progress
        Called from time to time with the steps simulated and the steps known to be needed.
    """
    return [circle_test(load(name).profile, progress=progress).results[0] for name in CIRCLE_PROFILES]


def kind_evidence(kind: str, *, circles: Callable[[], Sequence[CircleFigures]]) -> KindEvidence:
    """What is known of one kind of bus, the paper's circles among it where the paper's bench is of this kind.

    Parameters
    ----------
    kind
        Its name.
    circles
        Gives the circle tests of `CIRCLE_PROFILES`, in this order.
    """
    bus = kind_named(kind)
    found = bus_evidence(bus)
    if bus_of(load(BENCH_PROFILE).profile) is bus:
        seed = [one for one in found if one.data == PAPER]
        found = (*seed, *circle_sections(published(PAPER), circles()), *(one for one in found if one.data != PAPER))
    return KindEvidence(bus.kind, bus.title, parts_tested(bus.evidence_data), found)


def paper_evidence(*, circles: Callable[[], Sequence[CircleFigures]]) -> KindEvidence:
    """The part of it that the paper publishes, in the order of the paper.

    Parameters
    ----------
    circles
        As in `kind_evidence`.

    References
    ----------
    Paper, Tables I and II, sections IV-A and IV-B, equations (3)-(15), Figs. 9 and 10.
    """
    whole = kind_evidence(bus_of(load(BENCH_PROFILE).profile).kind, circles=circles)
    return whole._replace(sections=tuple(one for one in whole.sections if one.data == PAPER))
