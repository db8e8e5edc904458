"""Published figures beside computed ones."""

from typing import Literal, NamedTuple

from busplan.sourced import Grade

Unit = Literal["us", "1", "s", "mm", "bytes", "bits"]


class Comparison(NamedTuple):
    """One published figure and one way to compute it."""

    section: str
    quantity: str
    unit: Unit
    published: float | None
    """As printed, or the quotient of two printed figures; None where the source gives a formula and no figure."""
    method: str
    """The equation or timing model behind the computed figure."""
    computed: float
    grade: Grade = "published"
    """How well the published figure is known."""

    @property
    def residual(self) -> float | None:
        """Computed less published, in `unit`."""
        return None if self.published is None else self.computed - self.published

    @property
    def relative_residual(self) -> float | None:
        """The residual as a share of the published figure [1]."""
        return None if self.published is None else (self.computed - self.published) / self.published


class EvidenceSection(NamedTuple):
    """One table or passage of a source."""

    title: str
    note: str
    comparisons: tuple[Comparison, ...]
    data: str = "paper"
    """Data file that the published figures stand in, with their sources."""
