"""Published figures beside computed ones."""

import tomllib
from collections.abc import Sequence
from functools import cache
from math import fsum, sqrt
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from busplan.sourced import Grade

_DATA: Final = Path(__file__).resolve().parents[1] / "data"


@cache
def published(name: str) -> dict[str, Any]:
    """Published figures, as a data file of the package holds them.

    Parameters
    ----------
    name
        Name of the file.
    """
    return tomllib.loads((_DATA / f"{name}.toml").read_text(encoding="utf-8"))


class Spread(NamedTuple):
    """Several measurements of one quantity, in their unit."""

    mean: float
    uncertainty: float
    """Standard uncertainty of the next one: sd sqrt(1 + 1/n) (JCGM 100, 4.2)."""

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Mean and spread of two values or more.

        Examples
        --------
        >>> Spread.of([1.0, 2.0, 3.0])
        Spread(mean=2.0, uncertainty=1.1547005383792515)
        """
        count = len(values)
        mean = fsum(values) / count
        variance = fsum((one - mean) ** 2 for one in values) / (count - 1)
        return cls(mean, sqrt(variance * (1 + 1 / count)))


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
