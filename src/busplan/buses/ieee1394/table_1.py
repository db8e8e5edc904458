"""Table I of the paper, and what it says of the error of the timing model `standard`.

The model is not the bus: on the paper's own bench it gives less than was measured. The difference, and its spread, are
part of every verdict.

References
----------
Paper, Table I: one node and the host, gap count 63, S400, write transactions, more than 10,000 of them a row.
"""

from functools import cache
from math import sqrt
from statistics import fmean, stdev
from typing import Final, NamedTuple

from busplan.buses.ieee1394.constants import DATA_RATE_MBIT_S, MAX_GAP_COUNT, PACKET_OVERHEAD_BYTES, REFERENCE_CABLE_M
from busplan.buses.ieee1394.timing import TIMING_MODELS, Link, Responder, TimingModelName, transaction
from busplan.sourced import Sourced


class Row(NamedTuple):
    """One row of the table, times in us."""

    payload_bytes: int
    latency_us: float
    """T_lant, experiment."""
    request_and_acknowledge_us: float
    """T1 + T2, experiment."""
    theory_us: float
    """T1 + T2, theory."""


TABLE_1: Final = (
    Row(4, 48.7, 6.0, 3.19),
    Row(16, 48.9, 6.3, 3.44),
    Row(32, 57.9, 6.6, 3.76),
    Row(64, 68.1, 7.5, 4.41),
    Row(128, 99.9, 9.1, 5.71),
    Row(256, 158.5, 11.5, 8.32),
    Row(512, 246.0, 16.9, 13.53),
    Row(1024, 460.0, 27.4, 23.94),
)
BENCH: Final = Link(float(DATA_RATE_MBIT_S["S400"]), MAX_GAP_COUNT, 1, float(REFERENCE_CABLE_M))
"""The way of a packet on the bench."""


class ModelResidual(NamedTuple):
    """What was measured less what a timing model gives, for one half of a transaction [us]."""

    mean_us: Sourced
    uncertainty_us: Sourced
    """Standard uncertainty of the next half: sd sqrt(1 + 1/n)."""


@cache
def residual(model: TimingModelName = "standard") -> ModelResidual:
    """Residual of T1 + T2, equation (13), over the rows of the table.

    Parameters
    ----------
    model
        Timing model.

    Examples
    --------
    >>> round(residual().mean_us, 3), round(residual("paper").mean_us, 3)
    (0.827, 3.131)
    """
    differences = [row.request_and_acknowledge_us - _first_half_us(row.payload_bytes, model) for row in TABLE_1]
    number, source = len(differences), f"paper, Table I, less the {model} model at its {len(differences)} payloads"
    return ModelResidual(
        Sourced(
            fmean(differences),
            unit="us",
            grade="derived",
            source=source,
            meaning="what half a transaction takes beyond the model, on the mean",
            symbol="b",
        ),
        Sourced(
            stdev(differences) * sqrt(1 + 1 / number),
            unit="us",
            grade="derived",
            source=source,
            meaning="standard uncertainty of that for one more payload",
            symbol="u(b)",
        ),
    )


def _first_half_us(payload_bytes: int, model: TimingModelName) -> float:
    phases = transaction(
        "write",
        model=TIMING_MODELS[model],
        link=BENCH,
        payload_bytes=payload_bytes,
        overhead_bytes=int(PACKET_OVERHEAD_BYTES),
        responder=Responder(0.0),
    )
    return float(phases.request_and_acknowledge_us)
