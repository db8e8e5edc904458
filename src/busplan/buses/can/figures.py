"""The figures that only a CAN bus has."""

from typing import Final

from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, capacity_figures

_DAVIS: Final = "Davis 2007"

BIT_RATE: Final = Figure("bit_rate_kbit_s", "f", "profile", "bit rate of the bus", "bit rate, kbit/s", decimals=None)
BUS_LOAD: Final = Figure(
    "bus_load",
    "load",
    _DAVIS,
    "share of the bus that all messages take, 0..1",
    "bus load",
    "%",
    decimals=2,
    better="less",
)
EXPECTED_LOAD: Final = Figure(
    "expected_load",
    "load_expected",
    "python-can logs",
    "share of the bus with as many stuff bits as measured frames have, 0..1",
    "expected load",
    "%",
    decimals=2,
    better="less",
)
LOADS: Final = (BUS_LOAD, EXPECTED_LOAD)
TERMS: Final = (
    Figure("cycle_sync_us", "SYNC", _DAVIS, "the frame that opens a cycle", "SYNC", ink="sync", letter="S"),
    Figure(
        "cycle_wait_us",
        "wait",
        "profile",
        "wait for the slowest node, behind SYNC and behind its command",
        "wait for nodes",
        ink="work",
        letter="W",
    ),
    Figure("cycle_feedback_us", "feedback", _DAVIS, "PDOs from all nodes", "feedback", ink="in", letter="F"),
    Figure(
        "cycle_host_us",
        "host",
        "profile",
        "the host's own time behind the last feedback",
        "host",
        ink="idle",
        letter="H",
    ),
    Figure("cycle_command_us", "command", _DAVIS, "PDOs to all nodes", "command", ink="out", letter="C"),
    Figure(
        "cycle_blocking_us",
        "3 B",
        _DAVIS,
        "frames of lower priorities, one before SYNC, one before the last feedback and one before the commands",
        "blocking",
        ink="gap",
        letter="B",
    ),
    Figure(
        "cycle_interference_us",
        "I",
        _DAVIS,
        "other messages of higher priorities than the last PDO that arrive while the cycle lasts",
        "interference",
        ink="contention",
        letter="I",
    ),
    NONPERIODIC,
)
"""In the order of the wire."""

LATENCY_TABLE: Final = (
    Figure(
        "identifier",
        "id",
        "profile",
        "identifier of the last frame",
        "identifier",
        sort="count",
        is_hexadecimal=True,
    ),
    Figure("data_bytes", "s", "profile", "data of the last frame", "data, bytes", sort="count"),
    Figure("jitter_us", "J", "profile", "how late it may be queued", "jitter J"),
    Figure("blocking_us", "B", _DAVIS, "longest frame of a lower priority", "blocking B"),
    Figure("interference_us", "I", _DAVIS, "frames of higher priorities before it", "interference I"),
    Figure("instance", "q", _DAVIS, "worst instance of the busy period, from 0", "worst instance q", sort="count"),
    Figure("backlog_us", "q (C - T)", _DAVIS, "instances before it, less their periods", "backlog q (C - T)"),
    Figure("frame_us", "C", _DAVIS, "the frame itself", "frame C"),
    Figure("execution_us", "T_exec", "profile", "waits for nodes and host, of a loop over both", "execution"),
    Figure("pipeline_us", "n T_s", "profile", "cycles that the host computes in, of a loop over both", "host's cycles"),
    Figure(
        "worst_response_us",
        "R",
        _DAVIS,
        "worst-case response time, J + B + I + q (C - T) + C; of a loop all of it, from SYNC to the executed command",
        "response R",
    ),
    Figure("deadline_us", "D", "profile", "when it must have arrived", "deadline D"),
)
"""In the order in which they add up."""
FIGURES: Final = BusFigures(
    TERMS,
    capacity_figures(TERMS, setup=(BIT_RATE,), own=LOADS),
    setup=(BIT_RATE,),
    headings=(BIT_RATE.key,),
    table=LOADS,
    compared=LOADS,
    planned=(BUS_LOAD.key,),
    phases=LATENCY_TABLE,
    has_many_transactions=True,
    deadlines=("worst_response_us", "deadline_us"),
)
