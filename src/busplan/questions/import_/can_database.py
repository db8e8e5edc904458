"""Databases of CAN messages, by cantools: DBC, KCD, SYM, ARXML. Identifiers, lengths, cycle times, bit rate."""

import logging
import re
from typing import Any, Final

from busplan.errors import BusplanError
from busplan.extras import require_extra
from busplan.questions.import_.reading import Reading
from busplan.questions.import_.xml import parsed

EXTENDED: Final = 1 << 31
"""Added to the number of a message with an identifier of 29 bits, as DBC has it."""
_MOST_BYTES: Final = 16_000_000
_NAMED: Final = {
    "dbc": r"\s*BO_ +\d+ +(\w+) *:",
    "sym": r"\s*\[\"?([^\]\"]+)\"?\]",
    "kcd": r".*<(?:\w+:)?Message\b[^>]*\bname=\"([^\"]*)\"",
    "arxml": r".*<SHORT-NAME>([^<]*)</SHORT-NAME>",
}
"""Where a message's name stands."""
_SIGNALS: Final = re.compile(r"^[ \t]*(?:SG_|VAL_|SIG_VALTYPE_|SG_MUL_VAL_) .*$", re.MULTILINE)
_WHOLE_SIGNAL: Final = re.compile(r"\s*SG_ .*\[.*\].*\"\s*\S")
_LINE: Final = re.compile(r"Invalid syntax at line (\d+), column (\d+)")
_KILO: Final = 1000
_LARGEST_IN_KILO: Final = {"bit_rate_kbit_s": 1000, "data_bit_rate_kbit_s": 8000}
"""Numbers up to these are in kbit/s, larger ones in bit/s."""
_RATES: Final = (
    ("bit_rate_kbit_s", "baudrate", ("Baudrate", "BaudRate")),
    ("data_bit_rate_kbit_s", "fd_baudrate", ("BaudrateCANFD", "BaudRateCANFD")),
)
"""Each bit rate: its key, what cantools calls that of a bus, and attributes of a DBC."""
_MOST_BIT_RATE: Final = 10_000_000


def read(given: str | bytes, name: str, *, dialect: str) -> Reading:
    """Read a database.

    Parameters
    ----------
    given
        The text, or the bytes of XML.
    name
        Name of the file in messages.
    dialect
        dbc, sym, kcd or arxml.

    Raises
    ------
    BusplanError
        The extra is not installed, the database is not valid, it is of several buses, or it has no messages.
    """
    title = dialect.upper()
    machine = Reading("can", title, name, rank=1, lists_all=False)
    if len(given) > _MOST_BYTES:
        raise BusplanError(f"{name}: is larger than {_MOST_BYTES:,} bytes; no {title} of one machine is")
    text = given if isinstance(given, str) else given.decode("utf-8", "replace")
    if isinstance(given, bytes):
        parsed(given, name=name, skipped=("NetworkDefinition", "AUTOSAR"))
    require_extra("cantools", extra="import", option=f"{name}: {title}", module="cantools.database")
    database = _loaded(text, name, title, dialect)
    lines: dict[str, int] = {}
    for line, content in enumerate(text.split("\n"), start=1):
        if match := re.match(_NAMED[dialect], content):
            lines.setdefault(match[1], line)
    if not database.messages:
        raise machine.refusal(1, f"a {title} without messages")
    _bit_rates(database, machine)
    for message in database.messages:
        line, number = lines.get(message.name, 1), message.frame_id + EXTENDED * bool(message.is_extended_frame)
        if number in machine.messages:
            owner = machine.messages[number]["name"].value
            raise machine.refusal(line, f"message {message.name} has the identifier of {owner}: a bus has each once")
        facts = machine.messages[number] = {
            "name": machine.fact(message.name, line),
            "payload_bytes": machine.fact(message.length, line),
        }
        if message.is_fd:
            facts["is_fd"] = machine.fact(True, line)
        if message.cycle_time:
            facts["period_us"] = machine.fact(message.cycle_time * _KILO, line)
    return machine


def _loaded(text: str, name: str, title: str, dialect: str) -> Any:
    from cantools.database import load_string

    # Its warnings are refused here, or do not matter.
    logging.getLogger("cantools").addHandler(logging.NullHandler())
    if dialect == "dbc":
        last = text.rstrip().rpartition("\n")[2]
        if last.lstrip().startswith("SG_ ") and not _WHOLE_SIGNAL.match(last):
            raise BusplanError(f"{name}:{text.rstrip().count(chr(10)) + 1}: ends within a signal: cut off?")
        # Signals do not matter here, and take most of the time.
        text = _SIGNALS.sub("", text)
    try:
        return load_string(text, dialect, strict=False)
    except Exception as error:  # noqa: BLE001 - the readers of formats fail in many ways
        message = " ".join(str(error).removeprefix(f"{title}: ").split())[:200]
        position = _LINE.search(message)
        place = f"{position[1]}:{position[2]}" if position else "1"
        raise BusplanError(
            f"{name}:{place}: not a valid {title}: {'invalid syntax' if position else message}"
        ) from None


def _bit_rates(database: Any, machine: Reading) -> None:
    """The bit rates, where the database says them; refuse several buses."""
    used = {message.bus_name for message in database.messages}
    if len(used) > 1:
        names = ", ".join(sorted(map(str, used)))
        raise machine.refusal(1, f"messages of {len(used)} buses, {names}: a profile is one bus; export one")
    attributes = getattr(database.dbc, "attributes", None) or {}
    for key, of_bus, attribute_names in _RATES:
        rates = [getattr(bus, of_bus) for bus in database.buses if bus.name in used and getattr(bus, of_bus)]
        rates += [attributes[name].value for name in attribute_names if name in attributes]
        if rates and isinstance(rates[0], int | float) and 0 < rates[0] <= _MOST_BIT_RATE:
            rate = rates[0] / _KILO if rates[0] > _LARGEST_IN_KILO[key] else rates[0]
            machine.bus[key] = machine.fact(rate, 1)
