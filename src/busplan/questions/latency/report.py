"""Answer of `busplan latency`."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import inf
from operator import itemgetter
from typing import Final

from busplan.buses.figure import Figure
from busplan.elementwise import within
from busplan.forms.blocks import (
    Block,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    Table,
    TableColumn,
    TableRow,
    attribute_value,
)
from busplan.questions.base.sentences import (
    Owner,
    document,
    execution_sentence,
    figure_table,
    not_applicable,
    warning_sentences,
    with_profile,
)
from busplan.questions.latency import LatencyResult, Transaction, with_payload


def latency_report(result: LatencyResult) -> Report:
    """Report of `latency`."""
    return Report(
        Sentence(("Latency of ", Code(result.profile.name))),
        tuple(_blocks(result)),
        latency_document(result),
        with_profile(result.profile.name, latency_records(result)),
    )


def _blocks(result: LatencyResult) -> Iterator[Block]:
    """Phases of each transaction, the timing models side by side; one table for each payload."""
    network = result.network
    yield from _deadline_sentence(result)
    yield from latency_tables(result)
    yield Sentence((Code(network.profile.name), f": {network.bus.latency_subject(network)}."))
    yield from not_applicable(network)
    yield from execution_sentence(network, of_latency=True)
    yield from (Sentence((f"Warning: {words}.",), "warns") for words in _over(result))
    yield from warning_sentences(network)


def latency_tables(result: LatencyResult) -> Iterator[Table]:
    """Phases of the transactions in us; one table for each payload, or, of many transactions, for each timing model."""
    bus = result.network.bus
    figures = tuple(
        figure
        for figure in bus.figures.latency_table
        if all(figure.key in transaction.phases for transaction in result.transactions)
    )
    subject = bus.latency_subject(result.network)
    if bus.figures.has_many_transactions:
        yield from _by_transaction(result, figures, subject)
        return
    rows = [(figure, 0) for figure in figures]
    caption = Sentence((f"Phases in us, {subject}",))
    for _, group in groupby(_numbered(result.transactions), key=lambda transaction: transaction[0]):
        owners = [Owner(_column(transaction), transaction.phases) for _, transaction in group]
        yield figure_table(rows, owners, caption=caption, unit=False)


def _by_transaction(result: LatencyResult, figures: Sequence[Figure], subject: str) -> Iterator[Table]:
    """One row for each transaction; one table for each payload and timing model.

    A time and its deadline come first. Of many transactions those closest to their deadlines are shown. What is 0 for
    all has no column.
    """
    first = result.network.bus.figures.deadlines or ()
    figures = [
        figure for figure in figures if any(transaction.phases[figure.key] for transaction in result.transactions)
    ]
    figures.sort(key=lambda figure: figure.key not in first)
    columns = (TableColumn("message", kind="words"), *(TableColumn(figure.label) for figure in figures))
    tables: dict[tuple[int, str], list[Transaction]] = {}
    for number, transaction in _numbered(result.transactions):
        tables.setdefault((number, transaction.timing_model), []).append(transaction)
    for (_, model), transactions in tables.items():
        least = sorted((_share(result, transaction) for transaction in transactions), reverse=True)[:_MOST_ROWS][-1]
        rows = (
            TableRow(
                (_name(transaction), *(attribute_value(figure, transaction.phases) for figure in figures)),
                is_detail=len(transactions) > _MOST_ROWS and _share(result, transaction) < least,
            )
            for transaction in transactions
        )
        yield Table(columns, tuple(rows), Sentence((f"By the {model} model in us, {subject}",)), heads=1)


_MOST_ROWS: Final = 30
"""Transactions of a table beyond which it shows so many of them."""


def _share(result: LatencyResult, transaction: Transaction) -> float:
    """Time of a transaction over its deadline [1]: infinite without a time, 0 without a deadline."""
    keys = result.network.bus.figures.deadlines
    us, deadline_us = (transaction.phases[key] for key in keys) if keys else (None, None)
    if not isinstance(deadline_us, int | float):
        return 0.0
    return us / deadline_us if isinstance(us, int | float) else inf


def _deadline_sentence(result: LatencyResult) -> Iterator[Sentence]:
    """Say whether all transactions keep their deadlines by the model of the verdict, and which is the closest."""
    keys, model = result.network.bus.figures.deadlines, result.network.bus.deciding_model
    due = [
        (share, transaction)
        for transaction in result.transactions
        if transaction.timing_model == model and (share := _share(result, transaction))
    ]
    if not keys or not due:
        return
    late = sum(not within(share, 1.0) for share, _ in due)
    share, latest = max(due, key=itemgetter(0))
    us, deadline_us = (latest.phases[key] for key in keys)
    misses = "misses its deadline" if late == 1 else "miss their deadlines"
    is_kept = f"{late} of {len(due)} messages {misses}" if late else "Every message keeps its deadline"
    time = "has no worst-case response time" if us is None else f"takes up to {us:g} us of {deadline_us:g}"
    yield Sentence((f"{is_kept} by the {model} model; {_name(latest)} {time}.",), "fails" if late else "neutral")


def _numbered(transactions: Sequence[Transaction]) -> Iterator[tuple[int, Transaction]]:
    """Each transaction with the number of its table; a repeated one begins a new table."""
    seen: set[tuple[str, str, str]] = set()
    number = 0
    for transaction in transactions:
        key = (transaction.timing_model, transaction.transaction, transaction.group)
        if key in seen:
            number, seen = number + 1, set()
        seen.add(key)
        yield number, transaction


def _column(transaction: Transaction) -> TableColumn:
    return TableColumn(transaction.timing_model, group=_name(transaction))


def _name(transaction: Transaction) -> str:
    """Name of a transaction: its group, its kind and its payload."""
    payload = "" if transaction.payload_bytes is None else f"{transaction.payload_bytes} B"
    return " ".join(filter(None, (transaction.group, transaction.transaction, payload)))


def _over(result: LatencyResult) -> list[str]:
    """Limits of the bus that the profile breaks with any of the payloads asked for, or with its own."""
    networks = [with_payload(result.network, size) for size in result.payloads_bytes] or [result.network]
    broken = (limit.words(network) for network in networks for limit in network.bus.broken(network))
    return list(dict.fromkeys(broken))


def latency_records(result: LatencyResult) -> list[Record]:
    """One flat row for each transaction and its phases; all have a group where one has, None for what has none."""
    has_groups = any(transaction.group for transaction in result.transactions)
    return [_record(transaction, has_groups=has_groups) for transaction in result.transactions]


def _record(transaction: Transaction, *, has_groups: bool) -> Record:
    record = transaction._asdict()
    phases = record.pop("phases")
    group = record.pop("group")
    named = {"timing_model": record.pop("timing_model"), "transaction": record.pop("transaction")}
    return {**named, **({"group": group or None} if has_groups else {}), **record, **phases}


def latency_document(result: LatencyResult) -> JsonDocument:
    """Document of `busplan latency --format json`."""
    return document("latency", profile=result.profile.name, transactions=latency_records(result))
