"""What CAN says of a network: its settings, small changes and payloads, and its words."""

from collections.abc import Callable
from typing import Any

import pytest

import busplan
from busplan.questions.fit.network import network_of
from tests.buses.can.machines import loaded

EXECUTION = {"kind": "linear", "grade": "measured", "base_us": 100, "per_byte_us": 0}


def network(name: str = "can-servo-8", **changes: Any) -> Any:
    """Network of a shipped profile, with other values by dotted key, __ for the dot."""
    return network_of(
        busplan.load_profile(name, changes={key.replace("__", "."): value for key, value in changes.items()})
    )


def settings(of: Any) -> dict[str, list[dict[str, Any]]]:
    """Other values of each setting."""
    return {setting.name: [dict(values) for values in setting.values] for setting in of.bus.settings(of)}


def groups(**payload: Any) -> Any:
    """Drives of two axes, and a valve without one."""
    each = {"nodes": 1, "read_bytes": 8, "write_bytes": 8, "execution": EXECUTION}
    some = [{"name": "drives", "axes": 2, **each, **payload}, {"name": "valve", "axes": 0, "every": 4, **each}]
    bus = {"kind": "can", "bit_rate_kbit_s": 250}
    return network_of(
        loaded({"schema_version": 1, "name": "two", "bus": bus, "cycle": {"period_us": 20_000}, "group": some})
    )


def test_settings_are_the_next_bit_rates_short_identifiers_and_pdos_of_each_axis() -> None:
    def rates(key: str, *values: float) -> list[dict[str, Any]]:
        return [{f"bus.{key}_kbit_s": value} for value in values]

    assert settings(network(bus__bit_rate_kbit_s=250)) == {
        "bit_rate": rates("bit_rate", 500, 800, 1000),
        "identifier_bits": [],
    }
    # Data goes no slower than the rest.
    fd = network("can-fd-arm-7", bus__bit_rate_kbit_s=500, bus__data_bit_rate_kbit_s=800, bus__identifier_bits=29)
    assert settings(fd) == {
        "bit_rate": rates("bit_rate", 800),
        "data_bit_rate": rates("data_bit_rate", 1000, 2000, 4000, 5000, 8000),
        "identifier_bits": [{"bus.identifier_bits": 11}],
    }
    assert settings(groups())["pdo_per"] == [{"group.drives.pdo_per": "axis"}]
    assert settings(groups(pdo_per="axis"))["pdo_per"] == []
    assert settings(network("can-motors-8"))["access"] == [{"bus.access": "burst"}]
    assert settings(network("can-motors-8", bus__access="burst"))["access"] == []


OWN = "the host computes in cycles of its own"
NO_SYNC = "there is no SYNC"


@pytest.mark.parametrize(
    ("made", "why_not"),
    [
        (network, (OWN, OWN, OWN, "", "", "")),
        (
            lambda: network(bus__pipeline_cycles=0, bus__sync_counter=True),
            ("", "", "", "", "SYNC has its counter already", ""),
        ),
        (lambda: network("can-motors-8"), ("", "", "", NO_SYNC, NO_SYNC, "")),
        (lambda: network(bus__identifier_bits=29), (OWN, OWN, OWN, "", "", "they have 29 bits already")),
    ],
)
def test_small_changes_are_of_the_host_its_adapter_sync_and_identifiers(
    made: Callable[[], Any], why_not: tuple[str, ...]
) -> None:
    of = made()
    bus, small = of.profile.bus, of.bus.perturbations(of)
    assert [dict(one.changes) for one in small] == [
        {"bus.host_us": bus.host_us + 10},
        {"bus.host_write_us": 10},
        {"bus.host_read_us": 10},
        {"bus.sync_jitter_us": 10},
        {"bus.sync_counter": True},
        {"bus.identifier_bits": 29},
    ]
    assert tuple(one.why_not for one in small) == why_not


@pytest.mark.parametrize(
    ("made", "most_bytes"),
    [
        (network, 4 * 8),
        (lambda: network("can-fd-arm-7"), 4 * 64),
        (lambda: network(payload__feedback_pdos=[6, 6], payload__read_bytes=None), 12),
        (lambda: network(node__axes=3), 4 * 8),
        (lambda: network(node__axes=3, payload__pdo_per="axis"), 3 * 4 * 8),
    ],
)
def test_payloads_are_whole_bytes_up_to_all_frames_of_a_pdo(made: Callable[[], Any], most_bytes: int) -> None:
    of = made()
    payloads = of.bus.payloads(of)
    assert (payloads.step_bytes, payloads.most_bytes, payloads.carrier) == (1, most_bytes, "four frames")


ALONE = {
    "schema_version": 1,
    "name": "car",
    "bus": {"kind": "can", "bit_rate_kbit_s": 33.3},
    "message": [{"name": "a", "identifier": 1, "payload_bytes": 0, "period_us": 1e5}],
}


@pytest.mark.parametrize(
    ("made", "title", "setup", "subject"),
    [
        (network, "CAN", ("1000 kbit/s",), "worst case of SYNC, of the last PDO of all nodes, 1000 kbit/s"),
        (
            lambda: network("can-fd-arm-7", payload__every=3),
            "CAN FD",
            ("1000 kbit/s, 5000 kbit/s of data", "PDOs every 3 cycles"),
            "worst case of SYNC, of the last PDO of all nodes, 1000 kbit/s, 5000 kbit/s of data, PDOs every 3 cycles",
        ),
        (
            groups,
            "CAN",
            ("250 kbit/s", "PDOs of valve every 4 cycles"),
            "worst case of SYNC, of the last PDO of each group, 250 kbit/s, PDOs of valve every 4 cycles",
        ),
        (
            lambda: network("can-motors-8"),
            "CAN",
            ("1000 kbit/s", "motors asked one by one"),
            "worst case of the last PDO of all nodes, 1000 kbit/s, motors asked one by one",
        ),
        (
            lambda: network("can-motors-8", bus__access="burst"),
            "CAN",
            ("1000 kbit/s", "all commands at once"),
            "worst case of the last PDO of all nodes, 1000 kbit/s, all commands at once",
        ),
        (lambda: network_of(loaded(ALONE)), "CAN", ("33.3 kbit/s",), "worst case of every message, 33.3 kbit/s"),
    ],
)
def test_its_words_say_rates_and_how_nodes_are_asked(
    made: Callable[[], Any], title: str, setup: tuple[str, ...], subject: str
) -> None:
    of = made()
    bus = of.bus
    assert (bus.title_of(of), bus.setup_words(of), bus.latency_subject(of)) == (title, setup, subject)
