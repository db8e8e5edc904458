"""`busplan.evidence`."""

from dataclasses import dataclass
from typing import NamedTuple

from busplan.buses import kind_named, kind_names
from busplan.buses.published import Tested, parts_tested
from busplan.english import plural
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.evidence.rows import EvidenceSection, sections_of

_PAPER = ("ieee1394", "paper")
"""Kind of bus and data file of the paper."""


class KindEvidence(NamedTuple):
    """Published figures about one kind of bus; no section where there are none."""

    kind: str
    title: str
    """Name of the kind."""
    tested: Tested
    """Parts of the model that published figures test."""
    sections: tuple[EvidenceSection, ...]


@dataclass(frozen=True, slots=True, repr=False)
class EvidenceAnswer(Answer):
    """Answer of `evidence`.

    Parameters
    ----------
    kinds
        Each kind of bus with its `sections`, whose `comparisons` have a published figure, its grade, and the computed
        one.
    paper
        Whether these are the figures of the paper alone.
    """

    kinds: tuple[KindEvidence, ...]
    paper: bool = False

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.evidence.report import evidence_report

        return evidence_report(self.kinds, paper=self.paper)

    def _headline(self) -> str:
        figures = sum(len(section.comparisons) for kind in self.kinds for section in kind.sections)
        return f"{plural(figures, 'comparison')} on {', '.join(kind.kind for kind in self.kinds)}"


def evidence(kind: str | None = None, *, paper: bool = False, progress: Progress | None = None) -> EvidenceAnswer:
    """Show every figure of a kind of bus that others have published or measured, beside the computed one.

    Parameters
    ----------
    kind
        Kind of bus, as "ieee1394"; by default all of them.
    paper
        If True, only what the paper publishes, on its own kind of bus, as `busplan paper` shows it.
    progress
        Called from time to time with the steps simulated and the steps known to be needed.

    Returns
    -------
    EvidenceAnswer
        The comparisons, kind by kind.

    Raises
    ------
    BusplanError
        No such kind; or a kind beside `paper`.

    Examples
    --------
    >>> import busplan
    >>> (can,) = busplan.evidence("can").kinds
    >>> comparison = can.sections[0].comparisons[1]
    >>> comparison.quantity, comparison.published, comparison.computed, comparison.grade
    ('8 bytes, 11 bits of identifier, worst stuffing', 135, 135.0, 'published')
    """
    if paper and kind is not None:
        raise BusplanError(f"kind {kind!r}: goes without paper=True, which is of one kind")
    if kind not in (None, *kind_names()):
        raise BusplanError(f"{kind}: no such kind of bus; there are {', '.join(kind_names())}")

    def known(name: str, *only: str) -> KindEvidence:
        bus = kind_named(name)
        sections = (
            section for data in only or bus.evidence_data for section in sections_of(bus, data, progress=progress)
        )
        return KindEvidence(name, bus.title, parts_tested(bus.evidence_data), tuple(sections))

    if paper:
        return EvidenceAnswer((known(*_PAPER),), paper=True)
    return EvidenceAnswer(tuple(map(known, kind_names() if kind is None else (kind,))))
