"""Databases of CAN messages, read by cantools: DBC, KCD, SYM, ARXML. Identifiers, lengths, cycle times, bit rate."""

import logging
import re
from contextlib import suppress
from typing import Any, Final

from busplan.english import first_of
from busplan.errors import BusplanError
from busplan.extras import require_extra
from busplan.questions.import_.reading import Reading, whole_number
from busplan.questions.import_.xml import parsed

EXTENDED: Final = 1 << 31
"""Flag in the number of a message with an identifier of 29 bits, as in DBC."""
_MOST_BYTES: Final = 16_000_000
_LONGEST_LINE: Final = 1000
_LONGEST_TEXT: Final = 1_000_000
"""Most characters between two quotation marks; cantools takes 200 bytes of memory for each."""
_MOST_MESSAGES: Final = 20_000
"""Most messages of a database, as identifiers of a log: many times those of a machine."""
_BEGINS: Final = {
    "dbc": r"(?m)^[ \t]*BO_ ",
    "sym": r"(?m)^[ \t]*\[",
    "kcd": r"<(?:\w+:)?Message\b",
    "arxml": r"<CAN-FRAME-TRIGGERING\b",
}
"""Pattern of the beginning of a message, by format."""
_NAMED: Final = {
    "dbc": r"\s*BO_ +\d+ +(\w+) *:",
    "sym": r"\s*\[\"?([^\]\"]+)\"?\]",
    "kcd": r".*<(?:\w+:)?Message\b[^>]*\bname=\"([^\"]*)\"",
    "arxml": r".*<SHORT-NAME>([^<]*)</SHORT-NAME>",
}
"""Pattern of a message's name, by format."""
_REST: Final = r"(?:[^\";]++|\"(?:[^\"\\]++|\\.)*+(?:\"|\Z))*+(?:;|\Z)"
"""Rest of a statement, up to its semicolon. One without it is matched to the end, so that it is read once."""
_SIGNALS: Final = re.compile(
    rf"^[ \t]*(?:SG_ [^\n]*$|(?:VAL_|SIG_VALTYPE_|SG_MUL_VAL_) {_REST})", re.MULTILINE | re.DOTALL
)
_ATTRIBUTE: Final = re.compile(rf"^[ \t]*BA_(?:DEF_DEF_)? +\"([^\"\n]*)\"{_REST}", re.MULTILINE | re.DOTALL)
_DEFINED: Final = re.compile(r"^[ \t]*BA_DEF_(?:REL_)? +(?:\w+_ +)?\"([^\"\n]*)\"", re.MULTILINE)
_NUMBERED: Final = re.compile(r"\b(BO_|SG_|BO_TX_BU_|SIG_GROUP_) +(\d{4,9})\b")
"""Number of a message where it has 4 to 9 digits: it lacks bit 31, which makes it 10."""
_MESSAGE: Final = re.compile(r"(<(?:\w+:)?Message\b)[^<>]*?\sid\s*=\s*[\"']([^\"'<>]{1,20})[\"'][^<>]*>")
_MOST_STANDARD: Final = (1 << 11) - 1
_WHOLE_SIGNAL: Final = re.compile(r"\s*SG_ .*\[.*\].*\"\s*\S")
_NEXT_STEPS: Final = dict.fromkeys(("dbc", "sym", "kcd"), "export it anew from the tool that wrote it") | {
    "arxml": "save the database as DBC in the tool that wrote it, and give that"
}
"""Advice for a file that cantools cannot read, by format."""
_LINE: Final = re.compile(r"Invalid syntax at line (\d+), column (\d+)")
_KILO: Final = 1000
_LISTED: Final = 8
_LARGEST_IN_KILO: Final = {"bit_rate_kbit_s": 1000, "data_bit_rate_kbit_s": 8000}
"""Largest numbers that are in kbit/s; larger ones are in bit/s."""
_RATES: Final = (
    ("bit_rate_kbit_s", "baudrate", ("Baudrate", "BaudRate")),
    ("data_bit_rate_kbit_s", "fd_baudrate", ("BaudrateCANFD", "BaudRateCANFD")),
)
"""Bit rates: key, cantools' name of it for a bus, and attributes of a DBC."""
_MOST_BIT_RATE: Final = 10_000_000


