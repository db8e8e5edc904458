"""Rules of the bus: does the cycle fit, is the gap count right, is the payload one that the bus carries?"""

from collections.abc import Iterator
from math import ceil
from typing import Final

from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.planning.cures import Change, change_for_room, change_to_fit
from busplan.buses.ieee1394.constants import (
    MAX_HOPS,
    MAX_NODES,
    MAX_PAYLOAD_BYTES,
    QUADLET_BYTES,
    REFERENCE_CABLE_M,
    padded_bytes,
)
from busplan.profile.toml import override
from busplan.rules.finding import Problem, Rule, Subject


def _us(value: float) -> str:
    return f"{value:.3f} us"


def _overrun(one: CapacityFigures) -> str:
    return (
        f"the cycle needs {_us(one.required_us)} of {_us(one.available_us)} under the {one.timing_model} timing, "
        f"{_us(-one.margin_us)} too much"
    )


def _cure(subject: Subject, *models: CapacityFigures) -> str:
    return _said(change_to_fit(subject.profile, models=[one.timing_model for one in models]))


def _said(change: Change | None) -> str:
    if change is None:
        return "no change of gap count, slice ratio or period alone is a cure"
    return "cheapest cure: " + ", ".join(f"{key} = {value}" for key, value in change.changes.items())


def slice_overrun(subject: Subject) -> Iterator[Problem]:
    """The cycle does not fit under the timing model that decides."""
    if "time" in subject.deciding.exceeded:
        cure = _cure(subject, subject.deciding)
        yield Problem("cycle.period_us", f"{_overrun(subject.deciding)}; {cure}")


def other_model_overrun(subject: Subject) -> Iterator[Problem]:
    """The cycle fits under the deciding model alone."""
    if "time" not in subject.deciding.exceeded and subject.other_overruns:
        deciding, other = subject.deciding, subject.other
        cure = _cure(subject, deciding, other)
        yield Problem(
            "cycle.period_us",
            f"fits the {deciding.timing_model}'s timing, not the {other.timing_model}'s: {_overrun(other)}; {cure}",
        )


def over_utilisation(subject: Subject) -> Iterator[Problem]:
    """The slice is fuller than [limits] allows."""
    limit, one = subject.profile.limits.max_utilisation, subject.deciding
    if limit is not None and one.utilisation > limit:
        cure = _said(
            change_for_room(subject.profile, model=one.timing_model, nodes=one.nodes, utilisation=limit),
        )
        yield Problem(
            "limits.max_utilisation",
            f"{one.utilisation:.1%} of the slice is used under the {one.timing_model} timing, "
            f"{limit:.1%} allowed; {cure}",
        )


def too_few_spare_nodes(subject: Subject) -> Iterator[Problem]:
    """The bus carries fewer further nodes than [limits] asks for."""
    limit, one = subject.profile.limits.min_spare_nodes, subject.deciding
    spare = one.max_nodes - one.nodes
    if limit is not None and spare < limit:
        yield Problem("limits.min_spare_nodes", f"{_spare(spare, limit, one)}; {_room(subject, one.nodes + limit)}")


def too_few_spare_axes(subject: Subject) -> Iterator[Problem]:
    """The bus carries fewer further axes than [limits] asks for."""
    limit, one = subject.profile.limits.min_spare_axes, subject.deciding
    spare = one.max_axes - one.axes
    if limit is not None and spare < limit:
        nodes = ceil((one.axes + limit) / subject.profile.node.axes)
        yield Problem("limits.min_spare_axes", f"{_spare(spare, limit, one)}; {_room(subject, nodes)}")


def _spare(spare: int, limit: int, one: CapacityFigures) -> str:
    return f"{max(spare, 0)} to spare under the {one.timing_model} timing, {limit} asked for"


