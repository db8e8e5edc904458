"""Receive times of ports in a capture: the delay of each device of a line, beside the planned one."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Final, NamedTuple

from busplan.buses.ethercat.equations import (
    DELAY_UNCERTAINTY_US,
    DELAY_US,
    MEASURED_DELAY_UNCERTAINTY_US,
    cable_us,
)
from busplan.buses.network import Network
from busplan.buses.recorded import RecordedFigure
from busplan.elementwise import plain
from busplan.english import plural
from busplan.recordings.ethercat import Latch
from busplan.recordings.statistics import expanded
from busplan.sections.alike_nodes import AlikeNodes

_WRAP_NS: Final = 1 << 32
_OPEN_OF_LINE: Final = 2
"""Ports of a device within a line."""
_INCLUDED: Final = "one way, with the cable to it, by port times"


class _NoLineError(Exception):
    """Port times are not those of a line; its text says why."""


class LineDelays(NamedTuple):
    """Delay of each device of a line and of the cable to it, by the port times that a master reads at its start."""

    hops_us: tuple[float, ...]
    """One way, of the second device and all behind it [us]."""
    latches: int
    """Number of broadcast writes that they are the mean of [1]."""
    remarks: tuple[str, ...]
    """What the port times do not say, and why."""

    def figures(self, network: Network) -> Iterator[RecordedFigure]:
        """Each delay beside the planned one, and the mean of those that the plan has alike.

        The plan says a mean, so this alone is judged; nothing is planned where it has another number of devices.
        """
        first = 1
        if not self._is_planned(network):
            yield from (self._figure(number, number, None) for number in range(2, len(self.hops_us) + 2))
            return
        for alike in _alike(network):
            own = range(max(first, 2), first + int(plain(alike.nodes)))
            first = own.stop
            if len(own) > 1:
                yield from (self._figure(number, number, alike)._replace(sense="shown") for number in own)
            if own:
                yield self._figure(own[0], own[-1], alike)

    def _figure(self, first: int, last: int, alike: AlikeNodes | None) -> RecordedFigure:
        """Mean delay of some devices."""
        own_us = self.hops_us[first - 2 : last - 1]
        name = f"delay of device {first}" if first == last else f"mean delay of devices {first} to {last}"
        shown = RecordedFigure(
            name, "us", None, sum(own_us) / len(own_us), None, "shown", self.latches, note=_INCLUDED, is_mean=True
        )
        if alike is None:
            return shown
        delay_us, doubt_us = _planned(alike)
        step_us = MEASURED_DELAY_UNCERTAINTY_US / len(own_us) ** 0.5
        if alike.node.delay_us is not None:
            doubt_us = step_us
        return shown._replace(
            planned=delay_us + _cable_us(alike),
            uncertainty=expanded(doubt_us, step_us),
            sense="at most",
            key=alike.node_key("delay_us"),
        )

    def _is_planned(self, network: Network) -> bool:
        return sum(int(plain(alike.nodes)) for alike in _alike(network)) == len(self.hops_us) + 1

    def edits(self, network: Network) -> Mapping[str, float]:
        """Mean delay one way of the devices of each group, cable taken off [us], by its key."""
        edits: dict[str, float] = {}
        first = 0
        if not self._is_planned(network):
            return edits
        for alike in _alike(network):
            last = first + int(plain(alike.nodes))
            own_us = self.hops_us[max(first - 1, 0) : last - 1]
            mean_us = sum(own_us) / len(own_us) - _cable_us(alike) if own_us else 0.0
            if mean_us > 0:
                edits[alike.node_key("delay_us")] = round(mean_us, 6)
            first = last
        return edits

    def more_us(self, network: Network) -> float:
        """What the devices take there and back beyond the plan, by what `edits` say [us]."""
        edits = self.edits(network)
        return sum(
            2 * plain(alike.nodes) * (edits[key] - _planned(alike)[0])
            for alike in _alike(network)
            if (key := alike.node_key("delay_us")) in edits
        )


def line_delays(latches: tuple[Latch, ...], unlatched: int) -> LineDelays:
    """The delays that port times say of a line.

    A frame passes a device, all behind it, and the device again: half the difference of its two port times less that
    of the next device is the delay one way. The difference falls from device to device, which gives their order.

    Parameters
    ----------
    latches
        The broadcast writes, each with the port times behind it.
    unlatched
        Reads of port times without such a write before them.

    References
    ----------
    ETG.1000.4, distributed clocks; the formula of the open masters SOEM and IgH.
    """
    remarks = []
    if unlatched:
        remarks.append(
            f"Port times were read {plural(unlatched, 'time')} without the broadcast write to 0x0900 that stamps "
            "them: not used; begin the recording before the master starts."
        )
    hops = []
    reasons: dict[str, None] = {}
    for latch in latches:
        try:
            hops.append([(span - behind) / 2000 for span, behind in pairwise(_spans_ns(latch))])
        except _NoLineError as error:
            reasons[str(error)] = None
    remarks += [f"No delays of devices by port times: {reason}." for reason in reasons]
    # The machine may have been changed between: only lines as long as the last one are alike.
    hops = [hop for hop in hops if len(hop) == len(hops[-1])]
    means_us = tuple(sum(own) / len(own) for own in zip(*hops, strict=True))
    if means_us:
        remarks.append("The delay of device 1 and its cable is not in port times, for the master's port has none.")
    return LineDelays(means_us, len(hops), tuple(remarks))


def _spans_ns(latch: Latch) -> list[int]:
    """From the first to the last port time of each device of a line, in their order.

    Raises
    ------
    _NoLineError
        The times say no line.
    """
    seen = len(latch.ports_ns)
    if seen != latch.devices:
        raise _NoLineError(f"the write passed {plural(latch.devices, 'device')}, and those of {seen:,} were read")
    if seen == 1:
        raise _NoLineError("there is 1 device")
    spans = sorted(map(_span_ns, latch.ports_ns.values()), reverse=True)
    ends = spans.count(0)
    if ends != 1:
        raise _NoLineError(f"{ends} devices have a time of port 0 alone, where a line has 1, at its end")
    if len(set(spans)) < len(spans):
        raise _NoLineError("devices are as far from the end as others: they are on no line")
    return spans


def _span_ns(times_ns: Mapping[int, int]) -> int:
    # A port without a link has no time.
    linked = {port: time for port, time in times_ns.items() if time}
    if 0 not in linked:
        raise _NoLineError("a device has no time of its port 0")
    if len(linked) > _OPEN_OF_LINE:
        raise _NoLineError(f"a device has times of {len(linked)} ports: it is a branch, which the times do not place")
    span = (linked[max(linked)] - linked[0]) % _WRAP_NS
    if span >= _WRAP_NS // 2:
        raise _NoLineError("a frame enters a device by another port than 0")
    return span


def _alike(network: Network) -> list[AlikeNodes]:
    return [alike for group in network.groups for alike in group.members or (group.said,)]


def _planned(alike: AlikeNodes) -> tuple[float, float]:
    """Delay of a device one way as planned, and its standard uncertainty [us]."""
    node = alike.node
    if node.delay_us is None:
        return float(DELAY_US[node.port]), float(DELAY_UNCERTAINTY_US[node.port])
    return plain(node.delay_us), float(MEASURED_DELAY_UNCERTAINTY_US)


def _cable_us(alike: AlikeNodes) -> float:
    """Cable to a device one way [us]."""
    return plain(cable_us(alike.node.cable_m)) / 2
