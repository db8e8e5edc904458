"""Kinds of bus: what an analysis may ask of one, and a folder for each.

The register names the module of each kind; a kind loads when a profile asks for it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from busplan.buses.bus import Bus

_MODULES: Final[dict[str, str]] = {
    "ieee1394": "busplan.buses.ieee1394.kind",
    "can": "busplan.buses.can.kind",
    "ethercat": "busplan.buses.ethercat.kind",
    "sercos3": "busplan.buses.sercos3.kind",
    "sercos2": "busplan.buses.sercos2.kind",
}
_LOADED: Final[dict[str, "Bus"]] = {}


def kind_names() -> tuple[str, ...]:
    """Names of all kinds, as `bus.kind` has them."""
    return tuple(_MODULES)


def kind_named(name: str) -> "Bus":
    """Give the kind of a name.

    Raises
    ------
    KeyError
        There is no kind of that name.
    """
    if name not in _LOADED:
        found: Bus = import_module(_MODULES[name]).BUS
        _LOADED[name] = found
    return _LOADED[name]


@contextmanager
def registered(bus: "Bus") -> Iterator[None]:
    """Register one more kind for a while, as a test does.

    Raises
    ------
    ValueError
        There is a kind of that name.
    """
    if bus.kind in _MODULES:
        raise ValueError(f"there is a kind of bus called {bus.kind}")
    _MODULES[bus.kind] = type(bus).__module__
    _LOADED[bus.kind] = bus
    try:
        yield
    finally:
        del _MODULES[bus.kind], _LOADED[bus.kind]
