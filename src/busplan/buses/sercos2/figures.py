"""The figures that only SERCOS I and II have."""

from typing import Final

from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, capacity_figures
from busplan.buses.sercos import DELAYS

_TELEGRAMS: Final = "IEC 61491"

DATA_RATE: Final = Figure(
    "data_rate_mbit_s", "f", "profile", "data rate of the ring", "data rate, Mbit/s", decimals=None
)
MDT_BYTES: Final = Figure(
    "mdt_bytes", "s_MDT", _TELEGRAMS, "data of the master data telegram", "data of the MDT", sort="count"
)
TERMS: Final = (
    Figure("cycle_mst_us", "MST", _TELEGRAMS, "synchronisation telegram", "MST", ink="sync", letter="S"),
    Figure("cycle_at_us", "AT", _TELEGRAMS, "telegrams of all drives", "AT", ink="in", letter="A"),
    Figure("cycle_gap_us", "gap", "profile", "gaps between the telegrams of two drives", "gaps", ink="gap", letter="G"),
    Figure("cycle_mdt_us", "MDT", _TELEGRAMS, "master data telegram", "MDT", ink="out", letter="M"),
    Figure(
        "cycle_wait_us",
        "wait",
        "profile",
        "wait for the drives: before the first AT, after the last, after the MDT",
        "wait for drives",
        ink="work",
        letter="W",
    ),
    NONPERIODIC,
)
FIGURES: Final = BusFigures(
    TERMS,
    capacity_figures(TERMS, setup=(DATA_RATE,), own=(MDT_BYTES,)),
    setup=(DATA_RATE,),
    headings=(DATA_RATE.key,),
    table=(MDT_BYTES,),
    compared=(MDT_BYTES,),
    phases=DELAYS,
)
