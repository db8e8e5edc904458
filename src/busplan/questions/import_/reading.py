"""Reading files of machines: text, XML, and the record that every reader fills."""

import os
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from itertools import groupby
from pathlib import Path, PurePath
from typing import Any, Final, NamedTuple, TypeAlias
from xml.parsers import expat

from busplan.english import printable
from busplan.errors import BusplanError
from busplan.profile.document import MAX_FILE_BYTES, read_bytes
from busplan.profile.edit import short_text, value_text, whole
from busplan.progress import Progress
from busplan.sourced import Grade

_MOST_DEPTH: Final = 64
_MOST_ELEMENTS: Final = 1_000_000
_CHUNK_BYTES: Final = 4096
_FAR: Final = 300
"""Columns that a person counts; some tools write all in one line."""


@dataclass(slots=True)
class Element:
    """An element of an XML file."""

    tag: str
    """Without its namespace."""
    line: int | str
    """Its line, with the column if the line is long."""
    attributes: dict[str, str]
    children: list["Element"] = field(default_factory=list)
    text: str = ""
    """Behind its last child."""

    def all(self, path: str) -> Iterator["Element"]:
        """Elements of a path of tags below this one, as "Config/Slave"."""
        tag, _, rest = path.partition("/")
        for child in self.children:
            if child.tag == tag:
                yield from child.all(rest) if rest else (child,)

    def first(self, path: str) -> "Element | None":
        """The first element of a path; None if there is none."""
        return next(self.all(path), None)


def parsed(content: bytes, *, name: str, skipped: Collection[str] = ()) -> Element:
    """Read an XML file.

    Parameters
    ----------
    content
        The file.
    name
        Its name in messages.
    skipped
        Tags whose elements are left out, with all below them.

    Raises
    ------
    BusplanError
        It is no XML, or has a document type (which is where entities are declared), too many elements, or too many
        inside each other; with its line.
    """
    reader = _Reader(name, frozenset(skipped))
    reader.read(content)
    return next(iter(reader.root.children), reader.root)


def root_tag(content: bytes, *, name: str) -> str:
    """Tag of the root element of an XML file, without reading the rest.

    Raises
    ------
    BusplanError
        As `parsed`.
    """
    reader = _Reader(name, frozenset())
    for start in range(0, len(content), _CHUNK_BYTES):
        reader.read(content[start : start + _CHUNK_BYTES], is_last=start + _CHUNK_BYTES >= len(content))
        if reader.root.children:
            break
    return reader.root.children[0].tag


class _Reader:
    def __init__(self, name: str, skipped: frozenset[str]) -> None:
        self.name, self.skipped = name, skipped
        self.root = Element("", 0, {})
        self.open = [self.root]
        self.texts: list[str] = []
        self.depth = self.elements = self.skips = 0
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text

    def read(self, content: bytes, *, is_last: bool = True) -> None:
        """Read the file, or the next part of it."""
        try:
            self.parser.Parse(content, is_last)
        except expat.ExpatError as error:
            what = expat.ErrorString(error.code)
            raise BusplanError(f"{self.name}:{error.lineno}:{error.offset + 1}: not valid XML: {what}") from None
        except (ValueError, LookupError) as error:  # an encoding that Python does not know
            raise BusplanError(f"{self.name}:1: not valid XML: {error}") from None

    def _refuse(self, message: str) -> BusplanError:
        return BusplanError(f"{self.name}:{self.parser.CurrentLineNumber}: {message}")

    def _doctype(self, *_: Any) -> None:
        raise self._refuse("a document type (<!DOCTYPE>) is not read: it can declare entities; remove it")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self.depth += 1
        self.elements += 1
        if self.depth > _MOST_DEPTH:
            raise self._refuse(f"elements inside each other more than {_MOST_DEPTH} deep; no such file is a machine's")
        if self.elements > _MOST_ELEMENTS:
            raise self._refuse(f"more than {_MOST_ELEMENTS:,} elements; no such file is a machine's")
        tag = tag.rpartition(":")[2]
        if self.skips or tag in self.skipped:
            self.skips += 1
            return
        line, column = self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber
        element = Element(tag, f"{line}:{column + 1}" if column > _FAR else line, attributes)
        self.open[-1].children.append(element)
        self.texts.clear()
        self.open.append(element)

    def _end(self, _tag: str) -> None:
        self.depth -= 1
        if self.skips:
            self.skips -= 1
        else:
            self.open.pop().text = "".join(self.texts)
            self.texts.clear()

    def _text(self, text: str) -> None:
        if not self.skips:
            self.texts.append(text)


_MAY_DIFFER: Final = ("name", "master", "clock_us")
"""Facts that may differ from file to file."""


Line: TypeAlias = int | str
"""Number of a line, with ":" and the column where the file has long lines."""


