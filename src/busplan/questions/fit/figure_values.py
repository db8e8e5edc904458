"""Figures of an answer that only some kinds of bus have."""

from collections.abc import Iterator, Mapping
from typing import Any, Never, TypeAlias

from busplan.sourced import Sourced

FigureValue: TypeAlias = float | str | None
"""A number, a count, a truth value or a word; None if it does not exist."""


class FigureValues(Mapping[str, FigureValue]):
    """Figures by key and as attributes; immutable, and picklable.

    Parameters
    ----------
    values
        Figures by key; a `Sourced` constant becomes a plain float.

    Examples
    --------
    >>> values = FigureValues({"rounds": 2})
    >>> values.rounds, values["rounds"], dict(values)
    (2, 2, {'rounds': 2})
    """

    __slots__ = ("_values",)

    _values: Mapping[str, FigureValue]

    def __init__(self, values: Mapping[str, FigureValue]) -> None:
        plain = {key: float(value) if isinstance(value, Sourced) else value for key, value in values.items()}
        object.__setattr__(self, "_values", plain)

    def __getitem__(self, key: str) -> FigureValue:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __getattr__(self, key: str) -> Any:
        # Figures are keys and attributes; called for missing attributes only, also before `_values` is set.
        if key.startswith("_") or key not in self._values:
            raise AttributeError(f"there is no figure {key!r}")
        return self._values[key]

    def __setattr__(self, key: str, value: object) -> Never:
        raise AttributeError(f"an answer does not change: {key}")

    def __hash__(self) -> int:
        return hash(frozenset(self._values.items()))

    def __reduce__(self) -> tuple[type["FigureValues"], tuple[dict[str, FigureValue]]]:
        return FigureValues, (dict(self._values),)

    def __repr__(self) -> str:
        return f"FigureValues({self._values!r})"
