"""Text of a new profile: of a new machine, or a copy of a shipped profile with its comments and layout."""

import re
from typing import Final, NamedTuple

from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.parts import Starter
from busplan.english import did_you_mean
from busplan.errors import BusplanError, PlacedError
from busplan.profile.document import decode, read_bytes, validate
from busplan.profile.edit import short_text, value_text
from busplan.profile.sources import locate, shipped_names
from busplan.servo.parameters import dividing_step_us

_SCHEMA: Final = "#:schema ./busplan.schema.json\n"
"""First line of a profile, for editors: the JSON Schema beside it."""
_HEAD: Final = f"""\
{_SCHEMA}# `busplan schema > busplan.schema.json` writes it; an editor then completes and checks the keys.
"""
_CIRCLE: Final = re.compile(r"^(\[circle\].*\n)", re.MULTILINE)
_TURN: Final = 'path = "iso230-4"          # one whole turn is measured, after a lead-in; the paper has a "trapezoid"\n'
_SUPPRESSION: Final = re.compile(r"^# busplan: ignore\[.*\n|[ \t]+# busplan: ignore\[.*", re.MULTILINE)


_LONGEST_STEP_US: Final = 100.0
"""Longest position-loop period of a new profile [us]."""
_COMMENTS_AT: Final = 27
"""Column of the comments of a new profile."""
_MACHINE: Final = """\
schema_version = 1
name = {name}
description = "A new machine; assumed values are marked: measure and replace them"

{bus}
{count}
[cycle]
period_us = {period}
slice_ratio = {ratio}

{parts}
[limits]
reserve = 0.15             # share of the slice that must stay free for the cycle to fit
"""
_MOTION: Final = """
[servo]                    # take the values from the drives' commissioning, then grade them "measured"
grade = "assumed"
loop = "node"              # assumed: where the position loop is closed; "host" needs servo.update
interpolation = "linear"   # assumed: what a node does between set-points
{step}# assumed: longest period of the position loop; one that divides cycle.period_us is taken
position_gain_per_s = 50   # assumed: the Kv factor of the drives, 1/s; 1 m/min per mm is 16.7
velocity_feedforward = 1   # assumed
drive_lag_us = 1000        # assumed: time constant of the velocity loop, from its step response

[circle]                   # the test circle of a ballbar
path = "iso230-4"          # one whole turn is measured, after a lead-in
radius_mm = 100
feed_mm_per_min = 3000

# How round must it be? Without a tolerance the circle is not judged. From the drawing or ISO 230-4, for example:
# [tolerance]
# circular_deviation_mm = 0.02
"""


_COUNT: Final = "nodes = {nodes}                  # the host is not counted\n"
_PAYLOAD: Final = """\
read_bytes_per_axis = {bytes}    # as position and status of an axis
write_bytes_per_axis = {bytes}   # as set-point and control word of an axis
"""
_ALIKE: Final = """\
[payload]                  # assumed: see the register map of the nodes; a fixed part is read_bytes, write_bytes
{payload}
[node]
axes = {axes}
{more}
[node.execution]           # {measure}
{execution}"""
_GROUP: Final = """\
[[group]]                  # the groups stand in their order on the bus; the payload is assumed: see the register map
name = "{name}"
nodes = {nodes}
axes = {axes}
{more}{payload}
[group.execution]          # {measure}
{execution}"""


class NodeGroup(NamedTuple):
    """Alike nodes of a new machine."""

    name: str
    """Name of the group; empty where all nodes of the machine are alike."""
    nodes: int
    axes: int
    """Axes of one node."""
    read_bytes: int | None = None
    """Payload that a node sends [bytes]; None for that of its axes."""
    write_bytes: int | None = None
    """Payload that a node receives [bytes]; None for that of its axes."""
    data: tuple[str, str] = ("of a node", "of a node")
    """What these payloads of a node with axes are."""


class Machine(NamedTuple):
    """A machine that a new profile describes."""

    groups: tuple[NodeGroup, ...]
    period_us: float
    bytes_per_axis: int
    """Payload of each axis in either direction [bytes]; also that of a node without axes and bytes of its own."""
    host: str | None = None
    """Name among the hosts of the kind; None for its usual one."""
    variant: str = ""
    """Name among the variants of the kind; empty for the usual one."""
    rate: int | None = None
    """Bit rate, in the unit of its key; None for the usual one, which is assumed."""


