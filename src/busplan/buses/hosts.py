"""Hosts that a new profile may have, one table for every kind of bus."""

from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from busplan.sections.base import beside
from busplan.sourced import read_toml

_COMMENTS_AT = 27
"""Column of comments in a new profile."""


class KnownHost(NamedTuple):
    """A host, with times that were measured on other machines."""

    meaning: str
    own_us: Mapping[str, float] = MappingProxyType({})
    """Its own time in a cycle, by kind of bus [us]."""
    own_source: str = ""
    jitter_us: float = 0.0
    """Latest wake-up of `jitter_cycles` cycles [us]; 0 where none was measured."""
    jitter_cycles: int = 0
    jitter_source: str = ""

    def own_note(self) -> str:
        """Source of its own time."""
        return f"{self.meaning}: {self.own_source}; measure it"

    def lines(self, kind: str, *, own: str, jitter: str) -> Iterator[str]:
        """Lines of section [bus] for a kind, by the keys of the host's own time and of its wake-up."""
        if kind in self.own_us:
            yield _line(own, self.own_us[kind], f"assumed: {self.own_note()}")
            yield _line(beside(own, "grade"), '"assumed"', "between 0 and twice its value")
        if self.jitter_us and jitter:
            yield _line(jitter, self.jitter_us, f"assumed: latest start, {self.jitter_source}; measure it")
            accepted = "no bound: limits.missed_cycles = 1 accepts one later start in as many"
            yield _line(beside(jitter, "cycles"), self.jitter_cycles, f"the worst of so many cycles, {accepted}")


def _line(key: str, value: object, comment: str) -> str:
    return f"{key.removeprefix('bus.')} = {value}".ljust(_COMMENTS_AT - 1) + f" # {comment}"


@cache
def hosts() -> Mapping[str, KnownHost]:
    """All hosts by name."""
    return {name: KnownHost(**words) for name, words in read_toml("busplan.buses", "hosts.toml").items()}
