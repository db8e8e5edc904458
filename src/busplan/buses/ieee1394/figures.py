"""The figures that only an IEEE 1394 bus has."""

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
    by,
    by_key,
)
from busplan.buses.ieee1394 import equations as eq

_LATENCY: Final = by(eq.transaction_latency_us)
_GAPS: Final = by(eq.gaps_us)
_ACKNOWLEDGE: Final = by(eq.acknowledge_phase_us, eq.acknowledge_us)

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
SETUP: Final = (HOPS, GAP_COUNT, SAFE_GAP_COUNT, GAP_COUNT_SAFE)

SYNC: Final = Figure(
    "sync_us",
    "CTS",
    "profile",
    "the synchronous packet that opens a cycle",
    "synchronous packet CTS",
    ink="sync",
    letter="S",
)


def _term(name: str, reference: str, meaning: str, ink: Ink, letter: str) -> Figure:
    words = name.replace("_", " ")
    return Figure(f"cycle_{name}_us", words, reference, meaning, words, ink=ink, letter=letter)


TERMS: Final = (
    Figure(
        "cycle_starts_us",
        "cycle starts",
        "cycle",
        "cycle start packets, and the isochronous traffic after them",
        "cycle starts",
        ink="sync",
        letter="C",
    ),
    SYNC,
    _term("arbitration", by(eq.arbitration_phase_us), "all arbitration of a cycle", "contention", "A"),
    _term("data", by(eq.data_phase_us), "all packets of a cycle", "request", "D"),
    _term("acknowledge", _ACKNOWLEDGE, "all acknowledges of a cycle", "acknowledge", "K"),
    _term("hold", "profile", "bus held from acknowledges to concatenated responses", "response", "B"),
    _term("execution", "profile", "all execution of a cycle", "work", "E"),
    _term("worst_extra", "profile", "what the slowest executions take beyond the execution time", "work", "X"),
    _term("idle", "idle", "all idle bus of the gaps, beside execution", "long-gap", "G"),
    _term("host", "profile", "the host's own time beyond the gaps", "contention", "H"),
    Figure(
        "retries_us", "retries", "profile", "busy retries of the longest request", "retries", ink="request", letter="T"
    ),
    NONPERIODIC,
)
"""In the order of the wire."""

_SUBACTION_GAP: Final = Figure("subaction_gap_us", "T_sub", by(eq.subaction_gap_us), "subaction gap", "subaction gap")
_RESET_GAP: Final = Figure(
    "arbitration_reset_gap_us",
    "T_reset",
    by(eq.arbitration_reset_gap_us),
    "arbitration reset gap",
    "arbitration reset gap",
)
BOTH_GAPS: Final = Figure("gaps_us", "T_sum", _GAPS, "both gaps, after each transaction", "gaps T_sum")