def read(given: str | bytes, name: str, *, dialect: str, bus: str | None = None) -> Reading:
    """Read a database from text, or from the bytes of XML; `dialect` is dbc, sym, kcd or arxml.

    `bus` is the name of the one to read of several. BusplanError: the extra is not installed, the database is not
    valid, has several buses and none is named, or has no messages.
    """
    title = dialect.upper()
    machine = Reading("can", title, name, rank=1, lists_all=False, is_database=True)
    if len(given) > _MOST_BYTES:
        raise BusplanError(f"{name}: is larger than {_MOST_BYTES:,} bytes; no {title} of one machine is")
    text = given if isinstance(given, str) else given.decode("utf-8", "replace")
    if isinstance(given, bytes):
        parsed(given, name=name, skipped=("NetworkDefinition", "AUTOSAR"))
    require_extra("cantools", extra="import", option=f"{name}: {title}", module="cantools.database")
    if (count := sum(1 for _ in re.finditer(_BEGINS[dialect], text))) > _MOST_MESSAGES:
        raise BusplanError(f"{name}: has {count:,} messages; of a database at most {_MOST_MESSAGES:,} are read")
    if isinstance(given, str) and max(map(len, text.split('"'))) > _LONGEST_TEXT:
        raise BusplanError(f"{name}: has a text of over {_LONGEST_TEXT:,} characters; no {title} of one machine has")
    database = _loaded(text, machine, dialect)
    lines: dict[str, int] = {}
    for line, content in enumerate(text.split("\n"), start=1):
        if match := re.match(_NAMED[dialect], content[:_LONGEST_LINE]):
            lines.setdefault(match[1], line)
    if not database.messages:
        raise machine.refusal(1, f"a {title} without messages")
    messages = _of_one_bus(database, machine, bus)
    _bit_rates(database, messages, machine)
    for message in messages:
        line, number = lines.get(message.name, 1), message.frame_id + EXTENDED * bool(message.is_extended_frame)
        if number in machine.messages:
            owner = machine.messages[number]["name"].value
            raise machine.refusal(line, f"message {message.name} has the identifier of {owner}: a bus has each once")
        values = {
            "name": message.name or f"id-{message.frame_id:#x}",
            "payload_bytes": message.length,
            # One of several senders could not be told from the others.
            "sender": message.senders[0] if len(message.senders) == 1 else None,
            "is_fd": message.is_fd or None,
            "period_us": message.cycle_time * _KILO if message.cycle_time else None,
        }
        machine.messages[number] = {
            key: machine.fact(value, line) for key, value in values.items() if value is not None
        }
    return machine


def _loaded(text: str, machine: Reading, dialect: str) -> Any:
    name, title = machine.file, machine.title
    from cantools.database import load_string

    # Its warnings are refused here, or do not matter.
    logging.getLogger("cantools").addHandler(logging.NullHandler())
    if dialect == "dbc":
        last = text.rstrip().rpartition("\n")[2]
        if last.lstrip().startswith("SG_ ") and not _WHOLE_SIGNAL.match(last):
            raise BusplanError(f"{name}:{text.rstrip().count(chr(10)) + 1}: ends within a signal: cut off?")
        text = _mended(text, machine)
        # Signals do not matter here, and take most of the time. In an unusual layout cantools finds them itself.
        with suppress(Exception):
            return load_string(_SIGNALS.sub(_blank, text), dialect, strict=False)
    if dialect == "kcd":
        text = _marked(text, machine)
    try:
        return load_string(text, dialect, strict=False)
    except Exception as error:  # noqa: BLE001 - the readers of formats fail in many ways
        # Its error messages are about its own code; only the place helps the user.
        position = _LINE.search(str(error))
        place = f"{position[1]}:{position[2]}" if position else "1"
        why = "invalid syntax" if position else "cantools cannot read it"
        raise BusplanError(f"{name}:{place}: not a valid {title}: {why}; {_NEXT_STEPS[dialect]}") from None


