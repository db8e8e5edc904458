"""Published figures beside computed ones."""

from typing import Literal, NamedTuple

Unit = Literal["us", "1", "s", "mm"]


class Comparison(NamedTuple):
    """One published figure and one way to compute it."""

    section: str
    quantity: str
    unit: Unit
    published: float | None
    """As printed, or the quotient of two printed figures; None where the paper gives a formula and no figure."""
    method: str
    """The equation or timing model behind the computed figure."""
    computed: float

    @property
    def residual(self) -> float | None:
        """Computed less published, in `unit`."""
        return None if self.published is None else self.computed - self.published

    @property
    def relative_residual(self) -> float | None:
        """The residual as a share of the published figure [1]."""
        return None if self.published is None else (self.computed - self.published) / self.published


class PaperSection(NamedTuple):
    """One table or passage of the paper."""

    title: str
    note: str
    comparisons: tuple[Comparison, ...]
