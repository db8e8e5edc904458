"""`busplan.recorded`: what a recording has, without a plan."""

from dataclasses import dataclass
from pathlib import Path

from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import Report
from busplan.progress import Progress, ignored
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import FilePath, finite, recording_name
from busplan.questions.recorded.contents import (
    LogContents,
    RecordedEmergency,
    RecordedIdentifier,
    log_contents,
)

__all__ = ["LogContents", "RecordedAnswer", "RecordedEmergency", "RecordedIdentifier", "recorded"]


@dataclass(frozen=True, slots=True, repr=False)
class RecordedAnswer(Answer):
    """Answer of `recorded`."""

    source: str
    """Name of the recording."""
    contents: LogContents
    """What it has."""

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.recorded.report import report  # only where an answer is shown

        return report(self.source, self.contents)


def recorded(
    recording: FilePath,
    *,
    bit_rate_kbit_s: float | None = None,
    data_bit_rate_kbit_s: float | None = None,
    channel: str | None = None,
    progress: Progress | None = None,
) -> RecordedAnswer:
    """Say what a log of a CAN bus has, without a plan. `busplan measured FILE`.

    Parameters
    ----------
    recording
        A log of `candump -l`, a capture of SocketCAN or, with the extra `import`, ASC, BLF or TRC.
    bit_rate_kbit_s
        Bit rate of the bus [kbit/s]; None for that of frames back to back, if the log shows it.
    data_bit_rate_kbit_s
        Bit rate of the data of CAN FD [kbit/s]; None to assume one.
    channel
        Name of the channel in a log of several.
    progress
        Function called with the bytes read and the size of the file [bytes].

    Returns
    -------
    RecordedAnswer
        Its `contents` have the `identifiers`, the `load`, the `largest_gap_us`, `emergencies` and more.

    Raises
    ------
    BusplanError
        No log of a CAN bus, a bit rate at which its frames would overlap, or a missing extra.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.recorded("candump.log")  # doctest: +SKIP
    >>> [(row.identifier, row.comes, row.period_us) for row in answer.contents.identifiers]  # doctest: +SKIP
    """
    source = recording_name(recording)
    rates = [_rate(bit_rate_kbit_s, "bit_rate_kbit_s"), _rate(data_bit_rate_kbit_s, "data_bit_rate_kbit_s")]
    try:
        contents = log_contents(
            Path(source),
            bit_rate_kbit_s=rates[0],
            data_bit_rate_kbit_s=rates[1],
            channel=channel,
            progress=progress or ignored,
        )
    except BusplanError as error:
        if not Path(source).suffix.startswith(".pcap"):
            raise
        words = f"a capture of EtherCAT needs its profile beside it: busplan measured PROFILE {source}"
        raise BusplanError(f"{error}; {words}") from None
    return RecordedAnswer(source, contents)


def _rate(value: float | None, name: str) -> float | None:
    if value is None:
        return None
    rate = finite(value, name=name)
    if rate <= 0:
        raise ArgumentError(f"{name} {rate:g}: expected a bit rate above zero, in kbit/s")
    return rate
