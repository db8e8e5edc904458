"""Figures of IEEE 1394: settings of the bus, terms of the cycle, latencies and the phases of a transaction."""

from dataclasses import dataclass
from itertools import chain
from typing import Final

from busplan.buses.figure import (
    NODES,
    NONPERIODIC,
    PAYLOAD_BYTES,
    TIMING_MODEL,
    TRANSACTION,
    BusFigures,
    Figure,
    Ink,
    OwnFigures,
    Wait,
    by,
)
from busplan.buses.ieee1394 import equations as eq

_LATENCY: Final = by(eq.transaction_latency_us)
_ACKNOWLEDGE: Final = by(eq.acknowledge_phase_us, eq.acknowledge_us)
_WITH_GAPS: Final = by(eq.transaction_latency_us, eq.gaps_us)

HOPS: Final = Figure("hops", "H", "profile", "cable hops to the farthest node", "hops", "1", "count")
GAP_COUNT: Final = Figure("gap_count", "g", "profile", "gap count in force", "gap count", "1", "count", relative=False)
SAFE_GAP_COUNT: Final = Figure(
    "safe_gap_count",
    "g_safe",
    "table",
    "smallest safe gap count for the hops",
    "smallest safe gap count",
    "1",
    "count",
    relative=False,
)
GAP_COUNT_SAFE: Final = Figure(
    "gap_count_safe",
    "safe",
    "table",
    "whether the gap count is at least that",
    "gap count is safe",
    sort="truth",
    better="more",
)
_SETUP: Final = (HOPS, GAP_COUNT, SAFE_GAP_COUNT, GAP_COUNT_SAFE)

SYNC: Final = Figure(
    "sync_us",
    "CTS",
    "profile",
    "the synchronous packet that opens a cycle",
    "synchronous packet CTS",
    ink="sync",
    letter="S",
)


def _term(name: str, reference: str, meaning: str, ink: Ink, letter: str, waits_for: Wait = "wire") -> Figure:
    words, key = name.replace("_", " "), f"cycle_{name}_us"
    return Figure(key, words, reference, meaning, words, ink=ink, letter=letter, waits_for=waits_for)


_STARTS: Final = "cycle start packets, and the isochronous traffic after them"
JITTER: Final = Figure(
    "cycle_jitter_us",
    "J",
    "profile",
    "how late the host may start a cycle",
    "host's jitter",
    ink="contention",
    letter="J",
    waits_for="host",
)
TERMS: Final = (
    JITTER,
    Figure("cycle_starts_us", "cycle starts", "cycle", _STARTS, "cycle starts", ink="sync", letter="C"),
    SYNC,
    _term("arbitration", by(eq.arbitration_phase_us), "all arbitration of a cycle", "contention", "A"),
    _term("data", by(eq.data_phase_us), "all packets of a cycle", "request", "D"),
    _term("acknowledge", _ACKNOWLEDGE, "all acknowledges of a cycle", "acknowledge", "K"),
    _term("hold", "profile", "bus held from acknowledges to concatenated responses", "response", "B"),
    _term("execution", "profile", "all execution of a cycle", "work", "E", "nodes"),
    _term(
        "worst_extra",
        "profile",
        "time of the slowest executions beyond the execution time",
        "work",
        "X",
        waits_for="nodes",
    ),
    _term("idle", "idle", "all idle bus of the gaps, beside execution", "long-gap", "G"),
    _term("host", "profile", "the host's own time beyond the gaps", "contention", "H", "host"),
    _term("retries", "profile", "busy retries of the longest request", "request", "T")._replace(key="retries_us"),
    NONPERIODIC,
)
"""Terms of the cycle in the order of the wire."""
_FIRST: Final = (SYNC, NONPERIODIC)
"""Terms that come first in the document."""

