"""The figures that only SERCOS III has."""

from typing import Final

from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, capacity_figures
from busplan.buses.sercos import DELAYS

_COSEMA: Final = "CoSeMa"

MDT_TELEGRAMS: Final = Figure(
    "mdt_telegrams", "n_MDT", _COSEMA, "master data telegrams of a cycle", "MDT", sort="count", better="less"
)
AT_TELEGRAMS: Final = Figure(
    "at_telegrams", "n_AT", _COSEMA, "device telegrams of a cycle", "AT", sort="count", better="less"
)
TERMS: Final = (
    Figure("cycle_mdt_us", "MDT", _COSEMA, "master data telegrams with their gaps", "MDT", ink="out", letter="M"),
    Figure(
        "cycle_wait_us", "wait", _COSEMA, "what the devices make the AT wait", "wait of devices", ink="sync", letter="W"
    ),
    Figure("cycle_at_us", "AT", _COSEMA, "device telegrams with their gaps", "AT", ink="in", letter="A"),
    Figure("cycle_jitter_us", "jitter", _COSEMA, "allowances for the jitter", "jitter", ink="contention", letter="J"),
    Figure("cycle_master_us", "master", _COSEMA, "the master's own time", "master", ink="work", letter="T"),
    Figure(
        "cycle_ring_us",
        "ring",
        _COSEMA,
        "delay of the ring, where the timing method has it",
        "ring delay",
        ink="long-gap",
        letter="R",
    ),
    NONPERIODIC,
)
"""In the order of the wire, where other frames come last."""
COUNTS: Final = (MDT_TELEGRAMS, AT_TELEGRAMS)
FIGURES: Final = BusFigures(
    TERMS,
    capacity_figures(TERMS, own=COUNTS),
    table=COUNTS,
    compared=COUNTS,
    planned=tuple(figure.key for figure in COUNTS),
    phases=DELAYS,
)
