"""The error of the timing models, from Table I of the paper.

A model is not the bus: on the paper's own bench `standard` gives less than was measured. The difference, and its
spread, are part of every verdict.

References
----------
Paper, Table I: one node and the host, gap count 63, S400, write transactions, more than 10,000 of them a row.
"""

from functools import cache
from typing import Final, NamedTuple

from busplan.buses.ieee1394.constants import DATA_RATE_MBIT_S, MAX_GAP_COUNT, PACKET_OVERHEAD_BYTES, REFERENCE_CABLE_M
from busplan.buses.ieee1394.timing import TIMING_MODELS, Link, Responder, TimingModelName, transaction
from busplan.buses.published import Spread, rows_of
from busplan.sourced import Sourced

_BENCH: Final = Link(float(DATA_RATE_MBIT_S["S400"]), MAX_GAP_COUNT, 1, float(REFERENCE_CABLE_M))
"""The way of a packet on the bench."""


class ModelResidual(NamedTuple):
    """Measured less computed time of half a transaction [us]."""

    mean_us: Sourced
    uncertainty_us: Sourced
    """Standard uncertainty of the next half: `Spread`."""


def measured_halves_us() -> dict[int, float]:
    """T1 + T2 as measured, by payload in bytes [us]."""
    return {row["set"]["payload.write_bytes"]: row["published"] for row in rows_of("paper", "bias and U")}


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
    differences = [us - _first_half_us(payload_bytes, model) for payload_bytes, us in measured_halves_us().items()]
    spread, source = (
        Spread.of(differences),
        f"paper, Table I, less the {model} model at its {len(differences)} payloads",
    )
    return ModelResidual(
        Sourced(
            spread.mean,
            unit="us",
            grade="derived",
            source=source,
            meaning="what half a transaction takes beyond the model, on the mean",
            symbol="b",
        ),
        Sourced(
            spread.uncertainty,
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
        link=_BENCH,
        payload_bytes=payload_bytes,
        overhead_bytes=int(PACKET_OVERHEAD_BYTES),
        responder=Responder(0.0),
    )
    return float(phases.request_and_acknowledge_us)
