"""`busplan.measured`: a recording compared with the plan, and the report."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Final

from busplan.buses.rule import RecordedFigure, RecordedVerdict
from busplan.english import plural
from busplan.errors import ArgumentError
from busplan.forms import blocks
from busplan.profile.edit import value_text
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    FilePath,
    ProfileLike,
    finite,
    load_profile,
    recording_name,
    with_its_constants,
)
from busplan.questions.base.sentences import document, with_profile
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.profile import Profile

_COLUMNS: Final = (
    blocks.TableColumn("figure", kind="words", wraps=True),
    blocks.TableColumn("unit", kind="words"),
    blocks.TableColumn("planned"),
    blocks.TableColumn("recorded"),
    blocks.TableColumn("residual", rank=1),
    blocks.TableColumn("U"),
    blocks.TableColumn("within", kind="words"),
    blocks.TableColumn("n", rank=2),
    blocks.TableColumn("note", kind="words", rank=3, leaves="below", wraps=True),
)
_DECIMALS: Final = {"us": 3, "1": 0, "bytes": 0, "share": 2, "kbit/s": 1}
_UNITS: Final = {"1": "", "share": "%"}
"""Units that are shown in another way."""
_WITHIN: Final[dict[RecordedVerdict | None, blocks.Cell]] = {
    None: "",
    "within": blocks.Words("yes", "passes"),
    "not shown": blocks.Words("not shown", "warns"),
    "outside": blocks.Words("no", "fails"),
}
_SMALL_US: Final = 1.0
"""Time below which more decimals are shown [us]."""
_LEAST_QUANTILE = 0.5


@dataclass(frozen=True, slots=True, repr=False)
class MeasuredAnswer(Answer):
    """Answer of `measured`."""

    profile: Profile
    source: str
    """Name of the recording."""
    quantile: float
    """Quantile of the events for worst cases, 0.5..1 [1]."""
    figures: tuple[RecordedFigure, ...]
    """Figures, planned and recorded."""
    remarks: tuple[str, ...]
    """Sentences on other contents of the recording, and on what it does not show."""
    edits: Mapping[str, object]
    """New value of each measured key, as `--apply` writes it; None removes a key."""
    day: str
    """Day of the recording in UTC, such as 2026-11-23; empty if its stamps do not tell it."""
    shows_nothing: tuple[str, ...]
    """Reasons why the recording as a whole cannot show that the machine keeps its plan; empty if it can."""

    @property
    def outside(self) -> tuple[RecordedFigure, ...]:
        """Figures outside their plan, by more than a 99.9 % uncertainty."""
        return tuple(figure for figure in self.figures if figure.verdict == "outside")

    @property
    def notes(self) -> dict[str, str]:
        """Comments that `--apply` writes above the sections: quantile, number of events, file and day."""
        return {section: self._origin(section) for section in {key.rpartition(".")[0]: None for key in self.edits}}

    def _origin(self, section: str) -> str:
        """Origin of the measured values of a section, as a one-line comment for the profile."""
        figures = [figure for figure in self.figures if figure.key.startswith(f"{section}.")] or self.figures
        if all(figure.is_mean for figure in figures):
            share = "the mean"
        else:
            share = "the worst" if self.quantile == 1 else f"{100 * self.quantile:g} %"
        count = plural(max(figure.events for figure in figures), "event")
        day = f" of {self.day}" if self.day else ""
        return f"busplan measured: {share} of {count} in {PurePath(self.source).name}{day}"

    def report(self, *, applied_to: str | None = None) -> blocks.Report:
        """The answer in blocks.

        Parameters
        ----------
        applied_to
            File of the profile into which measured values were written; by default none.
        """
        records = [_record(figure) for figure in self.figures]
        return blocks.Report(
            blocks.Sentence((blocks.Code(self.profile.name), " beside the recording ", blocks.Code(self.source))),
            tuple(_blocks(self)),
            _document(self, records, applied_to=applied_to),
            with_profile(self.profile.name, records),
        )


@with_its_constants
def measured(
    profile: ProfileLike,
    recording: FilePath,
    *,
    quantile: float = 1.0,
    channel: str | None = None,
    progress: Progress | None = None,
) -> MeasuredAnswer:
    """Compare a recording of a machine's bus with the plan.

    Parameters
    ----------
    profile
        The plan: a `Profile`, a path or a shipped name. It is not changed.
    recording
        A file of the profile's kind of bus. EtherCAT: a capture of the master's port, pcap or pcapng. CAN: a log of
        `candump -l`, a capture of SocketCAN or, with the extra `import`, ASC, BLF or TRC.
    quantile
        Quantile of the events for jitter and times, 0.5..1; 1 is the worst one recorded.
    channel
        Name of the channel in a log of several.
    progress
        Function called with the bytes read and the size of the file [bytes].

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
    plan = load_profile(profile)
    share = finite(quantile, name="quantile")
    if not _LEAST_QUANTILE <= share <= 1:
        raise ArgumentError(f"quantile {share:g}: expected a share of {_LEAST_QUANTILE:g} to 1, as 0.999")
    source = recording_name(recording)
    recorded = bus_of(plan).recorded(
        network_of(plan),
        Path(source),
        share=share,
        channel=channel,
        progress=progress or (lambda _done, _total: None),
    )
    return MeasuredAnswer(plan, source, share, *recorded)


