"""Register of the kinds of bus: each has a folder here, and its module is imported when a profile asks for it.

The interface that all kinds implement is `Bus`, in module `bus`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Final

from busplan.english import did_you_mean
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.buses.bus import Bus

_MODULES: Final[dict[str, str]] = {
    "ieee1394": "busplan.buses.ieee1394.kind",
    "can": "busplan.buses.can.kind",
    "ethercat": "busplan.buses.ethercat.kind",
    "sercos3": "busplan.buses.sercos.sercos3_kind",
    "sercos2": "busplan.buses.sercos.sercos2_kind",
    "polled": "busplan.buses.polled.kind",
}
_LOADED: Final[dict[str, "Bus"]] = {}


def kind_names() -> tuple[str, ...]:
    """Names of all kinds, the values of `bus.kind` in a profile."""
    return tuple(_MODULES)


def kind_named(name: str) -> "Bus":
    """Kind of bus by name; another name raises KeyError."""
    if name not in _LOADED:
        bus: Bus = import_module(_MODULES[name]).BUS
        _LOADED[name] = bus
    return _LOADED[name]


def kind_called(word: str, *, option: str = "") -> str:
    """Name of the kind that a user's word means: a kind's name, its title, or another name that it declares.

    Case, spaces and punctuation do not count. A word that means no kind raises `BusplanError`, whose message names the
    command-line `option` that had it.

    Examples
    --------
    >>> kind_called("EtherCAT"), kind_called("FireWire"), kind_called("SERCOS III")
    ('ethercat', 'ieee1394', 'sercos3')
    """
    if word in _MODULES:
        return word
    buses = map(kind_named, kind_names())
    kinds = {
        _plain(name): bus.kind
        for bus in buses
        for name in (bus.kind, bus.title, *bus.also_called, *bus.starter.variants)
    }
    if _plain(word) in kinds:
        return kinds[_plain(word)]
    near = did_you_mean(_plain(word), kinds)
    argument = f"{option} {word}".strip()
    raise BusplanError(f"{argument}: no kind of bus; there are {', '.join(kind_names())}{near and f'; {near}'}")


def variant_called(word: str) -> str:
    """Name of the variant of a kind that a user's word means; empty for any other word.

    Examples
    --------
    >>> variant_called("CAN FD"), variant_called("CAN"), variant_called("PROFIBUS DP")
    ('can-fd', '', 'profibus')
    """
    first = _plain(word.replace("-", " ").partition(" ")[0])
    names = [name for kind in kind_names() for name in kind_named(kind).starter.variants]
    return next((name for name in names if _plain(name) in (_plain(word), first)), "")


def _plain(name: str) -> str:
    return "".join(filter(str.isalnum, name.casefold()))


@contextmanager
def registered(bus: "Bus") -> Iterator[None]:
    """Context in which a further kind is registered, for a test; a name that is taken raises ValueError."""
    if bus.kind in _MODULES:
        raise ValueError(f"there is a kind of bus called {bus.kind}")
    _MODULES[bus.kind] = type(bus).__module__
    _LOADED[bus.kind] = bus
    try:
        yield
    finally:
        del _MODULES[bus.kind], _LOADED[bus.kind]
