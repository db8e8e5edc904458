"""`busplan.import_profile`: a machine from the files that its engineers already have."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.profile.document import decode, validate
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Path, one_or_several
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.network import PERIOD, network_of
from busplan.questions.import_ import can, ethercat
from busplan.questions.import_.reading import Fact, ProfileLine, Reading, machines, merged, profile_text, stem_of
from busplan.sections.base import with_unchecked
from busplan.sections.profile import Profile

_FRAMES: Final = ("cycle_frames_us", "cycle_data_us")
_NONPERIODIC: Final = "cycle.nonperiodic_us"
_ROUNDING_US: Final = 1e-6


@dataclass(frozen=True, slots=True, repr=False)
class ImportAnswer(Answer):
    """Answer of `import_profile`.

    Parameters
    ----------
    profile
        The profile.
    text
        Its TOML: each value has its grade, file and line in a comment.
    rows
        Its values.
    remarks
        Sentences on what the files say otherwise, or leave open.
    """

    profile: Profile
    text: str
    rows: tuple[ProfileLine, ...]
    remarks: tuple[str, ...]

    def sentences(self) -> tuple[str, ...]:
        """What files say otherwise or leave open, the verdict, and what stays unknown."""
        from busplan.questions.import_.report import sentences

        return tuple(sentences(self))

    def report(self) -> Report:
        """The answer in blocks: the verdict, what stays unknown, and every value with its place."""
        from busplan.questions.import_.report import import_report

        return import_report(self)


def import_profile(
    paths: Path | Iterable[Path],
    *,
    name: str | None = None,
    progress: Progress | None = None,
) -> ImportAnswer:
    """Make a profile of the files of one machine.

    Parameters
    ----------
    paths
        The files, each recognised by its content: ENI, text of `ethercat slaves -v` or `ethercat pdos`, LinuxCNC's
        ethercat-conf.xml, text of SOEM's slaveinfo, EDS, DCF; with the extra `import` DBC, KCD, SYM, ARXML, and a log
        of the CAN bus: `candump -l`, ASC, BLF, TRC.
    name
        Name of the profile; by default that of the first file.
    progress
        Called with the bytes read of a log and those of the file.

    Returns
    -------
    ImportAnswer
        The profile with its text, and what stays unknown.

    Raises
    ------
    BusplanError
        A file cannot be read or is of no known format, files are of different machines, what a profile must have is in
        none of them, or two files are logs.

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
    readings = machines(names, progress=progress or (lambda _done, _total: None))
    logs = [reading.file for reading in readings if reading.is_log]
    if len(logs) > 1:
        raise BusplanError(f"{logs[0]} and {logs[1]} are both logs; give the longer one")
    can.settled(readings)
    machine = merged(readings)
    files = [(reading.file, reading.title) for reading in readings]
    rows = list(_ROWS[machine.kind](machine))
    profile = _validated(profile_text(rows, name=name or stem_of(names), files=files), machine)
    if "frames" in machine.bus:
        rows, profile = _with_time_of_frames(rows, profile, machine)
    text = profile_text(rows, name=name or stem_of(names), files=files)
    return ImportAnswer(profile, text, tuple(rows), tuple(machine.remarks))


_ROWS: Mapping[str, Callable[[Reading], Iterator[ProfileLine]]] = {"ethercat": ethercat.rows, "can": can.rows}
"""Writer of the profile, by kind of bus."""


def _validated(text: str, machine: Reading) -> Profile:
    try:
        return validate(decode(text.encode(), name=machine.file))
    except BusplanError as error:
        problems = (problem.partition(": ")[2] for problem in error.problems)
        raise BusplanError(*(f"{machine.file}: as a profile: {problem}" for problem in problems)) from None


def _with_time_of_frames(
    rows: list[ProfileLine], profile: Profile, machine: Reading
) -> tuple[list[ProfileLine], Profile]:
    """Count the time that the frames of a file take beyond those of the profile."""
    fact = machine.bus["frames"]
    file_us = sum(map(ethercat.frame_us, fact.value))
    run = deciding_cycle(network_of(profile))
    planned_us = sum(float(plain(term.us)) for term in run.terms if term.key in _FRAMES)
    frames = "its frame takes" if len(fact.value) == 1 else f"its {len(fact.value)} frames take"
    said = f"{machine.file}: {frames} {file_us:.2f} us on the wire"
    if file_us < planned_us - _ROUNDING_US:
        machine.remarks.append(f"{said}, those of the profile {planned_us:.2f} us")
        return rows, profile
    machine.remarks.append(f"{said}, as those of the profile")
    if file_us < planned_us + _ROUNDING_US:
        return rows, profile
    before_us = profile.cycle.nonperiodic_us
    more_us = round(before_us + file_us - planned_us, 6)
    old = next((row.fact.note for row in rows if row.dotted == _NONPERIODIC), "")
    note = "; ".join(filter(None, (old, f"{len(fact.value)} frames take so much more than those of the model")))
    rows = [row for row in rows if row.dotted != _NONPERIODIC]
    at = next(number for number, row in enumerate(rows) if row.dotted == PERIOD) + 1
    rows.insert(at, ProfileLine("cycle", "nonperiodic_us", Fact(more_us, fact.place, note=note)))
    return rows, with_unchecked(profile, _NONPERIODIC, more_us)