def _room(subject: Subject, nodes: int) -> str:
    """What limits the nodes, and how that many would have room."""
    one = subject.deciding
    if one.limited_by == "time":
        cure = _said(change_for_room(subject.profile, model=one.timing_model, nodes=nodes))
    elif one.limited_by == "hops":
        cure = f"a tree with bus.max_hops = {MAX_HOPS:g} or less has room for {MAX_NODES:g} nodes"
    else:
        cure = f"a second bus has {MAX_NODES:g} more" if one.limited_by == "nodes" else "the payload fits no packet"
    return f"limited by {one.limited_by}; {cure}"


def too_many_nodes(subject: Subject) -> Iterator[Problem]:
    """More nodes than one bus has addresses for."""
    if "nodes" in subject.deciding.exceeded:
        nodes = subject.profile.bus.nodes
        yield Problem(
            "bus.nodes", f"{nodes} nodes are over the {MAX_NODES:g} of one bus; put the others on a second bus"
        )


def too_many_hops(subject: Subject) -> Iterator[Problem]:
    """More cable hops than the standard allows."""
    bus = subject.profile.bus
    if "hops" in subject.deciding.exceeded:
        chain = bus.max_hops is None
        cure = f"a tree with bus.max_hops = {MAX_HOPS:g} or less would do" if chain else "rewire the tree"
        hops = bus.hops(bus.nodes)
        yield Problem(
            "bus.nodes" if chain else "bus.max_hops", f"{hops} hops are over the {MAX_HOPS:g} of one bus; {cure}"
        )


def payload_over_limit(subject: Subject) -> Iterator[Problem]:
    """A payload larger than an asynchronous packet of this speed carries."""
    bus, payload = subject.profile.bus, subject.profile.payload
    for key in ("read_bytes", "write_bytes"):
        size = getattr(payload, key)
        if size > bus.max_payload_bytes:
            faster = [speed for speed, most in MAX_PAYLOAD_BYTES.items() if size <= most]
            cure = f'cheapest cure: bus.speed = "{faster[0]}"' if faster else "share it out among several transactions"
            over = f"{size} bytes are over the {bus.max_payload_bytes} bytes of a packet at {bus.speed}"
            yield Problem(f"payload.{key}", f"{over}; {cure}")


def payload_not_quadlets(subject: Subject) -> Iterator[Problem]:
    """A payload that the wire fills up."""
    payload = subject.profile.payload
    for key in ("read_bytes", "write_bytes"):
        size = getattr(payload, key)
        if size % QUADLET_BYTES:
            padded = padded_bytes(size)
            yield Problem(
                f"payload.{key}",
                f"{size} bytes are no whole number of quadlets; {padded} bytes travel anyway; use or say {padded}",
            )


def gap_count_unsafe(subject: Subject) -> Iterator[Problem]:
    """A gap count below the table."""
    one, bus = subject.deciding, subject.profile.bus
    if not one.gap_count_safe:
        yield Problem(
            "bus.gap_count",
            f"gap count {one.gap_count} is unsafe for {one.hops} hops; the smallest safe one is {one.safe_gap_count}"
            f"{'' if bus.cable_is_standard else f' for cables of up to {REFERENCE_CABLE_M:g} m'}",
        )


def gap_count_wasteful(subject: Subject) -> Iterator[Problem]:
    """A gap count above the table."""
    one, bus = subject.deciding, subject.profile.bus
    if one.gap_count > one.safe_gap_count and bus.cable_is_standard:
        best = override(subject.profile, {"bus.gap_count": "optimal"})
        after = figures(best, model=one.timing_model)
        won = after.max_nodes - one.max_nodes
        yield Problem(
            "bus.gap_count",
            f"gap count {one.gap_count} is above the {one.safe_gap_count} that {one.hops} hops need; "
            f"the latter would save {_us(one.required_us - after.required_us)} a cycle "
            f"and win {won} node{'s' * (won != 1)}",
        )


def execution_unmeasured(subject: Subject) -> Iterator[Problem]:
    """An execution time that nobody has measured."""
    if subject.profile.node.execution.grade == "assumed":
        yield Problem(
            "node.execution.grade",
            "the execution time is an assumption, and the largest terms rest on it; measure it on the node",
        )


