"""Report of what a recording has."""

from collections.abc import Iterator
from dataclasses import fields
from shlex import quote
from typing import Final

from busplan.english import plural
from busplan.forms import blocks
from busplan.questions.base.sentences import document
from busplan.questions.recorded.contents import LogContents, RecordedEmergency, RecordedIdentifier

_SHOWN: Final = 40
"""Identifiers that a table shows, those with the most frames."""
_USUAL: Final = (125.0, 250.0, 500.0, 1000.0)
"""Bit rates whose load a sentence has [kbit/s]."""
_ALWAYS: Final = 0.9
"""Share of the log in which a cyclic message comes, at least, so that nothing is said of when it does [1]."""
_COLUMNS: Final = (
    blocks.TableColumn("identifier", kind="words"),
    blocks.TableColumn("as", kind="words", wraps=True),
    blocks.TableColumn("comes", kind="words", wraps=True),
    blocks.TableColumn("n"),
    blocks.TableColumn("median gap", "us"),
    blocks.TableColumn("least", "us", rank=2),
    blocks.TableColumn("largest", "us"),
    blocks.TableColumn("until", "s", rank=1),
    blocks.TableColumn("frame", rank=3),
    blocks.TableColumn("data", "bytes", kind="words"),
    blocks.TableColumn("load", "%"),
)
_EMERGENCIES: Final = (
    blocks.TableColumn("node"),
    blocks.TableColumn("error code", kind="words"),
    blocks.TableColumn("register", kind="words"),
    blocks.TableColumn("n"),
    blocks.TableColumn("first", "s"),
    blocks.TableColumn("frame"),
    blocks.TableColumn("last", "s"),
)


def report(source: str, contents: LogContents) -> blocks.Report:
    """What a log has, in blocks."""
    records = [row._asdict() for row in contents.identifiers]
    return blocks.Report(
        blocks.Sentence(("The recording ", blocks.Code(source))),
        tuple(_blocks(source, contents)),
        _document(source, contents, records),
        [{"source": source, **record} for record in records],
    )


def _blocks(source: str, contents: LogContents) -> Iterator[blocks.Block]:
    frames, identifiers = plural(contents.frames, "frame"), plural(len(contents.identifiers), "identifier")
    day = f" of {contents.day}" if contents.day else ""
    words = f": {frames} of {identifiers} in {contents.duration_s:.3g} s{day}; no plan is beside it."
    yield blocks.Sentence((blocks.Code(source), words))
    yield _load(contents)
    if contents.largest_gap_us is not None:
        yield blocks.sentence(
            "No frame for up to {}, until {} (frame {}).",
            blocks.ShownValue(contents.largest_gap_us, "largest_gap_us", "us", 0),
            blocks.ShownValue(contents.largest_gap_s, "largest_gap_s", "s", 6, fixed=True),
            blocks.ShownValue(contents.largest_gap_frame, "largest_gap_frame"),
        )
    yield from _faults(contents)
    if contents.looks_like_canopen:
        yield blocks.Sentence(("It looks like CANopen: names are assumed, those of its predefined connection set.",))
    yield from _emergencies(contents)
    yield _table(contents)
    yield blocks.Sentence((_stamps(contents),))
    yield from (blocks.Sentence((remark,)) for remark in contents.remarks)
    if not contents.is_synthetic:
        rate_kbit_s = contents.bit_rate_kbit_s
        given = f"{rate_kbit_s:g}" if rate_kbit_s else "RATE"
        rate = "" if contents.bit_rate_is_assumed else f" --bit-rate {given}"
        line = f"busplan import {quote(source)}{rate} -o machine.toml"
        yield blocks.sentence("The way to a plan of this machine: {}", blocks.Code(line))


def _load(contents: LogContents) -> blocks.Sentence:
    if contents.bit_rate_kbit_s is None:
        likely = ((rate, load) for rate, load in contents.possible_loads.items() if rate in _USUAL)
        loads = ", ".join(f"{100 * load:.2g} % at {rate:g}" for rate, load in likely)
        words = f"; the fullest second has {loads} kbit/s" if loads else ""
        return blocks.Sentence((f"It does not show the bit rate of its bus: --bit-rate RATE gives the load{words}.",))
    source = "assumed, by frames back to back" if contents.bit_rate_is_assumed else "as given"
    if contents.load is None or contents.fullest_load is None:
        return blocks.Sentence((f"Bit rate {contents.bit_rate_kbit_s:g} kbit/s, {source}; its stamps show no load.",))
    data = ""
    if contents.data_bit_rate_kbit_s is not None:
        data = f", data at {contents.data_bit_rate_kbit_s:g}"
        data += ", assumed" if contents.data_bit_rate_is_assumed else ""
    most = max(contents.identifiers, key=lambda row: row.load or 0.0)
    return blocks.sentence(
        f"Load {{}}, in the fullest second {{}}, at {contents.bit_rate_kbit_s:g} kbit/s ({source}){data}; "
        f"most of it {most.identifier:#x}, {{}}.",
        blocks.ShownValue(contents.load, "load", "%", 1),
        blocks.ShownValue(contents.fullest_load, "fullest_load", "%", 1),
        blocks.ShownValue(most.load, "load", "%", 1),
    )


