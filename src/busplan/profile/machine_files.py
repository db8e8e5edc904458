"""Formats of machines' files, each recognised by its content."""

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from typing import Final, NamedTuple

UTF_16: Final = (BOM_UTF16_LE, BOM_UTF16_BE)
_LOOKED_AT: Final = 1_000_000
"""Characters among which the first line or element of a format is [1]."""


class Format(NamedTuple):
    """A format that is read. Its root elements, a pattern of its text or its first bytes identify it."""

    title: str
    """Name of the format, and content of its files."""
    module: str
    """Module that reads its files."""
    roots: tuple[str, ...] = ()
    """Tags of the root element of XML."""
    pattern: str = ""
    """Pattern of a line that only texts of this format have."""
    dialect: str = ""
    """Argument of a reader that reads several formats."""
    head: bytes = b""
    """Pattern of the first bytes of a recording."""

    @property
    def short(self) -> str:
        """Name of the format alone."""
        return self.title.partition(" (")[0]


_IGH: Final = r"=== Master \d+, Slave \d+ ===|SM\d+: PhysAddr 0x"
_CANDUMP: Final = (
    rb"(?>#[^\n]*\n|[ \t\r]*\n)*+[ \t]*(?:\([ \t]*\d+\.\d+\)[ \t]+)?\S+[ \t]+"
    rb"(?:[0-9A-Fa-f]+#|(?:[RT]X [B-] [E-] +)?(?:[0-9A-F]{3}|[0-9A-F]{8}) +\[\d+\])"
)
_SOCKETCAN: Final = (
    rb"(?s:[\xd4\x4d][\xc3\x3c]\xb2\xa1.{16}\xe3\x00|\xa1\xb2[\xc3\x3c][\xd4\x4d].{18}\x00\xe3"
    rb"|\n\r\r\n.{0,2000}?(?:\x01\x00\x00\x00.{4}\xe3\x00|\x00\x00\x00\x01.{4}\x00\xe3))"
)
"""A pcap or pcapng file whose first link type is 227."""
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
        "a CAN log (candump -l, ASC, BLF, TRC, a capture of SocketCAN)",
        "can_log",
        head=rb"|".join((_CANDUMP, rb"date \S|LOGG|;[^\[]{0,2000}?(\$FILEVERSION|Start time:)", _SOCKETCAN)),
    ),
)
_ROOT: Final = re.compile(
    r"\ufeff?(?>\s+|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^<>\[]*(?:\[.*?\]\s*)?>)*+<(?:[\w.-]+:)?([\w.-]+)", re.DOTALL
)
"""The groups are possessive: tried again, each comment could end where any later one does."""


def root_tag(content: bytes) -> str | None:
    """Tag of the root element of an XML file; None if it is no XML."""
    text = content[:_LOOKED_AT].decode("utf-16" if content.startswith(UTF_16) else "utf-8", "ignore")
    match = _ROOT.match(text)
    return None if match is None else match[1]


def recordings(content: bytes) -> list[Format]:
    """Formats of recordings that the first bytes of a file fit."""
    head = content[:_LOOKED_AT]
    return [each for each in FORMATS if each.head and re.match(each.head, head)]


def matching(content: bytes) -> list[Format]:
    """Formats that the content of a file fits: none, one, or several of text."""
    if found := recordings(content):
        return found
    if (tag := root_tag(content)) is not None:
        return [each for each in FORMATS if tag in each.roots]
    if not content.startswith(UTF_16) and b"\0" in content[:100_000]:
        return []
    text = text_of(content)
    return [each for each in FORMATS if each.pattern and re.search(f"^(?:{each.pattern})", text, re.MULTILINE)]


def text_of(content: bytes) -> str:
    """The text of a file: UTF-8, UTF-16, or a code page of Windows."""
    encoding = "utf-16" if content.startswith(UTF_16) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = content.decode("cp1252", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")
