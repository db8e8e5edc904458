"""Files of one machine: each is recognised by its content and read by the reader of its format."""

import os
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Final, NamedTuple

from busplan.errors import BusplanError
from busplan.profile.toml import read_bytes
from busplan.progress import Progress
from busplan.questions.import_.record import Reading
from busplan.questions.import_.xml_tree import root_tag

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
