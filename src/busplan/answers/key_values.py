"""Keys of a profile with the values that they are to have, as a sentence."""

from collections.abc import Mapping

from busplan.buses import bus
from busplan.forms.blocks import Part, Sentence, ShownValue, joined

NewValues = Mapping[str, bus.Value]
"""New values of a profile by dotted key."""


def settings_sentence(changes: NewValues, *, meanings: Mapping[str, str], at: str, quotes: bool = True) -> Sentence:
    """Write each key with its value, and what that means.

    Parameters
    ----------
    changes
        The new values.
    meanings
        What a change of a key means, where that is not plain.
    at
        Place of the changes in the JSON document; empty where they have none.
    quotes
        If True, a text stands between quotes, as in a profile.
    """
    return joined(
        *(
            Sentence((f"{key} = ", *_part(key, value, at, quotes), f" ({meanings[key]})" if key in meanings else ""))
            for key, value in changes.items()
        ),
        by=", ",
    )


def key_value(key: str, value: bus.Value, *, at: str) -> ShownValue:
    """The value of one key, with its place among the changes."""
    return ShownValue(value, key, at=f"{at}/{key}" if at else "")


def _part(key: str, value: bus.Value, at: str, quotes: bool) -> tuple[Part, ...]:
    found = key_value(key, value, at=at)
    return ('"', found, '"') if quotes and isinstance(value, str) else (found,)
