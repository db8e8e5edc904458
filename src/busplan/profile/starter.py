"""A new profile: of a machine of one's own, or from a shipped one with its comments and layout."""

import re
from typing import Final, NamedTuple

from busplan.buses import kind_named
from busplan.buses.parts import Starter
from busplan.errors import BusplanError
from busplan.nearest import did_you_mean
from busplan.profile.shipped import locate, shipped_names
from busplan.profile.toml import decode, read_bytes, validate
from busplan.profile.write import short_text, value_text
from busplan.servo.checks import dividing_step_us

_CIRCLE: Final = re.compile(r"^(\[circle\].*\n)", re.MULTILINE)
_TURN: Final = (
    'path = "iso230-4"          # one whole turn is measured, behind a lead-in; the paper has a "trapezoid"\n'
)
_SUPPRESSION: Final = re.compile(r"^# busplan: ignore\[.*\n|[ \t]+# busplan: ignore\[.*", re.MULTILINE)


_LONGEST_STEP_US: Final = 100.0
"""Longest position-loop period of a new profile."""
_COMMENTS_AT: Final = 27
"""Column of the comments of a new profile."""
_MACHINE: Final = """\
schema_version = 1
name = {name}
description = "{nodes} nodes, {axes} axes, {period} us, {bytes} bytes an axis each way: assumed until somebody measures"

{bus}
{count}
[cycle]
period_us = {period}
slice_ratio = {ratio}

{each}
[limits]
reserve = 0.15             # share of the slice that must stay free for a plan to fit

[servo]                    # take the values from the drives' commissioning, then grade them "measured"
grade = "assumed"
loop = "node"              # assumed: where the position loop is closed; "host" needs servo.update
interpolation = "linear"   # assumed: what a node does between set-points
{step}# assumed: period of the position loop; it divides cycle.period_us
position_gain_per_s = 50   # assumed: the Kv factor of the drives, 1/s; 1 m/min per mm is 16.7
velocity_feedforward = 1   # assumed
drive_lag_us = 1000        # assumed: time constant of the velocity loop, from its step response

[circle]                   # the test circle of a ballbar
path = "iso230-4"          # one whole turn is measured, behind a lead-in
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
_PAYLOAD_WITHOUT_AXES: Final = """\
read_bytes = {bytes}             # as inputs
write_bytes = {bytes}            # as outputs
"""
_EXECUTION: Final = """\
kind = "linear"
grade = "assumed"
base_us = 20               # assumed: {base}
per_byte_us = 0.1          # assumed: what each byte adds
"""
_ALIKE: Final = f"""\
[payload]                  # assumed: see the register map of the nodes; a fixed part is read_bytes, write_bytes
{_PAYLOAD}
[node]
axes = {{axes}}

[node.execution]           # {{measure}}
{_EXECUTION}"""
_GROUP: Final = f"""\
[[group]]                  # the groups stand in their order on the bus; the payload is assumed: see the register map
name = "axes-{{axes}}"
nodes = {{nodes}}
axes = {{axes}}
{{payload}}
[group.execution]          # {{measure}}
{_EXECUTION}"""


class Machine(NamedTuple):
    """What a new profile starts from."""

    nodes: int
    axes: int
    """Of all nodes."""
    period_us: float
    bytes_per_axis: int
    """Payload of each axis, in either direction."""
    host: str | None = None
    """Name among the hosts of the kind; None for its usual one."""


def machine_text(machine: Machine, *, kind: str, name: str, file: str) -> str:
    """Text of a profile of a machine that nobody has measured; every value that rests on nothing says so.

    Axes that cannot be shared out evenly make two groups of nodes.

    Parameters
    ----------
    machine
        Nodes, axes, period and payload.
    kind
        Kind of bus.
    name
        Name of the profile.
    file
        Its file, as a command line takes it.

    Raises
    ------
    BusplanError
        An invalid name.
    """
    starter = kind_named(kind).starter
    per_node, rest = divmod(machine.axes, machine.nodes)
    if rest:
        count = ""
        shares = ((rest, per_node + 1), (machine.nodes - rest, per_node))
        each = "\n".join(_group(nodes, axes, machine=machine, starter=starter, file=file) for nodes, axes in shares)
    else:
        count = _COUNT.format(nodes=machine.nodes)
        each = _ALIKE.format(
            bytes=machine.bytes_per_axis,
            axes=per_node,
            measure=starter.measure.format(file=file, group=""),
            base=starter.base,
        )
    step_us = dividing_step_us(machine.period_us, most_us=_LONGEST_STEP_US)
    text = _MACHINE.format(
        name=value_text(name),
        bus=starter.section(machine.host),
        ratio=starter.slice_ratio,
        nodes=machine.nodes,
        axes=machine.axes,
        count=count,
        each=each,
        period=short_text(machine.period_us),
        bytes=machine.bytes_per_axis,
        step=f"step_us = {short_text(step_us)} ".ljust(_COMMENTS_AT),
    )
    return _checked(text, name=name)


def _group(nodes: int, axes: int, *, machine: Machine, starter: Starter, file: str) -> str:
    payload = (_PAYLOAD if axes else _PAYLOAD_WITHOUT_AXES).format(bytes=machine.bytes_per_axis)
    measure = starter.measure.format(file=file, group=f" --group axes-{axes}")
    return _GROUP.format(nodes=nodes, axes=axes, payload=payload, measure=measure, base=starter.base)


def _checked(text: str, *, name: str) -> str:
    try:
        validate(decode(text.encode(), name=name))
    except (BusplanError, UnicodeEncodeError):  # UnicodeEncodeError: a file name that is not UTF-8
        raise BusplanError(f"{name!r}: no name for a profile; expected 1 to 100 printable characters") from None
    return text


def starter_text(source: str, *, name: str) -> str:
    """Text of a shipped profile under a new name.

    Parameters
    ----------
    source
        Name of the shipped profile.
    name
        Name of the new profile.

    Raises
    ------
    BusplanError
        No such shipped profile, or an invalid name.
    """
    if source not in shipped_names():
        near = did_you_mean(source, shipped_names())
        names = f"{', '.join(shipped_names())}{near and f'; {near}'}"
        raise BusplanError(f"--from {source}: no shipped profile; shipped are {names}")
    path, _ = locate(source)
    document = decode(read_bytes(path, name=source), name=source)
    place = document.places["name",]
    # Remove suppressions: they were decided for the shipped profile, not for the new machine.
    before, after = document.text[: place.value_start], document.text[place.value_end :]
    after = _SUPPRESSION.sub("", after)
    if ("circle", "path") not in document.places:
        after = _CIRCLE.sub(rf"\1{_TURN}", after)
    text = before + value_text(name) + after
    # The path to the schema is valid only in the shipped folder.
    text = text.removeprefix("#:schema ./busplan.schema.json\n")
    return _checked(
        f"# A copy of the shipped profile {source}: its values stay those until you change them.\n{text}", name=name
    )
