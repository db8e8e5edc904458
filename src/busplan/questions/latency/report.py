"""Answer of `busplan latency`."""

from collections.abc import Iterator, Sequence
from math import inf
from operator import itemgetter
from typing import Final

from busplan.buses.figure import Figure
from busplan.elementwise import within
from busplan.forms.blocks import (
    Block,
    Code,
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
    warning_sentences,
    with_profile,
)
from busplan.questions.latency import LatencyAnswer, Transaction


def latency_report(answer: LatencyAnswer) -> Report:
    """Report of `latency`."""
    name, records = answer.profile.name, _records(answer.transactions)
    return Report(
        Sentence(("Latency of ", Code(name))),
        tuple(_blocks(answer)),
        document("latency", profile=name, transactions=records),
        with_profile(name, records),
    )


def _records(transactions: Sequence[Transaction]) -> list[Record]:
    """One flat row for each transaction and its phases; all have a group where one has, None for what has none."""
    has_groups = any(transaction.group for transaction in transactions)
    return [
        {
            "timing_model": transaction.timing_model,
            "transaction": transaction.transaction,
            **({"group": transaction.group or None} if has_groups else {}),
            "payload_bytes": transaction.payload_bytes,
            "nodes": transaction.nodes,
            **transaction.phases,
        }
        for transaction in transactions
    ]


def _blocks(answer: LatencyAnswer) -> Iterator[Block]:
    """Phases of each transaction, the timing models side by side; one table for each payload."""
    network = answer.networks[0]
    yield from _deadline_sentence(answer)
    yield from _tables(answer)
    yield Sentence((Code(answer.profile.name), f": {answer.subject}."))
    for model in network.bus.timing_models:
        if keys := network.bus.cannot_express(network, model=model.name):
            yield Sentence((f"The {model.name} model is not applicable: it has no {', '.join(keys)}.",))
    yield from execution_sentence(network, of_latency=True)
    broken = (limit.words(network) for network in answer.networks for limit in network.bus.broken(network))
    yield from (Sentence((f"Warning: {words}.",), "warns") for words in dict.fromkeys(broken))
    yield from warning_sentences(network)


def _deadline_sentence(answer: LatencyAnswer) -> Iterator[Sentence]:
    """Say whether all transactions keep their deadlines by the model of the verdict, and which is the closest."""
    bus = answer.networks[0].bus
    keys, model = bus.figures.deadlines, bus.deciding_model
    due = [
        (share, transaction)
        for transaction in answer.transactions
        if transaction.timing_model == model and (share := _share(transaction, keys))
    ]
    if not keys or not due:
        return
    late = sum(not within(share, 1.0) for share, _ in due)
    _, latest = max(due, key=itemgetter(0))
    us, deadline_us = (latest.phases[key] for key in keys)
    misses = "misses its deadline" if late == 1 else "miss their deadlines"
    is_kept = f"{late} of {len(due)} messages {misses}" if late else "Every message keeps its deadline"
    time = "has no worst-case response time" if us is None else f"takes up to {us:g} us of {deadline_us:g}"
    yield Sentence((f"{is_kept} by the {model} model; {_name(latest)} {time}.",), "fails" if late else "neutral")


def _share(transaction: Transaction, keys: tuple[str, str] | None) -> float:
    """Time of a transaction over its deadline [1]: infinite without a time, 0 without a deadline."""
    us, deadline_us = (transaction.phases[key] for key in keys) if keys else (None, None)
    if deadline_us is None:
        return 0.0
    return inf if us is None else us / deadline_us


def _tables(answer: LatencyAnswer) -> Iterator[Table]:
    """Phases of the transactions in us; one table for each payload, or, of many transactions, for each timing model."""
    register = answer.networks[0].bus.figures
    figures = [
        figure
        for figure in register.latency_table
        if all(figure.key in transaction.phases for transaction in answer.transactions)
    ]
    if register.has_many_transactions:
        yield from _by_transaction(answer, figures, register.deadlines)
        return
    caption = Sentence((f"Phases in us, {answer.subject}",))
    for table in answer.tables:
        owners = [
            Owner(TableColumn(transaction.timing_model, group=_name(transaction)), transaction.phases)
            for transaction in table
        ]
        yield figure_table([(figure, 0) for figure in figures], owners, caption=caption, unit=False)


_MOST_ROWS: Final = 30
"""Transactions of a table beyond which it shows so many of them."""


def _by_transaction(
    answer: LatencyAnswer, figures: Sequence[Figure], deadlines: tuple[str, str] | None
) -> Iterator[Table]:
    """One row for each transaction; one table for each payload and timing model.

    A time and its deadline come first. Of many transactions those closest to their deadlines are shown. What is 0 for
    all has no column.
    """
    figures = [
        figure for figure in figures if any(transaction.phases[figure.key] for transaction in answer.transactions)
    ]
    figures.sort(key=lambda figure: figure.key not in (deadlines or ()))
    columns = (TableColumn("message", kind="words"), *(TableColumn(figure.label) for figure in figures))
    for table in answer.tables:
        for model in dict.fromkeys(transaction.timing_model for transaction in table):
            shares = [(row, _share(row, deadlines)) for row in table if row.timing_model == model]
            least = sorted((share for _, share in shares), reverse=True)[:_MOST_ROWS][-1]
            rows = (
                TableRow(
                    (_name(transaction), *(attribute_value(figure, transaction.phases) for figure in figures)),
                    is_detail=share < least,
                )
                for transaction, share in shares
            )
            yield Table(columns, tuple(rows), Sentence((f"By the {model} model in us, {answer.subject}",)), heads=1)


def _name(transaction: Transaction) -> str:
    """Name of a transaction: its group, its kind and its payload."""
    payload = "" if transaction.payload_bytes is None else f"{transaction.payload_bytes} B"
    return " ".join(filter(None, (transaction.group, transaction.transaction, payload)))
