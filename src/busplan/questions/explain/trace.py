"""What stands behind a traced number: its steps, and the inputs that it depends on."""

from collections.abc import Iterable, Iterator

from busplan.elementwise import Number, Traced
from busplan.sourced import Input, Sourced, input_of


def found(value: object, words: str, parts: Iterable[Number]) -> Traced:
    """A result without an equation, as of a search or a simulation: it has no steps, but all inputs of its parts.

    Parameters
    ----------
    value
        The result.
    words
        Its method.
    parts
        Numbers that it depends on.
    """
    leaves = inputs(Traced(value, parts=tuple(parts)))
    return Traced(value, formula=words, parts=tuple(Traced(leaf.value, given=leaf) for leaf in leaves))


def lines(figure: Traced) -> Iterator[Traced]:
    """Every named number behind a figure, in the order of computation; the figure is last."""
    yield from (one for one in _visit(figure) if not one.given and (one.symbol or one is figure))


def inputs(figure: Traced) -> Iterator[Input]:
    """Inputs of a figure: keys of the profile and constants, each once."""
    found: dict[tuple[str, str], Input] = {}
    for one in _visit(figure):
        for leaf in (one.given, *(input_of(part) for part in one.parts if isinstance(part, Sourced))):
            if leaf is not None:
                found.setdefault((leaf.name, leaf.symbol), leaf)
    yield from found.values()


def _visit(figure: Traced) -> Iterator[Traced]:
    """Every number behind a figure once, its parts before it; a sum of thousands is deeper than Python recurses."""
    seen: set[int] = set()
    waiting = [(figure, False)]
    while waiting:
        one, has_parts_behind = waiting.pop()
        if has_parts_behind:
            yield one
        elif id(one) not in seen:
            seen.add(id(one))
            waiting.append((one, True))
            waiting.extend((part, False) for part in reversed(one.parts) if isinstance(part, Traced))
