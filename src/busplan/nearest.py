"""Suggestion for a mistyped name."""

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(typed: str, known: Iterable[str]) -> str:
    """Ask for the known name that is nearest to a typed name; empty if none is near.

    Parameters
    ----------
    typed
        The name as it was typed.
    known
        Names that there are.

    Examples
    --------
    >>> did_you_mean("capcity", ["capacity", "latency"]), did_you_mean("x", ["capacity"])
    ('did you mean capacity?', '')
    """
    names = {name.casefold(): name for name in known}
    close = get_close_matches(typed.casefold(), names, n=1)
    return f"did you mean {names[close[0]]}?" if close else ""
