"""The data files with published and measured figures."""

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from math import fsum, sqrt
from pathlib import Path
from typing import Any, Final, NamedTuple

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
    rows = [row for table in file.get("evidence", ()) if table.get("part") == part for row in table["rows"]]
    words: str = one["words"].format(count=len(found if "of" in one else rows))
    return words