_SUBACTION_GAP: Final = Figure("subaction_gap_us", "T_sub", by(eq.subaction_gap_us), "subaction gap", "subaction gap")
_RESET_GAP: Final = Figure(
    "arbitration_reset_gap_us",
    "T_reset",
    by(eq.arbitration_reset_gap_us),
    "arbitration reset gap",
    "arbitration reset gap",
)
_BOTH_GAPS: Final = Figure("gaps_us", "T_sum", by(eq.gaps_us), "both gaps, after each transaction", "gaps T_sum")


def _of_both(key: str, symbol: str, reference: str, meaning: str, label: str) -> tuple[Figure, ...]:
    """One figure of a read and one of a write, from words with a place for the kind."""
    return tuple(
        Figure(f"{kind}_{key}", symbol.format(kind), reference, meaning.format(kind), label.format(kind), better="less")
        for kind in ("read", "write")
    )


_LATENCIES: Final = _of_both(
    "latency_us", "T_lant,{}", _LATENCY, "one {}, without the gaps after it", "{} latency T_lant"
)
_LATENCIES_WITH_GAPS: Final = _of_both(
    "latency_with_gaps_us", "T_full,{}", _WITH_GAPS, "a {} and both gaps", "{} T_lant + T_sum"
)
_TRANSACTIONS: Final = _of_both("transaction_us", "T_{}", "idle", "time of a {} in the cycle", "{} T_lant + idle")
READS: Final = Figure(
    "reads_us", "T_r", "idle", "all reads of a cycle, with their gaps", "all reads T_r", better="less"
)
WRITES: Final = Figure(
    "writes_us", "T_w", "idle", "all writes of a cycle, with their gaps", "all writes T_w", better="less"
)
_NODES_EQ11: Final = Figure(
    "nodes_eq11",
    "N_11",
    by(eq.published_nodes),
    "number of nodes as published, at the profile's own N",
    "nodes by equation (11)",
    "nodes",
    decimals=2,
)

_PHASES: Final = (
    Figure("query_us", "T_query", "broadcast", "the query with its acknowledge, of the broadcast schedule", "query"),
    Figure("boards_us", "T_boards", "broadcast", "all nodes' broadcasts with their gaps", "broadcasts of all nodes"),
    Figure("hub_wait_us", "T_wait", "broadcast", "from the last broadcast to the read of the hub", "wait for the hub"),
    Figure("request_bytes", "B_req", "packets", "request packet on the wire", "request packet, bytes", sort="count"),
    Figure(
        "response_bytes", "B_resp", "packets", "response packet on the wire", "response packet, bytes", sort="count"
    ),
    Figure("arbitration_us", "ArbP", by(eq.arbitration_phase_us), "arbitration of either packet", "arbitration, each"),
    Figure("request_data_us", "DTP_req", by(eq.data_phase_us), "data phase of the request", "data, request"),
    Figure("response_data_us", "DTP_resp", by(eq.data_phase_us), "data phase of the response", "data, response"),
    Figure(
        "acknowledge_us", "T_ack", _ACKNOWLEDGE, "acknowledge of either packet, T_ack1 = T_ack2", "acknowledge, each"
    ),
    Figure("request_us", "T_req", by(eq.request_us), "arbitration and data of the request", "request T_req"),
    Figure("response_us", "T_resp", by(eq.response_us), "arbitration and data of the response", "response T_resp"),
    Figure(
        "request_and_acknowledge_us",
        "T1+T2",
        by(eq.request_and_acknowledge_us),
        "first half of the transaction",
        "T1+T2",
    ),
    Figure(
        "request_and_acknowledge_eq15_us",
        "T1+T2,15",
        by(eq.published_request_and_acknowledge_us),
        "first half as Table I's theory column has it: one hop, S400, gap count 63, payload of the transaction",
        "T1+T2 by equation (15)",
    ),
    Figure(
        "hold_us",
        "hold",
        "profile",
        "bus held from the acknowledge to a concatenated response",
        "held for the response",
    ),
    Figure("execution_us", "T_exec", "profile", "execution in the node, T3 of the bench", "execution T_exec = T3"),
    Figure(
        "response_and_acknowledge_us",
        "T4+T5",
        by(eq.response_and_acknowledge_us),
        "second half of the transaction",
        "T4+T5",
    ),
    Figure(
        "latency_us",
        "T_lant",
        _LATENCY,
        "the whole transaction, without the gaps after it",
        "latency T_lant",
    ),
    Figure(
        "interval_latency_us",
        "T1+...+T5",
        by(eq.interval_latency_us),
        "latency from the five intervals of the bench, which is T_lant",
        "T1+T2+T3+T4+T5",
    ),
    _SUBACTION_GAP,
    _RESET_GAP,
    _BOTH_GAPS,
    Figure("latency_with_gaps_us", "T_full", _WITH_GAPS, "the transaction and both gaps", "T_lant + T_sum"),
    Figure("worst_extra_us", "T_extra", "profile", "time of the slowest execution beyond T_exec", "slowest execution"),
    Figure("idle_us", "idle", "idle", "idle bus of the gaps, beside execution", "idle bus"),
    Figure("host_us", "host", "profile", "the host's own time beyond the gaps", "host"),
    Figure("transaction_us", "T_trans", "idle", "time of the transaction in the cycle", "time in the cycle"),
    Figure("all_us", "T_r or T_w", "idle", "all reads or all writes of the cycle", "whole cycle, T_r or T_w"),
)
"""Phases in the order of the bench: T1+T2, T3, T4+T5, and the gaps after them."""
LATENCY: Final = (TIMING_MODEL, TRANSACTION, PAYLOAD_BYTES, NODES, HOPS, GAP_COUNT, *_PHASES)