class Fact(NamedTuple):
    """A value of a machine, how well it is known, and where it stands."""

    value: Any
    place: str = ""
    """File and line; empty for what no file says."""
    grade: Grade = "published"
    note: str = ""

    @property
    def comment(self) -> str:
        """Grade, note and place, as the comment of a profile's line; empty where there is nothing to say."""
        rest = ", ".join(filter(None, (self.note, self.place)))
        return printable(f"{self.grade}: {rest}") if rest else ""


Facts = dict[str, Fact]


@dataclass
class Reading:
    """Facts of a machine from one file, or from several together.

    Parameters
    ----------
    kind
        Kind of bus.
    title
        The format, as messages name it.
    file
        Name of the file.
    rank
        Where files say different values, that of the smallest rank counts.
    """

    kind: str
    title: str
    file: str
    rank: int
    bus: Facts = field(default_factory=dict)
    """The bus, its master and its cycle."""
    nodes: dict[int, Facts] = field(default_factory=dict)
    """Devices by their place in the segment, from 0; CANopen nodes by their node-ID."""
    messages: dict[int, Facts] = field(default_factory=dict)
    """Messages of a CAN bus by their identifier."""
    lists_all: bool = True
    """Whether the file lists all devices of the machine."""
    is_log: bool = False
    """Whether the file is a recording of the bus."""
    remarks: list[str] = field(default_factory=list)
    """Sentences on what the file says and a profile cannot, or what the file leaves open."""

    def place(self, line: Line) -> str:
        """File and line, for comments."""
        return f"{PurePath(self.file).name}:{line}"

    def refusal(self, line: Line, message: str) -> BusplanError:
        """Make the error for something wrong in the file."""
        return BusplanError(f"{self.file}:{line}: {message}")


def merged(machines: Iterable[Reading]) -> Reading:
    """One record of several files of one machine; where they differ, it says so.

    Raises
    ------
    BusplanError
        They are of two kinds of bus, or have not the same devices.
    """
    first, *others = sorted(machines, key=lambda machine: machine.rank)
    whole = Reading(first.kind, first.title, first.file, first.rank)
    differences: dict[str, list[str]] = {}
    for machine in (first, *others):
        if machine.kind != whole.kind:
            raise BusplanError(
                f"{first.file} is of {whole.kind} and {machine.file} of {machine.kind}: a profile is one bus; give the "
                "files of one"
            )
        _add(whole.bus, machine.bus, "", differences)
        if whole.kind == "can" and (same := whole.nodes.keys() & machine.nodes.keys()):
            raise BusplanError(
                f"{first.file} and {machine.file} are both node {min(same)}; an EDS has no node-ID, give the DCF of "
                "each"
            )
        for whose, of_whole, new in (
            ("node", whole.nodes, machine.nodes),
            ("message", whole.messages, machine.messages),
        ):
            for number, facts in new.items():
                _add(of_whole.setdefault(number, {}), facts, f"{whose} {number}: ", differences)
        whole.remarks += machine.remarks
    if whole.kind == "ethercat":
        _require_one_machine([first, *others])
    for said, *more in differences.values():
        whole.remarks.append(f"{said}; the first is taken{f', in {len(more)} more places, too' if more else ''}")
    return whole


def _require_one_machine(machines: Sequence[Reading]) -> None:
    """Refuse files of different devices; one that needs not list all may have fewer."""
    complete = max(machines, key=lambda machine: (machine.lists_all, len(machine.nodes)))
    for machine in machines:
        unlisted = machine.nodes.keys() - complete.nodes.keys()
        if unlisted or (machine.lists_all and machine.nodes.keys() != complete.nodes.keys()):
            raise BusplanError(
                f"{complete.file} has {len(complete.nodes)} devices and {machine.file} {len(machine.nodes)}: these are "
                "two machines, or one was changed; export both anew"
            )
    missing = [number for number in range(max(complete.nodes, default=0)) if number not in complete.nodes]
    if missing:
        raise BusplanError(
            f"{complete.file}: no device {missing[0]}, though there is device {max(complete.nodes)}; those that it "
            "leaves out delay frames, too: give the text of `ethercat slaves -v` beside it"
        )


def _add(own: Facts, new: Mapping[str, Fact], whose: str, differences: dict[str, list[str]]) -> None:
    for key, fact in new.items():
        known = own.setdefault(key, fact)
        if known.grade == "assumed" != fact.grade:
            own[key] = fact
        elif known.value != fact.value and fact.grade != "assumed" and key not in _MAY_DIFFER:
            values = (f"{short_text(stated.value)} at {stated.place}" for stated in (known, fact))
            differences.setdefault(key, []).append(f"{whose}{key} is {' and '.join(values)}")


