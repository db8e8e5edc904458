"""What a kind of bus says of a network, and what it offers to change, as it was read and found good: `words.txt`.

After a change: `python -m tests.buses.test_words`, and read the difference.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import busplan
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.network import network_of

WORDS = Path(__file__).with_name("words.txt")
SPLIT = {"group.partial.read_response": "split"}
NETWORKS: list[tuple[str, dict[str, Any]]] = [
    ("paper-4ms", {}),
    ("paper-4ms", {"bus.speed": "S800", "bus.charge_hops": "own", "bus.cable_length_m": 10}),
    ("paper-4ms", {"bus.max_hops": 3, "bus.gap_count": 5, "node.write_response": "unified", "host.transaction_us": 5}),
    ("paper-4ms", {"bus.cable_length_m": 10, "bus.gap_count": 5, "node.read_response": "concatenated"}),
    ("dvrk", {}),
    ("dvrk", {"cycle.schedule": "individual", "bus.charge_hops": "own"}),
    ("dvrk", {"cycle.schedule": "individual", "bus.root": "host", "bus.charge_hops": "own"} | SPLIT),
    ("ethercat-servo-8", {}),
    ("ethercat-servo-8", {"bus.master": "TwinCAT", "bus.nodes": 120, "bus.pipeline_cycles": 2, "bus.sync_shift": 0.85}),
    ("ethercat-servo-8", {"bus.process_data": "LRD-LWR", "bus.distributed_clocks": False}),
    ("sercos2-servo-8", {"node.axes": 3}),
    ("sercos2-servo-8", {"bus.data_rate_mbit_s": 8, "bus.at_gap_us": 7.5}),
    ("sercos3-servo-8", {"cycle.nonperiodic_us": 124}),
    ("sercos3-servo-8", {"bus.timing_method": "at-last", "cycle.nonperiodic_us": 125, "bus.version": "V1.0"}),
    ("sercos3-servo-8", {"bus.nodes": 3}),
    ("profibus-drives-6", {"bus.bit_rate_kbit_s": 1500}),
    ("dynamixel-arm-14", {}),
    ("dynamixel-arm-14", {"bus.requests": "single", "bus.adapter": "ftdi-low-latency", "bus.timeout_us": 5000}),
    ("dynamixel-arm-14", {"bus.requests": "fast-sync", "bus.adapter": "ftdi", "bus.return_delay_us": None}),
    (
        "dynamixel-arm-14",
        {"bus.protocol": "modbus-rtu", "bus.bit_rate_kbit_s": 57.6, "bus.requests": None, "bus.adapter": "none"},
    ),
    ("mesa-hm2-eth", {}),
]


def said(name: str, changes: dict[str, Any]) -> Iterator[str]:
    """What the kind says of a shipped profile with other values, and what it offers, line by line."""
    network = network_of(busplan.load_profile(name, changes=changes))
    bus = network.bus
    yield f"{name}, {', '.join(f'{key} = {value}' for key, value in changes.items()) or 'as it is'}"
    setup, subject = ", ".join(bus.setup_words(network)), bus.latency_subject(network)
    yield f"  {bus.title_of(network)}: {subject}"
    if setup not in subject:
        yield f"  {setup}"
    if path := bus.path_words(network):
        yield f"  {path}"
    yield from (f"  warning: {warning}" for warning in bus.warnings(network, nodes=[1, int(network.nodes), 20]))
    for model in bus.timing_models:
        if keys := bus.cannot_express(network, model=model.name):
            yield f"  {model.name} has no term for {', '.join(keys)}"
    is_counted = bus.has_execution(network), bus.has_execution(network, of_latency=True)
    yield f"  execution in the cycle, in a latency: {is_counted}; evidence: {', '.join(bus.evidence_for(network))}"
    size, most, carrier = bus.payloads(network)
    yield f"  payloads in steps of {size} up to {most} bytes, {carrier}"
    cycle = deciding_cycle(network)
    yield f"  rests on {'; '.join(part.words + (part.key and f' ({part.key})') for part in cycle.rests_on())}"
    timed = sorted({event.rests_on for event in cycle.events() if event.rests_on and event.us})
    yield f"  its time has {', '.join(timed) or 'no key of its own'}"
    for setting in bus.settings(network):
        values = "; ".join(", ".join(f"{key} = {value}" for key, value in one.items()) for one in setting.values)
        yield f"  {setting.label} ({setting.cost.name}): {values or 'nothing else'}"
    for small in bus.perturbations(network):
        change = ", ".join(f"{key} = {value}" for key, value in small.changes.items())
        yield f"  {small.label}: {change}{small.why_not and f'; but {small.why_not}'}"
        if small.if_nothing:
            yield f"    if that changes nothing: {small.if_nothing}"


def words() -> str:
    return "".join(f"{line}\n" for name, changes in NETWORKS for line in said(name, changes))


def test_what_a_kind_says_and_offers_is_what_was_found_good() -> None:
    assert words().splitlines() == WORDS.read_text(encoding="utf-8").splitlines()


if __name__ == "__main__":
    WORDS.write_text(words(), encoding="utf-8")