FIGURES: Final = BusFigures(
    TERMS,
    document_terms=(*_FIRST, *(figure for figure in TERMS if figure not in _FIRST)),
    setup=_SETUP,
    headings=(HOPS.key, GAP_COUNT.key),
    added=(*_LATENCIES, *_TRANSACTIONS, READS, WRITES, _BOTH_GAPS, _SUBACTION_GAP, _RESET_GAP),
    counts=(_NODES_EQ11,),
    table=(
        *_LATENCIES,
        *_TRANSACTIONS,
        READS,
        WRITES,
        _BOTH_GAPS._replace(label="gaps T_sum, each transaction"),
        _NODES_EQ11,
        SAFE_GAP_COUNT,
    ),
    compared=tuple(chain(*zip(_LATENCIES, _LATENCIES_WITH_GAPS, _TRANSACTIONS, strict=True))),
    planned=(GAP_COUNT.key, GAP_COUNT_SAFE.key),
    latency_rows=_PHASES,
    latency_shown=(
        *("query_us", "boards_us", "hub_wait_us", "request_and_acknowledge_us", "hold_us", "execution_us"),
        *(
            "response_and_acknowledge_us",
            "latency_us",
            "gaps_us",
            "worst_extra_us",
            "host_us",
            "transaction_us",
            "all_us",
        ),
    ),
    latency_main="transaction_us",
    latency_document=LATENCY,
)


@dataclass(frozen=True)
class Ieee1394Figures(OwnFigures):
    """Figures of IEEE 1394 alone, by the keys of `FIGURES`."""

    hops: int
    gap_count: int
    safe_gap_count: int
    gap_count_safe: bool
    read_latency_us: float
    write_latency_us: float
    read_latency_with_gaps_us: float
    write_latency_with_gaps_us: float
    read_transaction_us: float
    write_transaction_us: float
    gaps_us: float
    subaction_gap_us: float
    arbitration_reset_gap_us: float
    reads_us: float
    writes_us: float
    nodes_eq11: float | None
    cycle_jitter_us: float
    cycle_starts_us: float
    sync_us: float
    cycle_arbitration_us: float
    cycle_data_us: float
    cycle_acknowledge_us: float
    cycle_hold_us: float
    cycle_execution_us: float
    cycle_worst_extra_us: float
    cycle_idle_us: float
    cycle_host_us: float
    retries_us: float
    nonperiodic_us: float
