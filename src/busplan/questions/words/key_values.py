"""New values of profile keys as a sentence."""

from collections.abc import Mapping

from busplan.buses.bus import Bus
from busplan.buses.parts import Value as BusValue
from busplan.forms.blocks import Part, Sentence, ShownValue, joined
from busplan.profile.write import value_text

NewValues = Mapping[str, BusValue]
"""New values of a profile by dotted key."""


def settings_sentence(changes: NewValues, *, meanings: Mapping[str, str], quotes: bool = True) -> Sentence:
    """Write each key with its new value and its meaning.

    Parameters
    ----------
    changes
        The new values.
    meanings
        Note on a change, by key, for keys that need one.
    quotes
        If True, text values are quoted, as in a profile.
    """
    return joined(
        *(
            Sentence((f"{key} = ", *_part(key, value, quotes), f" ({meanings[key]})" if key in meanings else ""))
            for key, value in changes.items()
        ),
        by=", ",
    )


def change_meanings(bus: Bus) -> dict[str, str]:
    """What a change of a key means on the machine, for keys that do not say so."""
    return {name: key.meaning for name, key in bus.keys.items() if key.meaning}


def key_value(key: str, value: object) -> ShownValue:
    """The new value of one key, with its place in the JSON document."""
    return ShownValue(value, key)


def _part(key: str, value: object, quotes: bool) -> tuple[Part, ...]:
    if isinstance(value, list):
        return (value_text(value),)
    found = key_value(key, value)
    return ('"', found, '"') if quotes and isinstance(value, str) else (found,)