def shared_out(axes: int, *, nodes: int) -> tuple[NodeGroup, ...]:
    """Share axes out over nodes as evenly as possible, in one group of alike nodes or two.

    Examples
    --------
    >>> [(group.name, group.nodes, group.axes) for group in shared_out(7, nodes=3)]
    [('axes-3', 1, 3), ('axes-2', 2, 2)]
    """
    per_node, rest = divmod(axes, nodes)
    if not rest:
        return (NodeGroup("", nodes, per_node),)
    shares = ((rest, per_node + 1), (nodes - rest, per_node))
    return tuple(NodeGroup(f"axes-{share}", count, share) for count, share in shares)


def machine_text(machine: Machine, *, kind: str, name: str, file: str) -> str:
    """Text of a profile of an unmeasured machine; every assumed value says so.

    `file` is the profile's file as a command line takes it. An invalid name, or groups that the kind of bus cannot
    have, raise BusplanError.
    """
    starter = kind_named(kind).starter
    first = machine.groups[0]
    # Servos of a robot move along no circle of a machine tool.
    motion = "" if machine.variant in starter.servos else _MOTION
    step_us = dividing_step_us(machine.period_us, most_us=_LONGEST_STEP_US)
    text = (_HEAD + _MACHINE + motion + "{more}").format(
        name=value_text(name),
        bus=_bus(kind_named(kind), machine),
        ratio=starter.slice_ratio,
        count="" if first.name else _COUNT.format(nodes=first.nodes),
        parts="\n".join(_part(group, machine=machine, starter=starter, file=file) for group in machine.groups),
        period=short_text(machine.period_us),
        step=f"step_us = {short_text(step_us)} ".ljust(_COMMENTS_AT),
        more=starter.more and f"\n{starter.more}",
    )
    return _checked(text, name=name)


def _bus(bus: Bus, machine: Machine) -> str:
    """Section [bus]."""
    section, rate = bus.new_section(machine.host, machine.variant), bus.starter.rate
    if machine.rate is None:
        return section
    return re.sub(rf"^{rate} = .*$", f"{rate} = {machine.rate}", section, flags=re.MULTILINE)


def _part(group: NodeGroup, *, machine: Machine, starter: Starter, file: str) -> str:
    """Sections of a group of nodes."""
    of_group = f" --group {group.name}" if group.name else ""
    return (_GROUP if group.name else _ALIKE).format(
        name=group.name,
        nodes=group.nodes,
        axes=group.axes,
        payload=_payload(group, bytes_per_axis=machine.bytes_per_axis),
        measure=starter.measure.format(file=file, group=of_group),
        execution=starter.execution(machine.variant),
        more=starter.node,
    )


def _payload(group: NodeGroup, *, bytes_per_axis: int) -> str:
    if group.read_bytes is None and group.axes:
        return _PAYLOAD.format(bytes=bytes_per_axis)
    words = group.data if group.axes else ("as inputs", "as outputs")
    sizes = (group.read_bytes, group.write_bytes)
    lines = (
        (f"{key} = {bytes_per_axis if size is None else size}", word)
        for key, size, word in zip(("read_bytes", "write_bytes"), sizes, words, strict=True)
    )
    return "".join(f"{line.ljust(_COMMENTS_AT)}# {comment}\n" for line, comment in lines)


def _checked(text: str, *, name: str) -> str:
    try:
        validate(decode(text.encode(), name=name))
    except PlacedError as refused:
        problems = [problem for problem in refused.placed if problem.key not in ("", "name")]
        if problems:
            raise BusplanError(*(problem.message for problem in problems)) from None
        raise _nameless(name) from None
    except UnicodeEncodeError:  # The name of the file is not UTF-8.
        raise _nameless(name) from None
    return text


def _nameless(name: str) -> BusplanError:
    return BusplanError(f"{name!r}: no name for a profile; expected 1 to 100 printable characters")


def starter_text(source: str, *, name: str) -> str:
    """Text of a shipped profile under a new name.

    An unknown source or an invalid name raises BusplanError.
    """
    if source not in shipped_names():
        near = did_you_mean(source, shipped_names())
        names = f"{', '.join(shipped_names())}{near and f'; {near}'}"
        raise BusplanError(f"--from {source}: no shipped profile; shipped are {names}")
    path, _ = locate(source)
    document = decode(read_bytes(path, name=source), name=source)
    place = document.places["name",]
    # Remove suppressions: they are decisions about the shipped profile, not about the new machine.
    before, after = document.text[: place.value_start], document.text[place.value_end :]
    after = _SUPPRESSION.sub("", after)
    if ("circle", "path") not in document.places:
        after = _CIRCLE.sub(rf"\1{_TURN}", after)
    text = before + value_text(name) + after
    copied = f"# A copy of the shipped profile {source}: its values stay those until you change them.\n"
    return _checked(f"{_HEAD}{copied}{text.removeprefix(_SCHEMA)}", name=name)
