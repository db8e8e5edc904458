"""`busplan.latency`."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from operator import itemgetter
from typing import Final, NamedTuple

from busplan.buses.figure import Figure
from busplan.buses.network import Network
from busplan.elementwise import Number, existing, within
from busplan.english import listed
from busplan.errors import BusplanError
from busplan.forms import blocks
from busplan.forms.numbers import known_text
from busplan.questions.base import sentences
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    Models,
    ProfileLike,
    checked_models,
    load_network,
    one_or_several,
    whole_number,
    with_its_constants,
)
from busplan.questions.fit.figures import FitFigures, figures
from busplan.questions.fit.network import not_applicable, warnings_of, with_payloads
from busplan.sections.base import TRANSACTION_KINDS
from busplan.sections.cycle import TableExecution
from busplan.sections.profile import Profile


class Transaction(NamedTuple):
    """The phases of a read or a write of the farthest node, of a message, or of a whole cycle."""

    timing_model: str
    transaction: str
    group: str
    """Name of its group of nodes; empty where all are alike."""
    payload_bytes: int | None
    nodes: int
    phases: Mapping[str, float | None]
    """Figures by their key in the register of the bus."""


@dataclass(frozen=True, slots=True, repr=False)
class LatencyAnswer(Answer):
    """Answer of `latency`.

    Parameters
    ----------
    profile
        The network.
    subject
        What has these latencies, in words.
    tables
        The transactions with each payload, each under every timing model; without payloads as the profile has them.
    deciding
        The verdict with each payload.
    deadlines
        Whether all messages keep their deadlines, and which is the closest; empty where there are none.
    notes
        Timing models that do not apply, the grade of the execution times, and warnings.
    """

    profile: Profile
    subject: str
    tables: tuple[tuple[Transaction, ...], ...]
    deciding: tuple[FitFigures, ...]
    deadlines: tuple[blocks.Sentence, ...]
    notes: tuple[blocks.Sentence, ...]

    @property
    def transactions(self) -> tuple[Transaction, ...]:
        """One transaction for each payload, kind and timing model, nested in this order, with its `phases`."""
        return tuple(transaction for table in self.tables for transaction in table)

    def report(self) -> blocks.Report:
        """The answer in blocks."""
        name, records = self.profile.name, _records(self.transactions)
        # Other payloads are those of another machine.
        verdict = (
            sentences.fields(self.deciding[0], "verdict", "exceeded", "not_shown") if len(self.deciding) == 1 else {}
        )
        return blocks.Report(
            blocks.Sentence(("Latency of ", blocks.Code(name))),
            tuple(_blocks(self)),
            sentences.document("latency", profile=name, **verdict, transactions=records),
            sentences.with_profile(name, records),
        )

    def _headline(self) -> str:
        return f"{self.profile.name}: {self.subject}"


@with_its_constants
def latency(
    profile: ProfileLike,
    *,
    payload_bytes: int | Iterable[int] | None = None,
    timing_model: Models | None = None,
) -> LatencyAnswer:
    """Show the delay of data, phase by phase, as `busplan latency` does.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    payload_bytes
        Payload of both read and write [bytes], or n of them; by default the profile's own.
    timing_model
        Name of a timing model, or several in this order; by default all of the kind of bus. IEEE 1394 has "paper" for
        the paper's equations as published, and "standard" for the standard's clock and packets.

    Returns
    -------
    LatencyAnswer
        Its `transactions`: on IEEE 1394 2 n for each timing model, a read and a write; on CAN one for each message.
        Times are in us.

    Raises
    ------
    BusplanError
        Not a profile, an invalid payload or one whose execution time is not known, or an unknown timing model.

    References
    ----------
    Paper, equations (3)-(10), (12)-(14).

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.latency("paper-two-node", payload_bytes=[4, 1024], timing_model="paper")
    >>> [(row.transaction, row.payload_bytes, round(row.phases["latency_us"], 2)) for row in answer.transactions]
    [('read', 4, 43.17), ('write', 4, 43.17), ('read', 1024, 474.57), ('write', 1024, 474.57)]
    """
    network = load_network(profile)
    models = checked_models(timing_model, network)
    networks = [network]
    if payload_bytes is not None:
        given = one_or_several(payload_bytes, name="payload_bytes")
        sizes = [whole_number(size, name="payload_bytes") for size in given]
        _require_execution(network.profile, sizes)
        networks = [with_payloads(network, [*_payloads(network, size)]) for size in sizes]
    tables = tuple(_transactions(variant, models) for variant in networks)
    deciding = tuple(figures(variant, model=variant.bus.deciding_model) for variant in networks)
    return LatencyAnswer(
        network.profile,
        networks[0].bus.latency_subject(networks[0]),
        tables,
        deciding,
        tuple(_deadline_sentence(networks, tables, deciding)),
        tuple(_notes(networks)),
    )


def _payloads(network: Network, size: int) -> Iterator[tuple[int, int]]:
    """A payload for the read and the write of each group; nodes that are only read or written stay so [bytes]."""
    for nodes in network.profile.node_groups:
        read, write = (size if nodes.bytes_of(kind) else 0 for kind in TRANSACTION_KINDS)
        yield read, write


def _require_execution(profile: Profile, payloads_bytes: Sequence[int]) -> None:
    """Refuse payloads whose execution time is not known, all in one error."""
    unknown = dict.fromkeys(
        f"payload {size} bytes: outside the execution table of {group.name or profile.name}, {execution.range_bytes}; "
        "nothing is extrapolated"
        for group in profile.node_groups
        if isinstance(execution := group.node.execution, TableExecution)
        for size in payloads_bytes
        if not execution.covers(size)
    )
    if unknown:
        raise BusplanError(*unknown)


def _transactions(network: Network, models: Sequence[str]) -> tuple[Transaction, ...]:
    nodes = int(network.nodes)
    by_model = (network.bus.cycle(network, model=model).latencies() for model in models)
    return tuple(
        Transaction(model, phased.name, phased.group, phased.payload_bytes, nodes, _shown_phases(phased.phases))
        for of_models in zip(*by_model, strict=True)
        for model, phased in zip(models, of_models, strict=True)
    )


def _shown_phases(phases: Mapping[str, Number]) -> dict[str, float | None]:
    """Phases in plain numbers, the sizes of packets whole; None for one that does not exist."""
    numbers = {key: existing(value) for key, value in phases.items()}
    return {
        key: int(value) if value is not None and key.endswith("_bytes") else value for key, value in numbers.items()
    }


def _records(transactions: Sequence[Transaction]) -> list[blocks.Record]:
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


def _blocks(answer: LatencyAnswer) -> Iterator[blocks.Block]:
    """The loop over the host in a sentence, and the phases of each transaction; one table for each payload."""
    register = answer.deciding[0].bus_figures
    # Of one payload and of nodes that are alike.
    decided = [row for row in answer.transactions if row.timing_model == answer.deciding[0].timing_model]
    phases = {row.transaction: row.phases for row in decided}
    loop = phases.get("loop") if len(phases) == len(decided) else None
    yield from answer.deadlines
    if loop and not register.deadlines:
        whole = register.latency_table[-1].key
        times = [blocks.ShownValue(phases[name][whole], whole, "us", 0) for name in ("command", "feedback", "loop")]
        yield blocks.sentence("A command acts after {}, feedback is {} old, a loop takes {}.", *times)
    yield from _tables(answer)
    if loop and register.deadlines and loop[register.deadlines[0]] is not None:
        keys = (register.deadlines[0], *(key for key in _OF_LOOP if loop[key]))
        parts = [words for key, words in _OF_LOOP.items() if key in keys]
        effect = "SYNC that applies the command" if "sync_wait_us" in keys else "executed command"
        of_which = f", of which {listed(parts, 'and')}" if parts else ""
        whole = f"Loop: {{}} from SYNC to the {effect}{of_which}."
        yield blocks.sentence(whole, *(blocks.ShownValue(loop[key], key, "us", 0) for key in keys))
    yield from answer.notes


_OF_LOOP: Final = {
    "adapter_us": "{} are the adapter's",
    "pipeline_us": "{} are the host's cycles",
    "sync_wait_us": "{} the wait for that SYNC",
}
"""Parts of a loop that are no work, in words."""


def _notes(networks: Sequence[Network]) -> Iterator[blocks.Sentence]:
    """Timing models that do not apply, the grade of the execution times, and warnings."""
    network = networks[0]
    for model, keys in not_applicable(network).items():
        yield blocks.Sentence((f"The {model} model is not applicable: it has no {', '.join(keys)}.",))
    yield from sentences.execution_sentence(network, of_latency=True)
    broken = (limit.words(variant) for variant in networks for limit in variant.bus.broken(variant))
    yield from sentences.warning_sentences((*dict.fromkeys(broken), *warnings_of(network)))


def _deadline_sentence(
    networks: Sequence[Network], tables: Sequence[Sequence[Transaction]], deciding: Sequence[FitFigures]
) -> Iterator[blocks.Sentence]:
    """Say whether all transactions keep their deadlines by the model of the verdict, and which is the closest."""
    bus = networks[0].bus
    keys, model = bus.figures.deadlines, bus.deciding_model
    due = [
        (share, transaction)
        for table in tables
        for transaction in table
        if transaction.timing_model == model and (share := _share(transaction, keys))
    ]
    if not keys or not due:
        return
    late = sum(not within(share, 1.0) for share, _ in due)
    _, latest = max(due, key=itemgetter(0))
    us, deadline_us = (latest.phases[key] for key in keys)
    misses = "misses its deadline" if late == 1 else "miss their deadlines"
    is_kept = f"{late} of {len(due)} messages {misses}" if late else "Every message keeps its deadline"
    limits = [limit for limit in bus.limits if limit.of_deadlines]
    not_shown = dict.fromkeys(
        limit.words(network)
        for network, verdict in zip(networks, deciding, strict=True)
        for limit in limits
        if limit.key in (verdict.not_shown or ())
    )
    is_broken = any(limit.key in verdict.exceeded for limit in limits for verdict in deciding)
    state: blocks.State = "fails" if late else "neutral"
    why = f"; not shown: {'; '.join(not_shown)}" if not_shown else ""
    if not_shown and not is_broken:
        is_kept, state = "NOT SHOWN that every message keeps its deadline", "warns"
    time = "has no worst-case response time"
    if us is not None and deadline_us is not None:
        time = f"takes up to {known_text(us, None)} us of {known_text(deadline_us, None)}"
    yield blocks.Sentence((f"{is_kept} by the {model} model; {_name(latest)} {time}{why}.",), state)


def _share(transaction: Transaction, keys: tuple[str, str] | None) -> float:
    """Time of a transaction over its deadline [1]: infinite without a time, 0 without a deadline."""
    us, deadline_us = (transaction.phases[key] for key in keys) if keys else (None, None)
    if deadline_us is None:
        return 0.0
    return inf if us is None else us / deadline_us


def _tables(answer: LatencyAnswer) -> Iterator[blocks.Block]:
    """Phases of the transactions in us; one table for each payload, or, of many transactions, for each timing model."""
    register, deciding = answer.deciding[0].bus_figures, answer.deciding[0].timing_model
    figures = [
        figure
        for figure in register.latency_table
        if all(figure.key in transaction.phases for transaction in answer.transactions)
    ]
    if register.has_many_transactions:
        yield from _by_transaction(answer, figures, register.deadlines)
        return
    caption = blocks.Sentence(("Phases of ", blocks.Code(answer.profile.name), f" in us, {answer.subject}"))
    for table in answer.tables:
        columns = [
            sentences.FigureColumn(
                blocks.TableColumn(
                    transaction.timing_model,
                    group=_name(transaction),
                    is_detail=_is_beside(transaction, table, deciding),
                ),
                transaction.phases,
            )
            for transaction in table
        ]
        shown = set(register.latency_shown or (figure.key for figure in figures))
        yield sentences.figure_table(
            [(figure, 0) for figure in figures],
            columns,
            caption=caption,
            unit=False,
            hides_equations=True,
            is_detail=partial(_is_detail, shown, table),
        )


def _is_detail(shown: Collection[str], table: Sequence[Transaction], figure: Figure) -> bool:
    """Whether a figure is not among those shown by default, or no transaction of the table has it."""
    return figure.key not in shown or not any(transaction.phases[figure.key] for transaction in table)


def _is_beside(transaction: Transaction, table: Sequence[Transaction], deciding: str) -> bool:
    """Whether a transaction stands beside those of the model that decides."""
    return transaction.timing_model != deciding and any(other.timing_model == deciding for other in table)


_MOST_ROWS: Final = 15
"""Transactions of a table beyond which it shows so many of them."""


def _by_transaction(
    answer: LatencyAnswer, figures: Sequence[Figure], deadlines: tuple[str, str] | None
) -> Iterator[blocks.Block]:
    """One row for each transaction; one table for each payload and timing model, the deciding one in any answer.

    A time and its deadline come first. Of many transactions those closest to their deadlines are shown. What is 0 for
    all has no column.
    """
    figures = [
        figure for figure in figures if any(transaction.phases[figure.key] for transaction in answer.transactions)
    ]
    figures.sort(key=lambda figure: figure.key not in (deadlines or ()))
    columns = (
        blocks.TableColumn("message", kind="words"),
        *(blocks.TableColumn(figure.label, rank=_rank(figure, deadlines)) for figure in figures),
    )
    deciding = answer.deciding[0].timing_model
    for table in answer.tables:
        has_deciding = any(transaction.timing_model == deciding for transaction in table)
        for models, of_models in _by_models(table, figures):
            shares = [(row, _share(row, deadlines)) for row in of_models]
            least = sorted((share for _, share in shares), reverse=True)[:_MOST_ROWS][-1]
            rows = (
                blocks.TableRow(
                    (_name(transaction), *(blocks.attribute_value(figure, transaction.phases) for figure in figures)),
                    is_detail=share < least,
                )
                for transaction, share in shares
            )
            by = f" by the {' and the '.join(models)} model in us, {answer.subject}"
            caption = blocks.Sentence((blocks.Code(answer.profile.name), by))
            shown = blocks.Table(columns, tuple(rows), caption, heads=1)
            beside = has_deciding and deciding not in models
            yield blocks.Detail((shown,), f"the {' and the '.join(models)} model") if beside else shown


def _rank(figure: Figure, deadlines: tuple[str, str] | None) -> int:
    """A narrow terminal keeps the time and its deadline, and leaves out what is no time first."""
    return 0 if figure.key in (deadlines or ()) else 1 if figure.unit == "us" else 2


def _by_models(
    table: Sequence[Transaction], figures: Sequence[Figure]
) -> Iterator[tuple[list[str], list[Transaction]]]:
    """Transactions of each timing model; models with the same figures share one entry under all their names."""
    of_model: dict[str, list[Transaction]] = {}
    for transaction in table:
        of_model.setdefault(transaction.timing_model, []).append(transaction)
    alike: dict[tuple[object, ...], list[str]] = {}
    for model, rows in of_model.items():
        shown = tuple((_name(row), *(row.phases[figure.key] for figure in figures)) for row in rows)
        alike.setdefault(shown, []).append(model)
    yield from ((models, of_model[models[0]]) for models in alike.values())


def _name(transaction: Transaction) -> str:
    """Name of a transaction: its group, its kind and its payload."""
    payload = "" if transaction.payload_bytes is None else f"{transaction.payload_bytes} B"
    return " ".join(filter(None, (transaction.group, transaction.transaction, payload)))