def _mended(text: str, machine: Reading) -> str:
    """A DBC as cantools accepts it, with the same lines: without undefined attributes, and with a missing bit 31."""
    defined = set(_DEFINED.findall(text))
    undefined = sorted({name for name in _ATTRIBUTE.findall(text) if name not in defined})
    if undefined:
        text = _ATTRIBUTE.sub(lambda match: match[0] if match[1] in defined else _blank(match), text)
        machine.remarks.append(
            f"{machine.file}: attributes that it does not define are left out: {first_of(undefined, _LISTED)}"
        )
    short = {int(match[2]) for match in _NUMBERED.finditer(text) if int(match[2]) > _MOST_STANDARD}
    if short:
        text = _NUMBERED.sub(
            lambda match: f"{match[1]} {int(match[2]) + EXTENDED * (int(match[2]) > _MOST_STANDARD)}", text
        )
        _say_extended(short, machine)
    return text


def _marked(text: str, machine: Reading) -> str:
    """A KCD whose identifiers over 11 bits are marked as 29 bits long."""
    short: set[int] = set()

    def marked(match: re.Match[str]) -> str:
        number = whole_number(match[2])
        if number is None or number <= _MOST_STANDARD or re.search(r"\sformat\s*=", match[0]):
            return match[0]
        short.add(number)
        return f'{match[1]} format="extended"{match[0][len(match[1]) :]}'

    text = _MESSAGE.sub(marked, text)
    if short:
        _say_extended(short, machine)
    return text


def _say_extended(numbers: set[int], machine: Reading) -> None:
    mark = "bit 31" if machine.title == "DBC" else 'format="extended"'
    machine.remarks.append(
        f"{machine.file}: identifiers over 11 bits without {mark} are taken for 29 bits: "
        f"{first_of([f'0x{number:08X}' for number in sorted(numbers)], _LISTED)}"
    )


def _blank(match: re.Match[str]) -> str:
    """Empty lines for a statement; one that the end of the file cuts stays, so that it is refused."""
    if match.end() == len(match.string) and not match[0].endswith(";"):
        return match[0]
    return "\n" * match[0].count("\n")


def _of_one_bus(database: Any, machine: Reading, bus: str | None) -> list[Any]:
    """Messages of the requested bus, or of the only one."""
    buses = sorted({str(message.bus_name or "") for message in database.messages})
    if bus is None and len(buses) > 1:
        names = first_of(buses, _LISTED)
        raise machine.refusal(
            1, f"messages of {len(buses)} buses, {names}: a profile describes one bus; --bus NAME reads one"
        )
    if bus is not None and bus not in buses:
        raise machine.refusal(
            1, f"bus {bus}: no messages of such a bus; there are {first_of(buses, _LISTED) or 'none'}"
        )
    return [message for message in database.messages if bus is None or message.bus_name == bus]


def _bit_rates(database: Any, messages: list[Any], machine: Reading) -> None:
    """Bit rates of a database that gives them."""
    used = {message.bus_name for message in messages}
    attributes = getattr(database.dbc, "attributes", None) or {}
    for key, of_bus, attribute_names in _RATES:
        rates = [getattr(bus, of_bus) for bus in database.buses if bus.name in used and getattr(bus, of_bus)]
        rates += [attributes[name].value for name in attribute_names if name in attributes]
        if rates and isinstance(rates[0], int | float) and 0 < rates[0] <= _MOST_BIT_RATE:
            rate = rates[0] / _KILO if rates[0] > _LARGEST_IN_KILO[key] else rates[0]
            machine.bus[key] = machine.fact(rate, 1)