RULES: Final = (
    Rule(
        "BP101",
        "slice-overrun",
        "error",
        "the cycle does not fit its time slice",
        "Under the timing model that decides (bus.timing_model), the reads, writes, gaps, the synchronous packet "
        "and the non-periodic time of one cycle (equation 2) take longer than slice_ratio * period_us (equation "
        "1). The message names the cheapest cure: the gap count is one register in each node, the slice ratio is "
        "computing time of the host, the period is what the machine is for.",
        slice_overrun,
    ),
    Rule(
        "BP102",
        "other-model-overrun",
        "warning",
        "the cycle fits under one timing model only",
        "The plan fits the paper, not the standard (or the other way round). The paper counts gaps in the data "
        "rate, the wire counts them at the base rate, four times slower at S400: a plan that fits the paper alone "
        "is likely to fail on the machine.",
        other_model_overrun,
    ),
    Rule(
        "BP103",
        "over-utilisation",
        "error",
        "the slice is fuller than limits.max_utilisation",
        "[limits] max_utilisation keeps a share of the slice free, for retries, growth and what the model does "
        "not know.",
        over_utilisation,
    ),
    Rule(
        "BP104",
        "too-few-spare-nodes",
        "error",
        "fewer nodes to spare than limits.min_spare_nodes",
        "[limits] min_spare_nodes asks that the bus could carry so many nodes more at the same period.",
        too_few_spare_nodes,
    ),
    Rule(
        "BP105",
        "too-few-spare-axes",
        "error",
        "fewer axes to spare than limits.min_spare_axes",
        "[limits] min_spare_axes asks that the bus could carry so many axes more at the same period.",
        too_few_spare_axes,
    ),
    Rule(
        "BP106",
        "too-many-nodes",
        "error",
        "more nodes than one bus has addresses for",
        "An IEEE 1394 bus has 63 nodes, and the host is one of them.",
        too_many_nodes,
    ),
    Rule(
        "BP107",
        "too-many-hops",
        "error",
        "more cable hops than the standard allows",
        "Between any two nodes lie at most 16 hops. In a chain with the host at its end that is 16 nodes; a tree "
        "carries more.",
        too_many_hops,
    ),
    Rule(
        "BP108",
        "payload-over-limit",
        "error",
        "the payload is larger than a packet of this speed",
        "An asynchronous packet carries 512 bytes at S100, 1024 at S200 and 2048 at S400.",
        payload_over_limit,
    ),
    Rule(
        "BP109",
        "gap-count-unsafe",
        "error",
        "the gap count is too small for the hops",
        "With a gap count below the table of IEEE 1394a, a node may take the gap inside a subaction for the end "
        'of it, and two nodes talk at once. Use the number of the message, or "optimal".',
        gap_count_unsafe,
    ),
    Rule(
        "BP110",
        "gap-count-wasteful",
        "warning",
        "the gap count is larger than the hops need",
        "Every transaction waits for a subaction gap and an arbitration reset gap, both in proportion to the gap "
        "count. 63 is what a bus starts with; the table of IEEE 1394a says what the hops need. All nodes must "
        "hold the same number, and it returns to 63 after two bus resets without a new one.",
        gap_count_wasteful,
    ),
    Rule(
        "BP111",
        "payload-not-quadlets",
        "warning",
        "the payload is no whole number of quadlets",
        "Payloads travel in quadlets of 4 bytes; what is missing is filled up. The paper's timing does not count "
        "the fill, the standard's does.",
        payload_not_quadlets,
    ),
    Rule(
        "BP112",
        "execution-unmeasured",
        "warning",
        "the execution time is an assumption",
        'node.execution has grade = "assumed". The execution time is the largest term of most cycles, and no '
        "equation gives it: measure it.",
        execution_unmeasured,
    ),
)
