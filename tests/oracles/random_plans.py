"""Random plans, as the keys of a profile's file: CAN, classical and FD, and EtherCAT.

They are valid and, by busplan, fit; a plan has no circle. Keys that busplan's schema does not know are left out.
"""

from pathlib import Path
from random import Random
from typing import Any, Final

import tomli_w

import busplan

Plan = dict[str, Any]
SCHEMA: Final = (Path(__file__).parents[2] / "profiles" / "busplan.schema.json").read_text()


def execution(random: Random, most_us: float) -> Plan:
    """Execution time of a node."""
    base_us = round(random.uniform(0.1, 1) * most_us)
    extra_us = random.choice((0, base_us // 5))
    grade = random.choice(("measured", "assumed"))
    return {"kind": "linear", "base_us": base_us, "per_byte_us": 0.5, "worst_extra_us": extra_us, "grade": grade}


def can_plan(random: Random) -> Plan:
    """Nodes that are alike, groups, or messages alone; classical or FD."""
    rate, fd, extended = random.choice((125, 250, 500, 1000)), random.random() < 0.3, random.random() < 0.2
    bus: Plan = {"kind": "can", "bit_rate_kbit_s": rate}
    if fd:
        bus["data_bit_rate_kbit_s"] = rate * random.choice((1, 2, 4))
    if extended:
        bus["identifier_bits"] = 29
    plan: Plan = {"bus": bus}
    form = random.choice(("nodes", "groups", "messages"))
    if form != "messages":
        bus |= random.choice(({"pipeline_cycles": 1}, {"host_us": random.randint(20, 300), "host_grade": "measured"}))
        bus["sync_counter"] = random.random() < 0.3
        plan["cycle"] = {"period_us": random.choice((1000, 2000, 4000, 5000))}
    if form == "nodes":
        bus["nodes"] = random.randint(1, 8)
        plan["payload"] = pdos(random, fd=fd)
        plan["node"] = {"axes": random.randint(1, 2), "execution": execution(random, 300)}
    elif form == "groups":
        plan["group"] = [
            {"name": name, "nodes": random.randint(1, 4), "axes": 1, "execution": execution(random, 300)}
            | pdos(random, fd=fd)
            for name in ("drives", "valves", "inputs")[: random.randint(1, 3)]
        ]
    # Blocks of 16 identifiers before and behind those of PDOs.
    blocks = random.sample((*range(8), *range(0x59, 0x78)), random.randint(form == "messages", 8))
    plan["message"] = [can_message(random, plan, 16 * block, has_nodes=form != "messages") for block in blocks]
    plan["limits"] = {"max_load": random.choice((0.6, 0.8, 0.95))}
    return plan


def pdos(random: Random, *, fd: bool) -> Plan:
    """Payload of a node."""
    most = random.choice((8, 8, 64 if fd else 20))
    found: Plan = {"read_bytes": random.randint(1, most), "write_bytes": random.randint(1, most)}
    found["every"] = random.choice((1, 1, 2, 5))
    if random.random() < 0.2:
        found = {"feedback_pdos": [random.randint(1, 8) for _ in range(2)], "command_pdos": [6], "pdo_per": "axis"}
    return found


def can_message(random: Random, plan: Plan, identifier: int, *, has_nodes: bool) -> Plan:
    """Another message."""
    fd = "data_bit_rate_kbit_s" in plan["bus"] and random.random() < 0.7
    period_us = random.choice((5, 10, 20, 50, 100, 200)) * 1000
    message: Plan = {"name": f"message-{identifier:x}", "identifier": identifier + 1, "period_us": period_us}
    message["payload_bytes"] = random.randint(0, 64 if fd else 8)
    message["jitter_us"] = round(random.choice((0, 0.05, 0.3, 1)) * period_us)
    message["deadline_us"] = round(random.choice((1, 1, 2, 0.5)) * period_us)
    keys = {"fd": fd, "brs": not fd or random.random() < 0.7, "burst": random.choice((1, 1, 2, 5))}
    plain = {"fd": False, "brs": True, "burst": 1}
    message |= {key: value for key, value in keys.items() if value != plain[key] and f'"{key}"' in SCHEMA}
    if has_nodes and random.random() < 0.2:
        message["per_node"] = True
    elif random.random() < 0.2:
        message |= {"identifier_bits": 29, "identifier": identifier << 18 | random.randrange(1 << 18)}
    return message


def ethercat_plan(random: Random) -> Plan:
    """Devices that are alike, or groups at several rates."""
    master_us = random.choice((5, 25, 60, 150))
    bus: Plan = {"kind": "ethercat", "master_us": master_us, "master_jitter_us": random.choice((1, 10, 10, 30))}
    bus["master_grade"] = random.choice(("measured", "measured", "assumed"))
    bus["distributed_clocks"] = random.random() < 0.6
    bus["units"] = random.choice(("spread", "spread", "together"))
    if random.random() < 0.8:
        bus["master"] = random.choice(("SOEM", "IgH", "ethercrab", "TwinCAT", "acontis"))
    if random.random() < 0.2:
        bus["process_data"] = random.choice(("LRW-separate", "LRW-shared", "LRD-LWR"))
    if random.random() < 0.2:
        bus["mailbox_polls"] = 1
    plan: Plan = {"bus": bus, "cycle": {"period_us": random.choice((250, 500, 1000, 2000))}}
    if random.random() < 0.4:
        bus["nodes"] = random.randint(1, 40)
        plan["payload"] = {"read_bytes": random.randint(1, 60), "write_bytes": random.randint(1, 60)}
        plan["node"] = {"axes": 1, "execution": execution(random, 60)} | port(random)
        return plan
    rates = [1 if random.random() < 0.9 else 2] + [random.choice((1, 2, 2, 4, 8)) for _ in range(random.randint(1, 4))]
    random.shuffle(rates)
    plan["group"] = [
        {"name": f"unit-{place}", "nodes": random.randint(1, 10), "axes": random.randint(0, 1), "every": every}
        | {"read_bytes": random.randint(1, 40), "write_bytes": random.randint(1, 40)}
        | {"execution": execution(random, 60)}
        | port(random)
        for place, every in enumerate(rates)
    ]
    return plan


def port(random: Random) -> Plan:
    """Ports of a device, and the cable to it."""
    ports: tuple[Plan, ...] = ({}, {"port": "E-bus"}, {"cable_length_m": random.randint(1, 20)}, {"delay_us": 0.72})
    return random.choice(ports)


def fitting(kind: str, seed: int, folder: Path) -> tuple[Plan, Path]:
    """A random plan that fits by busplan, and its file; periods that are too short are doubled."""
    random = Random(f"{kind} {seed}")
    path = folder / "plan.toml"
    while True:
        plan: Plan = {"schema_version": 1, "name": f"{kind}-{seed}"} | PLANS[kind](random)
        for _ in range(6):
            path.write_text(tomli_w.dumps(plan))
            # A sweep of one point tells whether it fits; capacity would look for a cure, too.
            _, (key, value), *_ = plan["bus"].items()
            if "fits" in busplan.sweep(path, vary={f"bus.{key}": [value]})["verdict"]:
                return plan, path
            for section in [plan.get("cycle", {}), *plan.get("message", [])]:
                section |= {key: 2 * section[key] for key in ("period_us", "deadline_us") if key in section}


PLANS: Final = {"can": can_plan, "ethercat": ethercat_plan}