READ_LATENCY: Final = Figure(
    "read_latency_us",
    "T_lant,read",
    _LATENCY,
    "one read, without the gaps after it",
    "read latency T_lant",
    better="less",
)
WRITE_LATENCY: Final = Figure(
    "write_latency_us",
    "T_lant,write",
    _LATENCY,
    "one write, without the gaps after it",
    "write latency T_lant",
    better="less",
)
NODES_EQ11: Final = Figure(
    "nodes_eq11",
    "N_11",
    by(eq.published_nodes),
    "number of nodes as published, at the profile's own N",
    "nodes N as published",
    "nodes",
    decimals=2,
)
READ_TRANSACTION: Final = Figure(
    "read_transaction_us", "T_read", "idle", "what a read takes of the cycle", "read T_lant + idle", better="less"
)
WRITE_TRANSACTION: Final = Figure(
    "write_transaction_us", "T_write", "idle", "what a write takes of the cycle", "write T_lant + idle", better="less"
)
_PLAIN: Final = (SYNC, NONPERIODIC)
_DOCUMENT_TERMS: Final = (*_PLAIN, *(figure for figure in TERMS if figure not in _PLAIN))
"""In the order of the document, which is older than that of the wire."""
TABLE: Final = (
    READ_LATENCY,
    WRITE_LATENCY,
    READ_TRANSACTION,
    WRITE_TRANSACTION,
    BOTH_GAPS._replace(label="gaps T_sum, each transaction"),
    NODES_EQ11,
    SAFE_GAP_COUNT,
)
"""Rows of its own in the table of `capacity`."""
COMPARED: Final = (
    READ_LATENCY,
    Figure(
        "read_latency_with_gaps_us",
        "T_full,read",
        by(eq.transaction_latency_us, eq.gaps_us),
        "a read and both gaps",
        "read T_lant + T_sum",
        better="less",
    ),
    READ_TRANSACTION,
    WRITE_LATENCY,
    Figure(
        "write_latency_with_gaps_us",
        "T_full,write",
        by(eq.transaction_latency_us, eq.gaps_us),
        "a write and both gaps",
        "write T_lant + T_sum",
        better="less",
    ),
    WRITE_TRANSACTION,
)
_OF_BROADCAST: Final = (
    Figure("query_us", "T_query", "broadcast", "the query with its acknowledge, of the broadcast schedule", "query"),
    Figure("boards_us", "T_boards", "broadcast", "all nodes' broadcasts with their gaps", "broadcasts of all nodes"),
    Figure("hub_wait_us", "T_wait", "broadcast", "from the last broadcast to the read of the hub", "wait for the hub"),
)
"""Figures of the broadcast schedule alone."""
LATENCY: Final = (
    *(TIMING_MODEL, TRANSACTION, PAYLOAD_BYTES, NODES, HOPS, GAP_COUNT),
    *_OF_BROADCAST,
    Figure("request_bytes", "B_req", "packets", "request packet on the wire", "request packet, bytes", sort="count"),
    Figure(
        "response_bytes", "B_resp", "packets", "response packet on the wire", "response packet, bytes", sort="count"
    ),
    Figure("arbitration_us", "ArbP", by(eq.arbitration_phase_us), "arbitration of either packet", "arbitration, each"),
    Figure("request_data_us", "DTP_req", by(eq.data_phase_us), "data phase of the request", "data, request"),
    Figure("response_data_us", "DTP_resp", by(eq.data_phase_us), "data phase of the response", "data, response"),
    Figure("request_us", "T_req", by(eq.request_us), "arbitration and data of the request", "request T_req"),
    Figure("response_us", "T_resp", by(eq.response_us), "arbitration and data of the response", "response T_resp"),
    Figure(
        "acknowledge_us", "T_ack", _ACKNOWLEDGE, "acknowledge of either packet, T_ack1 = T_ack2", "acknowledge, each"
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
        "worst_extra_us", "T_extra", "profile", "what the slowest execution takes beyond T_exec", "slowest execution"
    ),
    Figure(
        "latency_us",
        "T_lant",
        by(eq.transaction_latency_us, eq.interval_latency_us),
        "the whole transaction, without the gaps after it",
        "latency T_lant",
    ),
    Figure(
        "request_and_acknowledge_us",
        "T1+T2",
        by(eq.request_and_acknowledge_us),
        "first half of the transaction",
        "T1+T2",
    ),
    Figure(
        "response_and_acknowledge_us",
        "T4+T5",
        by(eq.response_and_acknowledge_us),
        "second half of the transaction",
        "T4+T5",
    ),
    _SUBACTION_GAP,
    _RESET_GAP,
    BOTH_GAPS,
    Figure(
        "latency_with_gaps_us",
        "T_full",
        by(eq.transaction_latency_us, eq.gaps_us),
        "the transaction and both gaps",
        "T_lant + T_sum",
    ),
    Figure("idle_us", "idle", "idle", "idle bus of the gaps, beside execution", "idle bus"),
    Figure("host_us", "host", "profile", "the host's own time beyond the gaps", "host"),
    Figure("transaction_us", "T_trans", "idle", "what the transaction takes of the cycle", "takes of the cycle"),
)
"""In the order of the document, which is that of the phases of a transaction."""
LATENCY_TABLE: Final = tuple(
    by_key(LATENCY)[key]
    for key in (
        "query_us",
        "boards_us",
        "hub_wait_us",
        "request_bytes",
        "response_bytes",
        "arbitration_us",
        "request_data_us",
        "response_data_us",
        "acknowledge_us",
        "request_us",
        "response_us",
        "request_and_acknowledge_us",
        "hold_us",
        "execution_us",
        "response_and_acknowledge_us",
        "latency_us",
        "subaction_gap_us",
        "arbitration_reset_gap_us",
        "gaps_us",
        "latency_with_gaps_us",
        "worst_extra_us",
        "idle_us",
        "host_us",
        "transaction_us",
    )
)
"""In the order of the bench: T1+T2, T3, T4+T5, and the gaps after them."""

FIGURES: Final = BusFigures(
    TERMS,
    document_terms=_DOCUMENT_TERMS,
    setup=SETUP,
    headings=(HOPS.key, GAP_COUNT.key),
    added=(
        *(READ_LATENCY, WRITE_LATENCY, READ_TRANSACTION, WRITE_TRANSACTION),
        *(BOTH_GAPS, _SUBACTION_GAP, _RESET_GAP),
    ),
    counts=(NODES_EQ11,),
    table=TABLE,
    compared=COMPARED,
    planned=(GAP_COUNT.key, GAP_COUNT_SAFE.key),
    latency_rows=LATENCY_TABLE,
    latency_document=LATENCY,
)
