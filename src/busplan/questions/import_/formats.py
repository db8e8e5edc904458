"""Formats of machines' files: how each is recognised by its content, and which reader it has."""

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Final, NamedTuple

from busplan.errors import BusplanError
from busplan.profile.document import read_bytes
from busplan.progress import Progress
from busplan.questions.import_.reading import Reading
from busplan.questions.import_.xml import root_tag

MOST_BYTES: Final = 32_000_000
"""Largest file but a recording; the ENI of 500 devices has some 20 MB."""
_LONGEST_LINE: Final = 1000
_UTF_16: Final = (BOM_UTF16_LE, BOM_UTF16_BE)


class Format(NamedTuple):
    """A format that is read, and how it is recognised: by one of roots, pattern and head."""

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

    @property
    def read(self) -> Callable[..., Reading]:
        """Reader of its files: by content and name, of recordings by path and name."""
        read: Callable[..., Reading] = import_module(f"busplan.questions.import_.{self.module}").read
        return partial(read, dialect=self.dialect) if self.dialect else read


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


def read_machine(argument: str, *, progress: Progress) -> Reading:
    """Read a file.

    Parameters
    ----------
    argument
        The file; "-" is standard input.
    progress
        Called with the bytes read of a recording and those of its file.

    Raises
    ------
    BusplanError
        The file cannot be read, is of no known format or of two, or is not valid, with its place.
    """
    name = "<stdin>" if argument == "-" else argument
    content = read_bytes(Path(argument), name=name, limit=MOST_BYTES)
    machine_format = recognised(content, name=name)
    if machine_format.head:
        if argument == "-":
            raise BusplanError(f"{name}: a recording is read from a file")
        return machine_format.read(Path(argument), name, progress=progress)
    if machine_format.roots:
        return machine_format.read(content, name)
    text = _text(content)
    if not machine_format.dialect:
        # Values stand further to the front, and patterns take long on endless lines.
        text = "\n".join(line[:_LONGEST_LINE] for line in text.split("\n"))
    return machine_format.read(text, name)


def recognised(content: bytes, *, name: str) -> Format:
    """The format of a file by its content.

    Raises
    ------
    BusplanError
        It is of no known format or of two, empty, too large or not valid XML.
    """
    for candidate in FORMATS:
        if candidate.head and re.match(candidate.head, content):
            return candidate
    if len(content) > MOST_BYTES:
        raise BusplanError(f"{name}: is larger than {MOST_BYTES:,} bytes; no file of one machine is")
    if not content.strip(b"\0 \t\r\n\xef\xbb\xbf\xff\xfe"):
        raise BusplanError(f"{name}: is empty")
    is_utf_16, reason = content.startswith(_UTF_16), ""
    start = content[:1000].decode("utf-16" if is_utf_16 else "utf-8", "ignore")
    if start.lstrip("\ufeff \t\r\n").startswith("<"):
        tag = root_tag(content, name=name)
        matching = [candidate for candidate in FORMATS if tag in candidate.roots]
        reason, what = _ELSEWHERE.get(tag, ""), f"XML with a root <{tag[:60]}>, which is "
    elif not is_utf_16 and b"\0" in content[:100_000]:
        matching, what = [], "binary data, "
    else:
        text, what = _text(content), ""
        matching = [
            candidate
            for candidate in FORMATS
            if candidate.pattern and re.search(f"^(?:{candidate.pattern})", text, re.MULTILINE)
        ]
    if len(matching) > 1:
        titles = " and ".join(candidate.title for candidate in matching)
        raise BusplanError(f"{name}: has lines of {titles}; give a file for each")
    if not matching:
        titles = "; ".join(candidate.title for candidate in FORMATS)
        raise BusplanError(f"{name}: {reason or f'{what}none of what is looked for: {titles}'}")
    return matching[0]


def _text(content: bytes) -> str:
    """The text of a file: UTF-8, UTF-16, or a code page of Windows."""
    encoding = "utf-16" if content.startswith(_UTF_16) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = content.decode("cp1252", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")
