"""Data files with published and measured figures."""

from collections.abc import Mapping, Sequence
from functools import cache
from math import fsum, sqrt
from typing import Any, NamedTuple

from busplan.sourced import read_toml


@cache
def data_file(name: str) -> dict[str, Any]:
    """Content of the data file of that name in the package: published figures."""
    return read_toml("busplan", f"data/{name}.toml")


def rows_of(name: str, part: str) -> list[dict[str, Any]]:
    """Rows of evidence of one part of the model, from all tables of a data file.

    Examples
    --------
    >>> [row["published"] for row in rows_of("ethercat", "bytes")]
    [0.0839, 0.0841, 0.0826]
    """
    return [row for table in data_file(name)["evidence"] if table.get("part") == part for row in table["rows"]]


class Spread(NamedTuple):
    """Mean and spread of several measurements of one quantity, in their unit."""

    mean: float
    uncertainty: float
    """Standard uncertainty of one further measurement: sd sqrt(1 + 1/n) (JCGM 100, 4.2)."""

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
        variance = fsum((value - mean) ** 2 for value in values) / (count - 1)
        return cls(mean, sqrt(variance * (1 + 1 / count)))


class Tested(NamedTuple):
    """Parts of a kind's model that published figures set, and parts that independent figures test."""

    set_by: Mapping[str, str]
    """Source of the constants, bias or U of each part, in a few words; it tests none of the parts."""
    parts: Mapping[str, str]
    """Figures that test each part, and set nothing of it."""
    untested: tuple[str, ...]
    """Parts that no figure tests."""


def parts_tested(names: Sequence[str], *, of_kind: bool = False) -> Tested:
    """Parts that data files set and test, by their tables [set_by] and [tested], and parts that they do not test.

    Those of a whole kind of bus have the key `untested_elsewhere`, too: what is not tested of other protocols.
    """

    def parts(table: str) -> dict[str, str]:
        return {part: _words(name, part, row) for name in names for part, row in data_file(name).get(table, {}).items()}

    keys = ("untested_elsewhere", "untested") if of_kind else ("untested",)
    untested = (part for name in names for key in keys for part in data_file(name).get(key, ()))
    return Tested(parts("set_by"), parts("tested"), tuple(untested))


def _words(name: str, part: str, row: Mapping[str, Any]) -> str:
    """Words of a part; {count} is the length of the list `of` [table, key], or the rows of evidence of the part."""
    table, key = row.get("of", ("", ""))
    words: str = row["words"].format(count=len(data_file(name)[table][key] if table else rows_of(name, part)))
    return words
