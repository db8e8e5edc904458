"""`busplan.latency`."""

from collections.abc import Iterable

from busplan.forms.blocks import Report
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Models, ProfileLike, checked_models, load_network, one_or_several, whole
from busplan.questions.latency import figures as analysis
from busplan.questions.latency.figures import LatencyResult


class LatencyAnswer(Answer, LatencyResult):
    """Answer of `latency`: `transactions`, one for each payload, kind and timing model, with its `phases`."""

    __slots__ = ()

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.latency.report import latency_report

        return latency_report(self)

    def _headline(self) -> str:
        return f"{self.profile.name}: {self.network.bus.latency_subject(self.network)}"


def latency(
    profile: ProfileLike,
    *,
    payload_bytes: int | Iterable[int] | None = None,
    timing_model: Models | None = None,
) -> LatencyAnswer:
    """Show how long data takes to arrive, phase by phase, as `busplan latency` does.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    payload_bytes
        Payload of both read and write [bytes], or n of them; by default the profile's own.
    timing_model
        Name of a timing model, or several in this order; by default all of the kind of bus. IEEE 1394 has "paper" for
        the paper's equations as published, and "standard" for the standard's clock and packets.

    Returns
    -------
    LatencyAnswer
        Its `transactions`: on IEEE 1394 2 n for each timing model, a read and a write; on CAN one for each message.
        Times are in us.

    Raises
    ------
    BusplanError
        Not a profile, an invalid payload or one whose execution time is not known, or an unknown timing model.

    References
    ----------
    Paper, equations (3)-(10), (12)-(14).

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.latency("paper-two-node", payload_bytes=[4, 1024], timing_model="paper")
    >>> [(row.transaction, row.payload_bytes, round(row.phases["latency_us"], 2)) for row in answer.transactions]
    [('read', 4, 43.17), ('write', 4, 43.17), ('read', 1024, 474.57), ('write', 1024, 474.57)]
    """
    network = load_network(profile)
    sizes = None if payload_bytes is None else one_or_several(payload_bytes, name="payload_bytes")
    result = analysis.latency(
        network,
        payloads_bytes=sizes and [whole(size, name="payload_bytes") for size in sizes],
        timing_models=checked_models(timing_model, network),
    )
    return LatencyAnswer(*result)