_COMMENTS_AT: Final = 27
_LONGEST_NAME: Final = 32
_LONGEST_PROFILE_NAME: Final = 100
_UNITS: Final = {"us": 1.0, "ms": 1000.0}


class ProfileLine(NamedTuple):
    """A line of a profile."""

    section: str
    """bus, cycle, group.NAME, group.NAME.execution or message.NAME."""
    key: str
    fact: Fact

    @property
    def dotted(self) -> str:
        """Its dotted key."""
        return f"{self.section}.{self.key}"

    @property
    def plain(self) -> Any:
        """Its value as TOML has it."""
        return whole(self.fact.value)


def profile_text(rows: Sequence[ProfileLine], *, name: str, files: Sequence[tuple[str, str]]) -> str:
    """The text of a profile.

    Parameters
    ----------
    rows
        Its lines, those of a section side by side.
    name
        Name of the profile.
    files
        File and format of each source, for the description.

    Raises
    ------
    BusplanError
        It is larger than a profile may be.
    """
    sources = ", ".join(f"{PurePath(file).name} ({title})" for file, title in files)
    head = [
        "schema_version = 1",
        f"name = {value_text(printable(name)[:_LONGEST_PROFILE_NAME].strip() or 'machine')}",
        f"description = {value_text(printable(f'Imported from {sources}')[:2000])}",
    ]
    text = "\n".join([*head, sections_text(rows)])
    text = text.encode("utf-8", "backslashreplace").decode()
    if len(text.encode()) > MAX_FILE_BYTES:
        count = sum(row.key == "nodes" for row in rows)
        raise BusplanError(
            f"the profile would be larger than {MAX_FILE_BYTES:,} bytes: {count} groups of devices that differ from "
            "their neighbours; import a part of the machine"
        )
    return text


def sections_text(rows: Sequence[ProfileLine]) -> str:
    """The text of sections, each after an empty line."""
    return "".join(f"{line}\n" for line in _sections(rows))


def _sections(rows: Sequence[ProfileLine]) -> Iterator[str]:
    for section, section_rows in groupby(rows, lambda row: row.section):
        yield ""
        first, _, rest = section.partition(".")
        name, _, inner = rest.partition(".")
        if inner:
            yield f"[{first}.{inner}]"
        elif name:
            yield f"[[{first}]]"
            yield f"name = {value_text(name)}"
        else:
            yield f"[{first}]"
        for row in section_rows:
            line, comment = f"{row.key} = {short_text(row.fact.value)}", row.fact.comment
            yield f"{line:{_COMMENTS_AT - 1}} # {comment}" if comment else line


def group_name(text: str, taken: set[str]) -> str:
    """A name that a profile takes, not used before: letters, digits, - and _.

    Examples
    --------
    >>> taken = set()
    >>> group_name("L7EC-1000S/C(COE)", taken), group_name("L7EC-1000S/C(COE)", taken), group_name("2 drives", taken)
    ('L7EC-1000S-C-COE', 'L7EC-1000S-C-COE-2', 'n2-drives')
    """
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-")[:_LONGEST_NAME] or "node"
    name = name if name[0].isalpha() else f"n{name}"
    free = name
    number = 1
    while free in taken:
        number += 1
        free = f"{name}-{number}"
    taken.add(free)
    return free


def time_us(text: str) -> float:
    """A time with its unit, as a kind of bus has its usual period [us].

    Examples
    --------
    >>> time_us("4ms"), time_us("250us")
    (4000.0, 250.0)
    """
    unit = text[-2:]
    return float(text[:-2]) * _UNITS[unit]


def assumed(rows: Iterable[ProfileLine]) -> list[ProfileLine]:
    """Rows that nobody has measured or configured."""
    return [row for row in rows if row.fact.grade == "assumed" and row.key not in ("grade", "kind", "master_grade")]


MOST_BYTES: Final = 32_000_000
"""Largest file; the ENI of 500 devices has some 20 MB."""


_LONGEST_LINE: Final = 1000


class Format(NamedTuple):
    """A format that is read, and how it is recognised."""

    title: str
    """Name of the format, and what its files hold."""
    module: str
    roots: tuple[str, ...] = ()
    """Tags of the root element, for XML."""
    pattern: str = ""
    """Pattern of a line that only files of the format have, for text."""
    dialect: str = ""
    """Argument of a reader that reads several formats."""
    head: bytes = b""
    """Pattern of the first bytes, for recordings."""


