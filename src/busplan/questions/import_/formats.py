"""Readers of machines' files, each chosen by the content of a file."""

import re
from importlib import import_module
from pathlib import Path
from typing import Final

from busplan.errors import BusplanError
from busplan.files import given_path
from busplan.profile.document import read_bytes
from busplan.profile.machine_files import FORMATS, UTF_16, Format, matching, recordings, root_tag, text_of
from busplan.progress import Progress
from busplan.questions.import_.reading import Reading

MOST_BYTES: Final = 32_000_000
"""Size limit of a file that is no recording [bytes]; the ENI of 500 devices has some 20 MB."""
_LONGEST_LINE: Final = 1000
_CAPTURE: Final = rb"[\xd4\x4d][\xc3\x3c]\xb2\xa1|\xa1\xb2[\xc3\x3c][\xd4\x4d]|\n\r\r\n"
"""First bytes of pcap and pcapng files."""
_ELSEWHERE: Final = {
    "EtherCATInfo": "an ESI describes a kind of device and no machine; export the ENI of the machine",
    "TcSmProject": "a project of TwinCAT; export its ENI (EtherCAT, Export Configuration File)",
}


def read_machine(
    argument: str, *, bus: str | None, channel: str | None, nodes: tuple[int, ...], progress: Progress
) -> Reading:
    """Read a file; "-" is standard input.

    `bus` and `channel` name the one to read in a database and in a log; `nodes` are the node-IDs that an EDS describes.
    Progress is called with the bytes read of a recording and the size of its file [bytes]. A file that cannot be read,
    is of no known format or of two, or is not valid raises BusplanError, with its place.
    """
    name = "<stdin>" if argument == "-" else argument
    content = read_bytes(given_path(argument), name=name, limit=MOST_BYTES)
    machine_format = recognised(content, name=name)
    read = import_module(f"busplan.questions.import_.{machine_format.module}").read
    reading: Reading
    if machine_format.head:
        if argument == "-":
            raise BusplanError(f"{name}: a recording is read from a file")
        reading = read(Path(argument), name, channel=channel, progress=progress)
    elif machine_format.dialect:
        given = content if machine_format.roots else text_of(content)
        reading = read(given, name, dialect=machine_format.dialect, bus=bus)
    elif machine_format.roots:
        reading = read(content, name)
    else:
        # Values are nearer to the start, and patterns take long on endless lines.
        text = "\n".join(line[:_LONGEST_LINE] for line in text_of(content).split("\n"))
        reading = read(text, name, nodes=nodes) if machine_format.module == "canopen" else read(text, name)
    return reading


def recognised(content: bytes, *, name: str) -> Format:
    """Format of a file by its content.

    A file of no known format, of two, or an empty or too large one raises BusplanError.
    """
    formats = recordings(content)
    if not formats and len(content) > MOST_BYTES:
        raise BusplanError(f"{name}: is larger than {MOST_BYTES:,} bytes; no file of one machine is")
    formats = formats or matching(content)
    if len(formats) > 1:
        titles = " and ".join(each.title for each in formats)
        raise BusplanError(f"{name}: has lines of {titles}; give a file for each")
    if formats:
        return formats[0]
    if not content.strip(b"\0 \t\r\n\xef\xbb\xbf\xff\xfe"):
        raise BusplanError(f"{name}: is empty")
    what = ""
    if tag := root_tag(content):
        if tag in _ELSEWHERE:
            raise BusplanError(f"{name}: {_ELSEWHERE[tag]}")
        what = f"XML with a root <{tag[:60]}>, "
    elif re.match(_CAPTURE, content):
        raise BusplanError(
            f"{name}: a capture, but not of SocketCAN: of EtherCAT import reads the ENI, `ethercat slaves -v` or "
            f"slaveinfo, and `busplan measured PROFILE.toml {name}` compares the capture with the profile"
        )
    elif not content.startswith(UTF_16) and b"\0" in content[:100_000]:
        what = "binary data, "
    raise BusplanError(f"{name}: {what}no format that busplan imports: {'; '.join(each.title for each in FORMATS)}")