def _faults(contents: LogContents) -> Iterator[blocks.Sentence]:
    if contents.error_frames:
        ends = [
            (contents.first_error_s, contents.first_error_frame),
            (contents.last_error_s, contents.last_error_frame),
        ]
        at = [f"frame {frame}" if at_s is None else f"{at_s:.6f} s (frame {frame})" for at_s, frame in ends]
        last = f", the last at {at[1]}" if contents.error_frames > 1 else ""
        words = blocks.Words(plural(contents.error_frames, "error frame"), "fails")
        yield blocks.Sentence((words, f": the first at {at[0]}{last}; not in the load."))
    else:
        yield blocks.Sentence(("No error frame.",))
    if contents.dropped_frames:
        words = blocks.Words(f"The recorder dropped {plural(contents.dropped_frames, 'frame')}", "warns")
        yield blocks.Sentence((words, ": what is missing may have been on the bus."))


def _emergencies(contents: LogContents) -> Iterator[blocks.Block]:
    if not contents.looks_like_canopen:
        return
    if not contents.emergencies:
        yield blocks.Sentence(("No emergency.",))
        return
    number, nodes = sum(one.messages for one in contents.emergencies), {one.node for one in contents.emergencies}
    words = blocks.Words(f"{number:,} emergenc{'y' if number == 1 else 'ies'}", "fails")
    rows = tuple(
        blocks.TableRow(_emergency(one), is_detail=place >= _SHOWN) for place, one in enumerate(contents.emergencies)
    )
    yield blocks.Sentence((words, f" of {plural(len(nodes), 'node')}; error code 0x0000 says that one is over:"))
    yield blocks.Table(_EMERGENCIES, rows)


def _emergency(one: RecordedEmergency) -> tuple[blocks.Cell, ...]:
    return (
        blocks.ShownValue(one.node, "node"),
        f"0x{one.error_code:04X}",
        f"0x{one.register:02X}",
        blocks.ShownValue(one.messages, "messages", grouped=True),
        blocks.ShownValue(one.first_s, "first_s", "s", 6, fixed=True),
        blocks.ShownValue(one.first_frame, "first_frame"),
        blocks.ShownValue(one.last_s, "last_s", "s", 6, fixed=True),
    )


def _table(contents: LogContents) -> blocks.Table:
    often = sorted(contents.identifiers, key=lambda row: -row.frames)[:_SHOWN]
    shown = {(row.identifier, row.identifier_bits) for row in often}
    rows = (
        blocks.TableRow(_row(row, contents.duration_s), is_detail=(row.identifier, row.identifier_bits) not in shown)
        for row in contents.identifiers
    )
    return blocks.Table(_COLUMNS, tuple(rows), stacks=True)


def _row(row: RecordedIdentifier, duration_s: float) -> tuple[blocks.Cell, ...]:
    name = " ".join(filter(None, (row.canopen, str(row.node or ""))))
    formats = "29 bits" if row.identifier_bits == 29 else "", "" if row.frame_format == "CAN" else row.frame_format  # noqa: PLR2004
    comes = row.comes if row.burst is None else f"burst of {row.burst:,}"
    if row.missing:
        comes += f", {row.missing:,} missing"
    if row.period_us and row.last_s - row.first_s + row.period_us / 1e6 < _ALWAYS * duration_s:
        comes += f", from {row.first_s:.1f} to {row.last_s:.1f} s"
    size = f"{row.most_bytes}" if row.least_bytes == row.most_bytes else f"{row.least_bytes}-{row.most_bytes}"

    def us(name: str) -> blocks.ShownValue:
        return blocks.ShownValue(getattr(row, name), name, "us", 0, fixed=True)

    return (
        f"{row.identifier:#0{5 if row.identifier_bits == 11 else 10}x}",  # noqa: PLR2004 - digits
        ", ".join(filter(None, (name, *formats))),
        comes,
        blocks.ShownValue(row.frames, "frames", grouped=True),
        us("median_gap_us"),
        us("least_gap_us"),
        us("largest_gap_us"),
        blocks.ShownValue(row.largest_gap_s, "largest_gap_s", "s", 6, fixed=True),
        blocks.ShownValue(row.largest_gap_frame, "largest_gap_frame"),
        size,
        blocks.ShownValue(row.load, "load", "%", 2, fixed=True),
    )


def _stamps(contents: LogContents) -> str:
    """What the stamps can show."""
    if not contents.stamp_step_us:
        return "All frames have one stamp: it shows no times."
    step = f"Stamps have steps of {contents.stamp_step_us:,.0f} us"
    if 2e-6 * contents.stamp_step_us * max(row.frames for row in contents.identifiers) > contents.duration_s:
        return f"{step}, too coarse for these frames: gaps and bursts are those of the stamps."
    if contents.late_stamps_us > contents.stamp_step_us + 1:
        late = f"{contents.late_stamps_us:,.0f} us"
        return f"{step}, and frames closer than the bus sends them show that they are up to {late} late."
    return f"{step}; nothing shows that they are late."


def _document(source: str, contents: LogContents, records: list[blocks.Record]) -> blocks.JsonDocument:
    values = {field.name: getattr(contents, field.name) for field in fields(contents)}
    loads = contents.possible_loads.items()
    return document(
        "measured",
        profile=None,
        source=source,
        **{
            **values,
            "day": contents.day or None,
            "possible_loads": [{"bit_rate_kbit_s": rate, "fullest_load": load} for rate, load in loads],
            "remarks": list(contents.remarks),
            "emergencies": [one._asdict() for one in contents.emergencies],
            "identifiers": records,
        },
    )