def _blocks(answer: MeasuredAnswer) -> Iterator[blocks.Block]:
    counts = Counter(figure.verdict for figure in answer.figures if figure.verdict)
    state: blocks.State = "fails" if counts["outside"] else "warns" if answer.shows_nothing else "passes"
    inside = f"{counts['within']} of {plural(counts.total(), 'figure')} within the plan"
    share = (
        "the worst recorded" if answer.quantile == 1 else (f"those that {100 * answer.quantile:g} % of the events keep")
    )
    yield blocks.Sentence(
        (
            blocks.Code(answer.profile.name),
            " beside ",
            blocks.Code(answer.source),
            ": ",
            blocks.Words(inside, state),
            f"{_named(answer, 'outside')}{_named(answer, 'not shown')}. Jitter and times are {share}.",
        )
    )
    yield from (
        blocks.Sentence((blocks.Words("Shows nothing", "warns"), f": {reason}.")) for reason in answer.shows_nothing
    )
    yield blocks.Table(_COLUMNS, tuple(map(_row, answer.figures)), stacks=True)
    yield from (blocks.Sentence((remark,)) for remark in answer.remarks)
    values = [f"{key} = {value_text(value)}" for key, value in answer.edits.items() if value is not None]
    if values:
        yield blocks.Sentence(("Measured (--apply writes it into the profile):",))
        yield blocks.Snippet(tuple(values))


def _named(answer: MeasuredAnswer, verdict: RecordedVerdict) -> str:
    names = [figure.quantity for figure in answer.figures if figure.verdict == verdict]
    return f"; {verdict}: {', '.join(names)}" if names else ""


def _row(figure: RecordedFigure) -> blocks.TableRow:
    shown = (_value(figure, name) for name in ("planned", "recorded", "residual", "uncertainty"))
    unit = _UNITS.get(figure.unit, figure.unit)
    moments = (figure.first_words, figure.worst_words) if figure.verdict in ("outside", "not shown") else ()
    note = ", ".join(filter(None, (figure.hidden, figure.note, *moments)))
    cells = (figure.quantity, unit, *shown, _WITHIN[figure.verdict], blocks.ShownValue(figure.events, "events"), note)
    is_as_planned = figure.verdict == "within" and figure.recorded == figure.planned and not figure.uncertainty
    return blocks.TableRow(cells, is_detail=is_as_planned)


def _value(figure: RecordedFigure, name: str) -> blocks.ShownValue:
    value = getattr(figure, name)
    decimals = _DECIMALS[figure.unit]
    if figure.unit == "us" and max(map(abs, filter(None, (figure.planned, figure.recorded))), default=1) < _SMALL_US:
        decimals = 5
    return blocks.ShownValue(
        value, name, _UNITS.get(figure.unit, figure.unit), decimals, signed=name == "residual", fixed=True
    )


def _record(figure: RecordedFigure) -> blocks.Record:
    fields = figure._asdict()
    del fields["is_mean"]
    texts = {name: fields.pop(name) or None for name in ("key", "note", "hidden")}
    return {**fields, "residual": figure.residual, "verdict": figure.verdict, **texts}


def _document(answer: MeasuredAnswer, records: list[blocks.Record], *, applied_to: str | None) -> blocks.JsonDocument:
    return document(
        "measured",
        profile=answer.profile.name,
        source=answer.source,
        day=answer.day or None,
        quantile=answer.quantile,
        figures=records,
        outside=[figure.quantity for figure in answer.outside],
        shows_nothing=list(answer.shows_nothing),
        remarks=list(answer.remarks),
        measured=dict(answer.edits),
        applied_to=applied_to,
    )
