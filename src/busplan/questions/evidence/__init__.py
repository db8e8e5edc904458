"""`busplan.evidence`."""

from dataclasses import dataclass
from functools import partial

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.numbers import plural
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.evidence.figures import (
    KindEvidence,
    kind_evidence,
    known_kinds,
    paper_circles,
    paper_evidence,
)


@dataclass(frozen=True, slots=True, repr=False)
class EvidenceAnswer(Answer):
    """Answer of `evidence`.

    Parameters
    ----------
    kinds
        Each kind of bus with its `sections`, whose `comparisons` have a published figure, its grade, and the computed
        one.
    paper
        Whether it is what the paper publishes, and nothing else.
    """

    kinds: tuple[KindEvidence, ...]
    paper: bool = False

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.evidence.report import evidence_report, paper_report

        return paper_report(self.kinds[0].sections) if self.paper else evidence_report(self.kinds)

    def _headline(self) -> str:
        figures = sum(len(section.comparisons) for one in self.kinds for section in one.sections)
        return f"{plural(figures, 'comparison')} on {', '.join(one.kind for one in self.kinds)}"


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
    >>> one = can.sections[0].comparisons[1]
    >>> one.quantity, one.published, one.computed, one.grade
    ('8 bytes, 11 bits of identifier, worst stuffing', 135, 135.0, 'published')
    """
    circles = partial(paper_circles, progress=progress)
    if paper:
        if kind is not None:
            raise BusplanError(f"kind {kind!r}: goes without paper=True, which is of one kind")
        return EvidenceAnswer((paper_evidence(circles=circles),), paper=True)
    return EvidenceAnswer(tuple(kind_evidence(name, circles=circles) for name in known_kinds(kind)))
