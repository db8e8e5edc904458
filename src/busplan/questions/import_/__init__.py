"""`busplan.import_profile`: a machine from the files that its engineers already have."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from busplan.buses.can.equations import USUAL_DATA_BIT_RATE
from busplan.errors import ArgumentError, BusplanError
from busplan.forms import blocks
from busplan.profile.document import decode, validate
from busplan.profile.edit import short_text
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import FilePath, finite, one_or_several
from busplan.questions.base.sentences import document
from busplan.questions.capacity import capacity
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.network import PERIOD, network_of
from busplan.questions.import_ import can, ethercat
from busplan.questions.import_.canopen import node_ids
from busplan.questions.import_.formats import read_machine
from busplan.questions.import_.reading import Fact, ProfileLine, Reading, merged, profile_text
from busplan.sections.profile import Profile

_FRAMES: Final = ("cycle_frames_us", "cycle_data_us")
_NONPERIODIC: Final = "cycle.nonperiodic_us"
_ROUNDING_US: Final = 1e-6
_ROWS: Final = {"ethercat": ethercat.rows, "can": can.rows}
"""Lines of the profile by kind of bus."""
_COLUMNS: Final = (
    *(blocks.TableColumn(heading, kind="words") for heading in ("key", "value", "grade", "file and line")),
    blocks.TableColumn("note", kind="words", rank=1, wraps=True),
)


@dataclass(frozen=True, slots=True, repr=False)
class ImportAnswer(Answer):
    """Answer of `import_profile`."""

    profile: Profile
    text: str
    """TOML of the profile; a comment has the grade, file and line of each value."""
    rows: tuple[ProfileLine, ...]
    """Values of the profile."""
    remarks: tuple[str, ...]
    """Sentences on what the files contradict or leave open."""
    card: tuple[str, ...]
    """Lines of the card of `capacity`."""

    def sentences(self) -> tuple[str, ...]:
        """Contradictions and gaps of the files, the card of `capacity`, and values that stay unknown."""
        return (*self.remarks, *self.card, *self._unknown())

    def report(self) -> blocks.Report:
        """The answer in blocks: the verdict, what stays unknown, and every value with its place."""
        facts = ((row, row.fact) for row in self.rows)
        records = [
            {"key": row.dotted, "value": row.plain, "grade": fact.grade, "place": fact.place, "note": fact.note}
            for row, fact in facts
        ]
        rows = (
            blocks.TableRow((blocks.Code(row.dotted), _shown(row.plain), row.fact.grade, row.fact.place, row.fact.note))
            for row in self.rows
        )
        verdict = " ".join(self.card[0].split())
        words = (blocks.Sentence((text,)) for text in (verdict, *self.remarks, *self._unknown()))
        return blocks.Report(
            blocks.sentence("{}, from files of the machine", blocks.Code(self.profile.name)),
            (*words, blocks.Table(_COLUMNS, tuple(rows))),
            document("import", name=self.profile.name, values=records, remarks=list(self.remarks)),
            records,
        )

    def _unknown(self) -> tuple[str, ...]:
        """Values that nobody has measured or configured. Groups share a line, and messages do."""
        unknown: dict[str, dict[str, None]] = {}
        for row in self.rows:
            if row.fact.grade == "assumed" and row.key not in ("grade", "kind", "master_grade", "period_grade"):
                first, *rest = row.section.split(".")
                section = ".".join((first, *(["*", *rest[1:]] if rest else [])))
                unknown.setdefault(f"{section}.{row.key}", {})[short_text(row.fact.value)] = None
        listed = ", ".join(f"{key} = {' or '.join(values)}" for key, values in unknown.items())
        return (f"Not known, so assumed: {listed}.",) if listed else ()


def _shown(value: object) -> blocks.ShownValue | str:
    return blocks.ShownValue(value) if isinstance(value, int | float) else short_text(value)


def import_profile(
    paths: FilePath | Iterable[FilePath],
    *,
    name: str | None = None,
    bus: str | None = None,
    channel: str | None = None,
    period_us: float | None = None,
    nodes: str | int | Iterable[int] | None = None,
    bit_rate_kbit_s: float | None = None,
    progress: Progress | None = None,
) -> ImportAnswer:
    """Make a profile of the files of one machine.

    Parameters
    ----------
    paths
        The files, each recognised by its content: ENI, text of `ethercat slaves -v` or `ethercat pdos`, LinuxCNC's
        ethercat-conf.xml, text of SOEM's slaveinfo, EDS, DCF, a log of the CAN bus (`candump -l`, or a capture of
        SocketCAN); with the extra `import` DBC, KCD, SYM, ARXML, and a log in ASC, BLF or TRC.
    name
        Name of the profile; by default that of the first file.
    bus
        Name of the bus in a database of several.
    channel
        Name of the channel in a log of several.
    period_us
        Period of every message without one in a file [us]. It is assumed, so the plan is not shown to fit.
    nodes
        Nodes that an EDS describes: their number, from node-ID 1 on, or their node-IDs, as text "8" or "1-8,11".
    bit_rate_kbit_s
        Bit rate of a CAN bus, instead of that of any file [kbit/s]; required for a log that does not show it.
    progress
        Function called with the bytes read of a log and the size of its file [bytes].

    Returns
    -------
    ImportAnswer
        The profile with its text, and what stays unknown.

    Raises
    ------
    BusplanError
        A file cannot be read or is of no known format, files are of different machines, no file has what a profile
        must have, or two files are logs.

    References
    ----------
    ETG.2100 (ENI), CiA 306 (EDS, DCF).

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.import_profile(["machine.xml", "slaves.txt"])  # doctest: +SKIP
    >>> busplan.capacity(answer.profile)  # doctest: +SKIP
    """
    names = [os.fspath(path) for path in one_or_several(paths, name="paths")]
    if not names or len(set(names)) < len(names):
        raise BusplanError(f"paths {names!r}: expected files of one machine, each once")
    none = progress or (lambda _done, _total: None)
    numbers = () if nodes is None else node_ids(nodes)
    readings = [read_machine(each, bus=bus, channel=channel, nodes=numbers, progress=none) for each in names]
    _require_files(readings, bus=bus, channel=channel, has_nodes=nodes is not None)
    can.settle(readings)
    machine = merged(readings)
    if period_us is not None:
        can.assume_periods(machine, finite(period_us, name="period_us"))
    if bit_rate_kbit_s is not None:
        if machine.kind != "can":
            raise BusplanError(f"bit rate {bit_rate_kbit_s:g}: only for a CAN bus; these files are of none")
        can.give_bit_rate(machine, finite(bit_rate_kbit_s, name="bit_rate_kbit_s"))
    title = name or ("machine" if names[0] == "-" else Path(names[0]).stem)
    rows = list(_ROWS[machine.kind](machine))
    text = profile_text(rows, name=title, readings=readings)
    profile = _validated(text, machine)
    if "frames" in machine.bus and (more := _time_beyond(profile, machine)):
        rows = [row for row in rows if row.dotted != _NONPERIODIC]
        at = next(number for number, row in enumerate(rows) if row.dotted == PERIOD) + 1
        rows.insert(at, more)
        text = profile_text(rows, name=title, readings=readings)
        profile = _validated(text, machine)
    if can.FULLEST in machine.bus:
        machine.remarks.append(_load_words(profile, machine.bus[can.FULLEST].value))
    card = str(capacity(profile)).partition("\n\n")[0].splitlines()
    return ImportAnswer(profile, text, tuple(rows), tuple(machine.remarks), tuple(card))


def _require_files(readings: Sequence[Reading], *, bus: str | None, channel: str | None, has_nodes: bool) -> None:
    """Raise BusplanError for options that apply to no file, and for two logs."""
    described = [reading.file for reading in readings if reading.nodes and reading.kind == "can"]
    if has_nodes and len(described) != 1:
        found = f"{described[0]} and {described[1]} are both" if described else "none of the files is"
        raise ArgumentError(f"nodes: {found} an EDS; --nodes needs exactly one")
    logs = [reading.file for reading in readings if reading.is_log]
    if channel is not None and not logs:
        raise ArgumentError(f"channel {channel}: none of the files is a CAN log")
    if bus is not None and not any(reading.is_database for reading in readings):
        raise ArgumentError(f"bus {bus}: none of the files is a database of messages")
    if len(logs) > 1:
        raise BusplanError(f"{logs[0]} and {logs[1]} are both logs; give the longer one")


def _load_words(profile: Profile, fullest: can.MostLoad) -> str:
    """Words on the load of the plan beside that of the log."""
    bus: Any = profile.bus
    cycle: Any = deciding_cycle(network_of(profile))
    planned = float(cycle.load)
    recorded = fullest.load(bus.bit_rate_kbit_s, bus.data_bit_rate_kbit_s or USUAL_DATA_BIT_RATE)
    words = (
        f"The plan has a load of {100 * planned:.3g} %, the fullest second of the log {100 * recorded:.3g} %, both "
        f"with the most stuff bits; {fullest.seconds:,} of its {fullest.of_seconds:,} s have frames"
    )
    if planned > can.MOST_OF_FULLEST * recorded:
        words += ". The plan is higher because it lets messages coincide that the log has at different times"
    return words


def _validated(text: str, machine: Reading) -> Profile:
    try:
        return validate(decode(text.encode(), name=machine.file))
    except BusplanError as error:
        problems = (problem.partition(": ")[2] for problem in error.problems)
        raise BusplanError(*(f"{machine.file}: as a profile: {problem}" for problem in problems)) from None


def _time_beyond(profile: Profile, machine: Reading) -> ProfileLine | None:
    """Excess of the frames of a file over those of the profile, as a line [us]; None without excess."""
    frames = machine.bus["frames"]
    file_us = sum(map(ethercat.frame_us, frames.value))
    terms = deciding_cycle(network_of(profile)).terms
    planned_us = sum(float(term.us) for term in terms if term.key in _FRAMES)
    subject = "its frame takes" if len(frames.value) == 1 else f"its {len(frames.value)} frames take"
    words = f"{machine.file}: {subject} {file_us:.2f} us on the wire"
    if file_us < planned_us - _ROUNDING_US:
        machine.remarks.append(f"{words}, the profile's frames {planned_us:.2f} us")
        return None
    machine.remarks.append(f"{words}, as the profile has")
    if file_us < planned_us + _ROUNDING_US:
        return None
    notes = [ethercat.SLOWER] if "slower" in machine.bus else []
    notes.append(f"time by which {len(frames.value)} frames are longer than the model's")
    us = round(profile.cycle.nonperiodic_us + file_us - planned_us, 6)
    return ProfileLine("cycle", "nonperiodic_us", Fact(us, frames.place, note="; ".join(notes)))
