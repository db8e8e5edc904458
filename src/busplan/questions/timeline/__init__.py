"""`busplan.timeline`: one communication cycle as events, in a window."""

import re
from pathlib import Path
from typing import Final, overload

from busplan.buses.network import Network
from busplan.errors import ArgumentError
from busplan.forms.blocks import Report
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    FilePath,
    ProfileLike,
    checked_models,
    finite,
    load_profile,
    recording_name,
    require_cycle,
    whole_number,
    with_its_constants,
)
from busplan.questions.fit.network import network_of
from busplan.questions.timeline.events import Schedule, Total, schedule, totals, zoom
from busplan.questions.timeline.recorded import MEDIAN, WORST, Chosen, RecordedTimelineAnswer, answer_of, place_of

__all__ = ["RecordedTimelineAnswer", "TimelineAnswer", "timeline"]
_TRANSACTION: Final = re.compile(r"\s*(?P<kind>[a-z_]+)\s*:\s*(?P<node>[0-9]{1,9})\s*")


class TimelineAnswer(Answer, Schedule):
    """Answer of `timeline`: the `events` inside the window, and `cycle_events` of the whole cycle."""

    __slots__ = ()

    @property
    def totals(self) -> tuple[Total, ...]:
        """Totals of the events in the window, by kind."""
        return totals(self)

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.timeline.report import timeline_report

        return timeline_report(self)


@overload
def timeline(
    profile: ProfileLike,
    *,
    timing_model: str | None = None,
    from_us: float | None = None,
    to_us: float | None = None,
    transaction: tuple[str, int] | str | None = None,
    cycle: int | None = None,
    recording: None = None,
) -> TimelineAnswer: ...


@overload
def timeline(
    profile: ProfileLike,
    *,
    recording: FilePath,
    cycle: int | Chosen | None = None,
    channel: str | None = None,
    progress: Progress | None = None,
) -> RecordedTimelineAnswer: ...


@with_its_constants
def timeline(
    profile: ProfileLike,
    *,
    timing_model: str | None = None,
    from_us: float | None = None,
    to_us: float | None = None,
    transaction: tuple[str, int] | str | None = None,
    cycle: int | Chosen | None = None,
    recording: FilePath | None = None,
    channel: str | None = None,
    progress: Progress | None = None,
) -> TimelineAnswer | RecordedTimelineAnswer:
    """Show one communication cycle as events, node by node; of a recording beside the same cycle of the plan.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    timing_model
        Name of a timing model, such as "standard"; by default the one that decides. A recording is compared with that.
    from_us, to_us
        Start and end of the window, from the start of the cycle [us]; by default the whole cycle.
    transaction
        One transaction of one node with its gaps: ("read", 1) or "read:1".
    cycle
        Number of a cycle, from 1; cycles repeat after the hyperperiod (the common multiple of the rates of groups). By
        default the fullest, which the verdict is for. Of a recording its number there, "worst" (the longest, by
        default) or "median".
    recording
        A recording of the machine's bus, as for `measured`: its time is told by what it is waited for.
    channel
        Name of the channel in a recording of several.
    progress
        Function called with the bytes read and the size of the recording [bytes].

    Returns
    -------
    TimelineAnswer or RecordedTimelineAnswer
        Its `events` have no gaps between them; times are in us. Of a recording the `shares` add up to the cycle.

    Raises
    ------
    BusplanError
        Not a profile, too many nodes, an unknown timing model, no such transaction or cycle, or an empty window; a
        recording that cannot be read or has no whole cycle, and a window of one.

    References
    ----------
    Paper, section III-C and equation (2), Figs. 4, 5 and 7.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.timeline("paper-4ms", transaction=("read", 1))
    >>> [(event.kind, round(event.duration_us, 3)) for event in answer.events][1:4]
    [('request_data', 0.738), ('acknowledge', 0.581), ('execution', 36.733)]
    """
    network = network_of(require_cycle(load_profile(profile), question="timeline"))
    if recording is not None:
        given = {"timing_model": timing_model, "from_us": from_us, "to_us": to_us, "transaction": transaction}
        for name, value in given.items():
            if value is not None:
                raise ArgumentError(f"{name} {value!r}: a recording is shown by whole cycles; leave it out")
        return _recorded(network, recording, WORST if cycle is None else cycle, channel, progress)
    if channel is not None:
        raise ArgumentError(f"channel {channel!r}: needs a recording")
    if cycle in (WORST, MEDIAN):
        raise ArgumentError(f"cycle {cycle}: needs a recording; a planned cycle has a number from 1")
    model = None if timing_model is None else checked_models([timing_model], network)[0]
    window = zoom(
        schedule(network, model=model, number=None if cycle is None else whole_number(cycle, name="cycle")),
        from_us=None if from_us is None else finite(from_us, name="from_us"),
        to_us=None if to_us is None else finite(to_us, name="to_us"),
        transaction=None if transaction is None else _transaction(transaction, network),
    )
    return TimelineAnswer(*window)


def _recorded(
    network: Network, recording: FilePath, cycle: object, channel: str | None, progress: Progress | None
) -> RecordedTimelineAnswer:
    """A cycle of a recording beside the plan."""
    source = recording_name(recording)
    chosen: Chosen | None = WORST if cycle == WORST else MEDIAN if cycle == MEDIAN else None
    wanted = chosen or whole_number(cycle, name="cycle")
    cycles = network.bus.recorded_cycles(
        network, Path(source), channel=channel, progress=progress or (lambda _done, _total: None)
    )
    place = place_of(cycles, wanted)
    if place is None:
        first, last, count = cycles.numbers[0], cycles.numbers[-1], len(cycles.numbers)
        missing = f", {last - first + 1 - count:,} of them not whole" if count <= last - first else ""
        raise ArgumentError(
            f"cycle {wanted}: {source} has no such whole cycle; its cycles are {first:,} to {last:,}{missing}"
        )
    return answer_of(network.profile, source, cycles, place, chosen=chosen)


def _transaction(given: object, network: Network) -> tuple[str, int]:
    """Kind and node of a transaction, checked against the profile's bus."""
    match given:
        case str() as text:
            written = _TRANSACTION.fullmatch(text)
            kind, node = (written["kind"], int(written["node"])) if written else ("", 0)
        case (str() as kind, number):
            node = whole_number(number, name="transaction")
            text = f"{kind}:{node}"
        case _:
            raise ArgumentError(f'transaction {given!r}: expected one of one node, as ("read", 1)')
    kinds, nodes = [kind.key for kind in network.bus.stretch_kinds], int(network.nodes)
    if kind in kinds and 1 <= node <= nodes:
        return kind, node
    expected = f"{' or '.join(kinds)} and a node from 1 to {nodes}" if kinds else "none: this bus has no transactions"
    example = f", as {kinds[0]}:1 or {kinds[-1]}:{nodes}" if kinds else ""
    raise ArgumentError(f"transaction {text}: expected {expected}{example}")
