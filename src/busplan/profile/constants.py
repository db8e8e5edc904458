"""Changed constants of a kind of bus, named `constants.NAME` among the changes of a profile."""

from collections.abc import Iterable, Mapping
from math import isfinite
from typing import Final

from busplan.buses import kind_named, kind_names
from busplan.english import did_you_mean
from busplan.errors import BusplanError

SECTION: Final = "constants"


def is_constant(key: str) -> bool:
    """Whether a key of changes names a constant."""
    return key.partition(".")[0] == SECTION


def constants_of(changes: Mapping[str, object], kind: str | None, origin: Mapping[str, str]) -> dict[str, float]:
    """Values of the constants among some changes, by name.

    Case does not count in the names. A `kind` of None stands for every kind. `origin` says for messages what set a key,
    if that is not key and value. BusplanError: the kind has no such constant, or a fixed one; the value is no finite
    number; or `constants.` is missing before the name.

    Examples
    --------
    >>> constants_of({"constants.arbitration_hold_us": 2, "bus.nodes": 3}, "ieee1394", {})
    {'ARBITRATION_HOLD_US': 2.0}
    """
    constants: dict[str, float] = {}
    for key, value in changes.items():
        typed = origin.get(key, f"{key} = {value}")
        if is_constant(key):
            name = _name(key.partition(".")[2], kind, typed)
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise BusplanError(f"{typed}: expected a finite number")
            own = next(bus.constants[name] for bus in map(kind_named, kind_names()) if name in bus.constants)
            if own >= 0 and (value < 0 or value == 0 < own):
                raise BusplanError(f"{typed}: expected a number above 0; a tiny one says that there is none")
            constants[name] = float(value)
        elif "." not in key and (name := _known([kind] if kind else kind_names()).get(key.upper(), "")):
            raise BusplanError(f"{typed}: no key of a profile; did you mean {SECTION}.{name}?")
    return constants


def _known(kinds: Iterable[str]) -> dict[str, str]:
    return {name.upper(): name for kind in kinds for name in kind_named(kind).constants}


def _name(written: str, kind: str | None, typed: str) -> str:
    """Name of a constant in its kind's own spelling."""
    every = _known(kind_names())
    name = every.get(written.upper())
    if name is None:
        near = did_you_mean(written.upper(), every if kind is None else _known([kind]))
        raise BusplanError(f"{typed}: no constant of this name; {near or '`busplan explain PROFILE` lists them'}")
    if kind is not None and name not in kind_named(kind).constants:
        raise BusplanError(f"{typed}: no constant of {kind_named(kind).title}, the bus of this profile")
    for bus in map(kind_named, [kind] if kind else kind_names()):
        if why := bus.constants.fixed.get(name):
            raise BusplanError(f"{typed}: cannot be changed: {why}")
    return name