_IGH: Final = r"=== Master \d+, Slave \d+ ===|SM\d+: PhysAddr 0x"
FORMATS: Final = (
    Format("ENI (a root <EtherCATConfig>)", "eni", roots=("EtherCATConfig", "EncryptedEtherCATConfig")),
    Format("LinuxCNC's ethercat-conf.xml (a root <masters>)", "linuxcnc", roots=("masters",)),
    Format("text of `ethercat slaves -v` or `ethercat pdos` (=== Master 0, Slave 0 ===)", "igh", pattern=_IGH),
    Format("text of SOEM's slaveinfo (Slave:1)", "soem", pattern=r"Slave:\d+[ \t]*$"),
    Format("DBC (BO_)", "can_database", pattern=r"[ \t]*BO_ +\d+ ", dialect="dbc"),
    Format("SYM (FormatVersion=)", "can_database", pattern=r"[ \t]*FormatVersion *= *\d", dialect="sym"),
    Format("KCD (a root <NetworkDefinition>)", "can_database", roots=("NetworkDefinition",), dialect="kcd"),
    Format("ARXML (a root <AUTOSAR>)", "can_database", roots=("AUTOSAR",), dialect="arxml"),
    Format("CANopen EDS or DCF ([DeviceInfo])", "canopen", pattern=r"[ \t]*\[(?i:DeviceInfo)\]"),
    Format(
        "a CAN log (candump -l, ASC, BLF, TRC)",
        "can_log",
        head=rb"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#|date \S|LOGG|;[^\[]{0,2000}?(\$FILEVERSION|Start time:)",
    ),
)
_ELSEWHERE: Final = {
    "EtherCATInfo": "an ESI describes a kind of device and no machine; export the ENI of the machine",
    "TcSmProject": "a project of TwinCAT; export its ENI (EtherCAT, Export Configuration File)",
}


def machines(names: Sequence[str], *, progress: Progress) -> list[Reading]:
    """Read files, in their order.

    Parameters
    ----------
    names
        The files; "-" is standard input.
    progress
        Called with the bytes read of a recording and those of its file.

    Raises
    ------
    BusplanError
        A file cannot be read, is of no known format or of two, or is not valid, with its place.
    """
    return [_machine(name, progress) for name in names]


def _machine(argument: str, progress: Progress) -> Reading:
    name = "<stdin>" if argument == "-" else argument
    content = read_bytes(Path(argument), name=name, limit=MOST_BYTES)
    for known in FORMATS:
        if known.head and re.match(known.head, content):
            if argument == "-":
                raise BusplanError(f"{name}: a recording is read from a file")
            return _reader(known)(Path(argument), name, progress=progress)
    if len(content) > MOST_BYTES:
        raise BusplanError(f"{name}: is larger than {MOST_BYTES:,} bytes; no file of one machine is")
    if not content.strip(b"\0 \t\r\n\xef\xbb\xbf\xff\xfe"):
        raise BusplanError(f"{name}: is empty")
    encoding = "utf-16" if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8"
    if content[:1000].decode(encoding, "ignore").lstrip("\ufeff \t\r\n").startswith("<"):
        return _of_root(content, root_tag(content, name=name), name)
    return _of_text(_text(content, encoding, name), name)


def _of_root(content: bytes, tag: str, name: str) -> Reading:
    for known in FORMATS:
        if tag in known.roots:
            return _reader(known)(content, name)
    reason = _ELSEWHERE.get(tag)
    raise BusplanError(f"{name}: {reason}" if reason else _unknown(name, f"XML with a root <{tag[:60]}>, which is "))


def _text(content: bytes, encoding: str, name: str) -> str:
    """The text of a file: UTF-8, UTF-16, or a code page of Windows."""
    if encoding == "utf-8" and b"\0" in content[:100_000]:
        raise BusplanError(_unknown(name, "binary data, "))
    try:
        text = content.decode("utf-8-sig" if content.startswith(BOM_UTF8) else encoding)
    except UnicodeDecodeError:
        text = content.decode("cp1252", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _of_text(text: str, name: str) -> Reading:
    matching = [known for known in FORMATS if known.pattern and re.search(f"^(?:{known.pattern})", text, re.MULTILINE)]
    if not matching:
        raise BusplanError(_unknown(name, ""))
    if len(matching) > 1:
        titles = " and ".join(known.title for known in matching)
        raise BusplanError(f"{name}: has lines of {titles}; give a file for each")
    if not matching[0].dialect:
        # Values stand further to the front, and patterns take long on endless lines.
        text = "\n".join(line[:_LONGEST_LINE] for line in text.split("\n"))
    return _reader(matching[0])(text, name)


def _reader(known: Format) -> Callable[..., Reading]:
    read: Callable[..., Reading] = import_module(f"busplan.questions.import_.{known.module}").read
    return partial(read, dialect=known.dialect) if known.dialect else read


def _unknown(name: str, what: str) -> str:
    formats = "; ".join(known.title for known in FORMATS)
    return f"{name}: {what}none of what is looked for: {formats}"


def stem_of(names: Sequence[str]) -> str:
    """Name of a profile of some files."""
    return Path(os.path.basename(names[0])).stem if names[0] != "-" else "machine"  # noqa: PTH119 - any text
