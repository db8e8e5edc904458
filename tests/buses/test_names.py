"""Kinds of bus are known by the names that users type."""

import pytest

from busplan.buses import kind_called, kind_named, kind_names
from busplan.errors import BusplanError

TYPED = {
    "ieee1394": ("IEEE 1394", "ieee-1394", "1394", "FireWire", "firewire"),
    "can": ("CAN", "Can", "CANopen", "canopen", "CAN 2.0"),
    "ethercat": ("EtherCAT", "ETHERCAT"),
    "sercos3": ("SERCOS III", "sercos 3", "sercos"),
    "polled": ("PROFIBUS", "profibus-dp", "Modbus RTU", "dynamixel", "Feetech", "WorldFIP", "Mesa Ethernet"),
    "sercos2": ("SERCOS II", "sercos 2", "Sercos I", "SERCOS I and II"),
}


@pytest.mark.parametrize("kind", kind_names())
def test_a_kind_is_known_by_its_names(kind: str) -> None:
    assert {word: kind_called(word) for word in (kind, *TYPED[kind])} == dict.fromkeys((kind, *TYPED[kind]), kind)


def test_no_two_kinds_share_a_name() -> None:
    for kind in kind_names():
        bus = kind_named(kind)
        assert {kind_called(name) for name in (bus.kind, bus.title, *bus.also_called)} == {kind}


@pytest.mark.parametrize("word", ["", "  ", "lon", "sercos 4"])
def test_an_unknown_name_is_refused_with_the_names_there_are(word: str) -> None:
    with pytest.raises(BusplanError) as refused:
        kind_called(word, option="--bus")
    assert str(refused.value).startswith(
        f"--bus {word}".strip() + ": no kind of bus; there are ieee1394, can, ethercat"
    )


def test_a_mistyped_name_is_guessed() -> None:
    with pytest.raises(BusplanError, match=r"firewier: no kind of bus; there are .*; did you mean firewire\?"):
        kind_called("firewier")
