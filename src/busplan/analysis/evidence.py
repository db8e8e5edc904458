"""Figures that others have published or measured, beside computed ones, for each kind of bus."""

import tomllib
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from busplan.analysis.circle.roundness import CircleFigures
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.paper import BENCH_PROFILE, PAPER, circle_sections
from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.published import EvidenceSection
from busplan.profile.shipped import load

_DATA: Final = Path(__file__).resolve().parents[1] / "data"


class KindEvidence(NamedTuple):
    """What is known of one kind of bus; no section where nothing is."""

    bus: Bus
    sections: tuple[EvidenceSection, ...]


@cache
def published(name: str) -> dict[str, Any]:
    """Published figures, as a data file of the package holds them.

    Parameters
    ----------
    name
        Name of the file.
    """
    return tomllib.loads((_DATA / f"{name}.toml").read_text(encoding="utf-8"))


def bus_evidence(bus: Bus) -> tuple[EvidenceSection, ...]:
    """Compare what is known of a kind of bus with what its equations give.

    Parameters
    ----------
    bus
        The kind.
    """
    networks = {name: network_of(load(name).profile) for name in bus.evidence_profiles}
    return bus.evidence(networks, {name: published(name) for name in bus.evidence_data})


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
    return KindEvidence(bus, found)


def paper_evidence(*, circles: Callable[[], Sequence[CircleFigures]]) -> tuple[EvidenceSection, ...]:
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
    return tuple(one for one in whole.sections if one.data == PAPER)
