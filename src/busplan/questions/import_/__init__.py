"""`busplan.import_profile`: a machine from the files that its engineers already have."""

import os
import pathlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.profile.toml import decode, validate
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Path, one_or_several
from busplan.questions.import_ import can, ethercat
from busplan.questions.import_.record import Fact, Reading, merged
from busplan.questions.import_.sources import machines, stem_of
from busplan.questions.import_.text import ProfileLine, profile_text
from busplan.questions.import_.update import updated
from busplan.sections.profile import Profile

_FRAMES = ("cycle_frames_us", "cycle_data_us")
_ROUNDING_US = 1e-6


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
    update: Path | None = None,
    take: Literal["file", "profile"] | None = None,
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
    update
        A profile that new values go into; its comments stay. The file is not changed: write `text` into it.
    take
        Whose value to take where files and that profile differ: "file" or "profile".
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
        none of them, files and profile differ and nothing says which to take, two files are logs, or a log is to go
        into a profile.

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
    if take not in (None, "file", "profile"):
        raise BusplanError(f"take {take!r}: expected 'file' or 'profile'")
    readings = machines(names, progress=progress or (lambda _done, _total: None))
    _require_one_log([reading.file for reading in readings if reading.is_log], update=update)
    can.settled(readings)
    machine = merged(readings)
    files = [(reading.file, reading.title) for reading in readings]
    if update is None:
        return _new(machine, name=name or stem_of(names), files=files)
    return _updated(machine, update=update, take=take)


def _require_one_log(logs: list[str], *, update: Path | None) -> None:
    if len(logs) > 1:
        raise BusplanError(f"{logs[0]} and {logs[1]} are both logs; give the longer one")
    if logs and update is not None:
        raise BusplanError(
            f"{logs[0]} is a log: `busplan measured {os.fspath(update)} {logs[0]} --apply` writes what it shows into a "
            "profile"
        )


_ROWS: Mapping[str, Callable[[Reading], Iterator[ProfileLine]]] = {"ethercat": ethercat.rows, "can": can.rows}
"""Writer of the profile, by kind of bus."""


def _updated(machine: Reading, *, update: Path, take: Literal["file", "profile"] | None) -> ImportAnswer:
    is_part = machine.kind == "can" and not machine.nodes
    rows = list(can.part_rows(machine) if is_part else _ROWS[machine.kind](machine))
    name = os.fspath(update)
    profile, text = updated(machine, rows, path=pathlib.Path(update).absolute(), name=name, take=take)
    # Values assumed for a new profile: an existing one sets them, or leaves them to their defaults.
    said = tuple(row for row in rows if row.fact.grade != "assumed")
    return ImportAnswer(profile, text, said, tuple(machine.remarks))


def _new(machine: Reading, *, name: str, files: list[tuple[str, str]]) -> ImportAnswer:
    rows = list(_ROWS[machine.kind](machine))
    text = profile_text(rows, name=name, files=files)
    profile = _validated(text, machine)
    if "frames" in machine.bus:
        rows = _with_exact_frames(rows, profile, machine)
        text = profile_text(rows, name=name, files=files)
        profile = _validated(text, machine)
    return ImportAnswer(profile, text, tuple(rows), tuple(machine.remarks))


def _validated(text: str, machine: Reading) -> Profile:
    try:
        return validate(decode(text.encode(), name=machine.file))
    except BusplanError as error:
        problems = (problem.partition(": ")[2] for problem in error.problems)
        raise BusplanError(*(f"{machine.file}: as a profile: {problem}" for problem in problems)) from None


def _with_exact_frames(rows: list[ProfileLine], profile: Profile, machine: Reading) -> list[ProfileLine]:
    """Rows with the time that the frames of a file take beyond those of the profile."""
    from busplan.questions.capacity import capacity

    fact = machine.bus["frames"]
    file_us = sum(map(ethercat.frame_us, fact.value))
    terms: Mapping[str, Any] = {term.key: term.us for term in capacity(profile).verdicts[0].deciding.terms}
    own_us = sum(terms[key] for key in _FRAMES)
    more_us = file_us - own_us
    frames = "its frame takes" if len(fact.value) == 1 else f"its {len(fact.value)} frames take"
    said = f"{machine.file}: {frames} {file_us:.2f} us on the wire"
    if more_us < -_ROUNDING_US:
        machine.remarks.append(f"{said}, those of the profile {own_us:.2f} us")
        return rows
    machine.remarks.append(f"{said}, as those of the profile")
    if more_us < _ROUNDING_US:
        return rows
    note = f"{len(fact.value)} frames take so much more than those of the model"
    at = next(number for number, row in enumerate(rows) if row.key == "period_us") + 1
    if rows[at].key == "nonperiodic_us":
        old = rows.pop(at).fact
        note, more_us = f"{old.note}; {note}", more_us + old.value
    row = ProfileLine("cycle", "nonperiodic_us", Fact(round(more_us, 6), fact.place, note=note))
    return [*rows[:at], row, *rows[at:]]
