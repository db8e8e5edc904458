"""`busplan.measured`."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath

from busplan.buses.rule import RecordedFigure
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Path, ProfileLike, finite, load_profile
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.profile import Profile

_LEAST_QUANTILE = 0.5


@dataclass(frozen=True, slots=True, repr=False)
class MeasuredAnswer(Answer):
    """Answer of `measured`.

    Parameters
    ----------
    profile
        The plan.
    source
        Name of the recording.
    quantile
        Share of the events that worst cases hold for, 0.5..1.
    figures
        Every figure planned beside the recorded one.
    remarks
        Sentences on what the recording has beside that, and what it does not show.
    edits
        New value of each key that was measured, as `--apply` writes them; None removes a key.
    day
        Day of the recording in UTC, as 2026-11-23; empty where its stamps do not say it.
    shows_nothing
        Why the recording as a whole shows no machine within its plan; empty where it can.
    """

    profile: Profile
    source: str
    quantile: float
    figures: tuple[RecordedFigure, ...]
    remarks: tuple[str, ...]
    edits: Mapping[str, object]
    day: str
    shows_nothing: tuple[str, ...]

    @property
    def outside(self) -> tuple[RecordedFigure, ...]:
        """Figures that lie outside their plan, by more than their doubt at 99.9 %."""
        return tuple(figure for figure in self.figures if figure.verdict == "outside")

    @property
    def notes(self) -> dict[str, str]:
        """The comment that `--apply` writes above each section: how, how many, from which file, of which day."""
        from busplan.questions.measured.report import provenance

        sections = dict.fromkeys(key.rpartition(".")[0] for key in self.edits)
        return {section: provenance(self, section) for section in sections}

    def report(self, *, applied_to: str | None = None) -> Report:
        """The answer in blocks.

        Parameters
        ----------
        applied_to
            The profile's file that measured values were written into; by default none.
        """
        from busplan.questions.measured.report import measured_report

        return measured_report(self, applied_to=applied_to)


def measured(
    profile: ProfileLike, recording: Path, *, quantile: float = 1.0, progress: Progress | None = None
) -> MeasuredAnswer:
    """Show what a machine does by a recording of its bus, beside what was planned.

    Parameters
    ----------
    profile
        The plan: a `Profile`, a path or a shipped name. It is not changed.
    recording
        A file of the profile's kind of bus. EtherCAT: a capture of the master's port, pcap or pcapng. CAN: a log of
        `candump -l`, ASC, BLF or TRC (with the extra `import`).
    quantile
        Share of the events that jitter and times are to hold for, 0.5..1; 1 is the worst one recorded.
    progress
        Called with the bytes read and those of the file.

    Returns
    -------
    MeasuredAnswer
        Its `figures`, in their `unit`; those `outside` the plan; and `edits`, the keys that were measured.

    Raises
    ------
    BusplanError
        Not a profile, a quantile outside its range, or no recording that can be compared with the profile.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.measured("machine.toml", "capture.pcapng", quantile=0.999)  # doctest: +SKIP
    >>> [figure.quantity for figure in answer.outside]  # doctest: +SKIP
    """
    network = load_profile(profile)
    share = finite(quantile, name="quantile")
    if not _LEAST_QUANTILE <= share <= 1:
        raise BusplanError(f"quantile {share:g}: expected a share of {_LEAST_QUANTILE:g} to 1, as 0.999")
    if not isinstance(recording, str | os.PathLike):
        raise BusplanError(f"recording {recording!r}: expected the path of a file")
    source = os.fspath(recording)
    if source == "-" or "\0" in source:
        raise BusplanError(f"{source}: a recording is read from a file")
    seen = bus_of(network).recorded(
        network_of(network), FilePath(source), share=share, progress=progress or (lambda _done, _total: None)
    )
    return MeasuredAnswer(network, source, share, *seen)
