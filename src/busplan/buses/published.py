"""Published figures beside computed ones."""

import tomllib
from collections.abc import Mapping, Sequence
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


class Tested(NamedTuple):
    """Which parts of a kind of bus figures of others set, and which they test."""

    set_by: Mapping[str, str]
    """What sets constants, bias or U of each part, in a few words: it tests none of them."""
    parts: Mapping[str, str]
    """What tests each part, and sets nothing of it."""
    untested: tuple[str, ...]
    """Parts that no figure tests."""


def parts_tested(names: Sequence[str]) -> Tested:
    """The parts that some data files set and test, by their tables [set_by] and [tested], and those not tested.

    Parameters
    ----------
    names
        The files.
    """
    files = [published(name) for name in names]

    def parts(table: str) -> dict[str, str]:
        return {part: _words(part, one, file) for file in files for part, one in file.get(table, {}).items()}

    return Tested(parts("set_by"), parts("tested"), tuple(part for file in files for part in file.get("untested", ())))


def _words(part: str, one: Mapping[str, Any], file: Mapping[str, Any]) -> str:
    """Words of one part; {count} is the length of the list that it names, or the rows of evidence of the part."""
    found: Any = file
    for key in one.get("of", "").split(".") if "of" in one else ():
        found = found[key]
    rows = [row for table in file.get("evidence", ()) if table["part"] == part for row in table["rows"]]
    words: str = one["words"].format(count=len(found if "of" in one else rows))
    return words


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
    uncertainty: float | None = None
    """Expanded uncertainty of the computed figure, in `unit`; None where it is not weighed."""

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
