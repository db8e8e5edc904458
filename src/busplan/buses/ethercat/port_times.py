"""Delays of devices in a line, from the port receive times (0x0900) that a master reads at its start."""

from collections.abc import Iterator, Mapping
from itertools import accumulate, pairwise
from typing import Final, NamedTuple

from busplan.buses.ethercat.equations import c, cable_us
from busplan.buses.network import Network
from busplan.buses.rule import RecordedFigure
from busplan.english import plural
from busplan.recordings.ethercat import Latch
from busplan.recordings.statistics import expanded
from busplan.sections.machine import ProfileGroup

_WRAP_NS: Final = 1 << 32
_PORTS_OF_LINE: Final = 2
"""Most ports with a link that a device in a line has."""


class _NoLineError(Exception):
    """The port receive times do not belong to a line; the text says why."""


class LineDelays(NamedTuple):
    """Delay of each device in a line with the cable before it, from port receive times."""

    hops_us: tuple[float, ...]
    """Delay one way of each device from the second on [us]."""
    latches: int
    """Number of broadcast writes that the delays are the mean of [1]."""
    remarks: tuple[str, ...]
    """What the port receive times do not show, and why."""

    def figures(self, network: Network) -> Iterator[RecordedFigure]:
        """The recorded delay of each device, and the mean of each group of the plan.

        The plan gives means, so only means have a verdict; none has if the plan has another number of devices.
        """
        groups = self._groups(network)
        if not groups:
            yield from (self._figure(range(number, number + 1)) for number in range(2, len(self.hops_us) + 2))
        for nodes, numbers in groups:
            if len(numbers) > 1:
                alone = (self._figure(range(number, number + 1), nodes) for number in numbers)
                yield from (figure._replace(sense="shown") for figure in alone)
            if numbers:
                yield self._figure(numbers, nodes)

    def edits(self, network: Network) -> Mapping[str, float]:
        """Mean delay one way of the devices of each group, without the cable [us], by dotted key."""
        edits: dict[str, float] = {}
        for nodes, numbers in self._groups(network):
            mean_us = self._mean_us(numbers) - _cable_us(nodes) if numbers else 0.0
            if mean_us > 0:
                edits[nodes.node_key("delay_us")] = round(mean_us, 6)
        return edits

    def more_us(self, network: Network) -> float:
        """Delay of the devices there and back with the values of `edits`, less that of the plan [us]."""
        edits = self.edits(network)
        more_us: float = sum(
            2 * nodes.nodes * (edits[key] - _planned_us(nodes))
            for nodes in network.profile.node_groups
            if (key := nodes.node_key("delay_us")) in edits
        )
        return more_us

    def _groups(self, network: Network) -> list[tuple[ProfileGroup, range]]:
        """Each group of the plan with the numbers of its devices, from 2: port receive times show no delay of device 1.

        Empty where the plan has another number of devices.
        """
        ends = list(accumulate(int(nodes.nodes) for nodes in network.profile.node_groups))
        if ends[-1] != len(self.hops_us) + 1:
            return []
        numbers = (range(max(end, 1) + 1, next_end + 1) for end, next_end in pairwise((0, *ends)))
        return list(zip(network.profile.node_groups, numbers, strict=True))

    def _mean_us(self, numbers: range) -> float:
        return sum(self.hops_us[number - 2] for number in numbers) / len(numbers)

    def _figure(self, numbers: range, nodes: ProfileGroup | None = None) -> RecordedFigure:
        """Mean delay of some devices, with that of their group in the plan."""
        name = f"delay of device {numbers[0]}"
        if len(numbers) > 1:
            name = f"mean delay of devices {numbers[0]} to {numbers[-1]}"
        figure = RecordedFigure(
            name,
            "us",
            None,
            self._mean_us(numbers),
            None,
            "shown",
            self.latches,
            note="one way, with the cable to it, by port times",
            is_mean=True,
        )
        if nodes is None:
            return figure
        step_us = c.MEASURED_DELAY_UNCERTAINTY_US / len(numbers) ** 0.5
        planned_doubt_us = (
            float(c.by_key("DELAY_UNCERTAINTY_US")[nodes.node.port]) if nodes.node.delay_us is None else step_us
        )
        return figure._replace(
            planned=_planned_us(nodes) + _cable_us(nodes),
            uncertainty=expanded(planned_doubt_us, step_us),
            sense="at most",
            key=nodes.node_key("delay_us"),
        )


def line_delays(latches: tuple[Latch, ...], unlatched: int) -> LineDelays:
    """Delays of the devices in a line, from port receive times.

    A frame passes a device, all those after it, and the device again: half the difference of its two port times, less
    that of the next device, is the delay one way. The difference falls from device to device: this gives their order.

    Parameters
    ----------
    latches
        The broadcast writes, each with the port receive times read after it.
    unlatched
        Number of reads of port receive times without such a write before.

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
    lines = []
    reasons: dict[str, None] = {}
    for latch in latches:
        try:
            lines.append([(span - behind) / 2000 for span, behind in pairwise(_spans_ns(latch))])
        except _NoLineError as error:
            reasons[str(error)] = None
    remarks += [f"No delays of devices by port times: {reason}." for reason in reasons]
    # The machine may have changed in between: only lines as long as the last one count.
    lines = [hops for hops in lines if len(hops) == len(lines[-1])]
    means_us = tuple(sum(hops) / len(hops) for hops in zip(*lines, strict=True))
    if means_us:
        remarks.append("The delay of device 1 and its cable is not in port times: the master's port has none.")
    return LineDelays(means_us, len(lines), tuple(remarks))


def _spans_ns(latch: Latch) -> list[int]:
    """From the first to the last port receive time of each device in a line, in their order [ns].

    Raises
    ------
    _NoLineError
        The devices are not in a line.
    """
    read = len(latch.ports_ns)
    if read != latch.devices:
        raise _NoLineError(f"the write passed {plural(latch.devices, 'device')}, and those of {read:,} were read")
    if read == 1:
        raise _NoLineError("there is 1 device")
    spans = sorted(map(_span_ns, latch.ports_ns.values()), reverse=True)
    ends = spans.count(0)
    if ends != 1:
        raise _NoLineError(f"{ends} devices have a time of port 0 alone, where a line has 1, at its end")
    if len(set(spans)) < len(spans):
        raise _NoLineError("devices are as far from the end as others: they are on no line")
    return spans


def _span_ns(times_ns: Mapping[int, int]) -> int:
    # A port without a link has no receive time.
    linked = {port: time for port, time in times_ns.items() if time}
    if 0 not in linked:
        raise _NoLineError("a device has no time of its port 0")
    if len(linked) > _PORTS_OF_LINE:
        raise _NoLineError(f"a device has times of {len(linked)} ports: it is a branch, which the times do not place")
    span = (linked[max(linked)] - linked[0]) % _WRAP_NS
    if span >= _WRAP_NS // 2:
        raise _NoLineError("a frame enters a device by another port than 0")
    return span


def _planned_us(nodes: ProfileGroup) -> float:
    """Delay of a device one way as planned [us]."""
    delay_us = nodes.node.delay_us
    return float(c.by_key("DELAY_US")[nodes.node.port]) if delay_us is None else delay_us


def _cable_us(nodes: ProfileGroup) -> float:
    """Cable to a device one way [us]."""
    return cable_us(nodes.node.cable_length_m) / 2
