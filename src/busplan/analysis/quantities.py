"""Every figure that a command gives: its symbol, its unit, where it comes from, and what it is.

The one place that says so: tables, `explain`, the README and the page read it here. A figure that an equation gives
names the function, which knows its number (`busplan.sourced.EQUATIONS`).
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

from busplan.buses.ieee1394 import equations as eq
from busplan.sourced import EQUATIONS

Command = Literal["latency", "capacity", "circle-test"]

_UNITS: Final = {
    "_mm_per_min": "mm/min",
    "_us": "us",
    "_bytes": "bytes",
    "_mm": "mm",
    "_deg": "deg",
    "_db": "dB",
    "_hz": "Hz",
    "_s": "s",
}
"""Unit by the end of a key's name, the longer ends first."""


class Figure(NamedTuple):
    """One key of a command's JSON.

    Parameters
    ----------
    key
        Name in JSON, CSV and the results.
    symbol
        What stands for it in a derivation.
    reference
        Numbers of its equations, or where else it comes from.
    meaning
        What it is, in one line.
    """

    key: str
    symbol: str
    reference: str
    meaning: str

    @property
    def unit(self) -> str:
        """Unit by the end of its name; empty for counts, shares and words."""
        return next((unit for end, unit in _UNITS.items() if self.key.endswith(end)), "")


def _by(*functions: Callable[..., Any]) -> str:
    """The numbers of the equations that some functions compute."""
    numbers = dict.fromkeys(number for one in functions for number in EQUATIONS[one.__name__].numbers)
    return " ".join(f"({number})" for number in numbers)


_CYCLE: Final = _by(eq.time_slice_us, eq.required_time_slice_us)
_SLICE: Final = _by(eq.required_time_slice_us)
_LATENCY: Final = _by(eq.transaction_latency_us)
_GAPS: Final = _by(eq.gaps_us)
_ACKNOWLEDGE: Final = _by(eq.acknowledge_phase_us, eq.acknowledge_us)
_ISO: Final = "ISO 230-4"

_MODEL: Final = Figure("timing_model", "model", "profile", "timing model: paper or standard")
_PERIOD: Final = Figure("period_us", "T_s", "profile", "communication period")
_NODES: Final = Figure("nodes", "N", "profile", "distributed nodes, host not counted")
_HOPS: Final = Figure("hops", "H", "profile", "cable hops to the farthest node")
_GAP_COUNT: Final = Figure("gap_count", "g", "profile", "gap count in force")
_AVAILABLE: Final = Figure(
    "available_us", "alpha T_s", _by(eq.time_slice_us), "share of the period that is for communication"
)
_REQUIRED: Final = Figure("required_us", "T_need", _SLICE, "what the whole cycle needs, N T_cs")
_SUBACTION_GAP: Final = Figure("subaction_gap_us", "T_sub", _by(eq.subaction_gap_us), "subaction gap")
_RESET_GAP: Final = Figure(
    "arbitration_reset_gap_us", "T_reset", _by(eq.arbitration_reset_gap_us), "arbitration reset gap"
)
_BOTH_GAPS: Final = Figure("gaps_us", "T_sum", _GAPS, "both gaps, after each transaction")

_LATENCY_FIGURES: Final = (
    _MODEL,
    Figure("transaction", "kind", "profile", "read or write"),
    Figure("payload_bytes", "P", "profile", "payload of the transaction"),
    _NODES,
    _HOPS,
    _GAP_COUNT,
    Figure("request_bytes", "B_req", "packets", "request packet on the wire"),
    Figure("response_bytes", "B_resp", "packets", "response packet on the wire"),
    Figure("arbitration_us", "ArbP", _by(eq.arbitration_phase_us), "arbitration of either packet"),
    Figure("request_data_us", "DTP_req", _by(eq.data_phase_us), "data phase of the request"),
    Figure("response_data_us", "DTP_resp", _by(eq.data_phase_us), "data phase of the response"),
    Figure("request_us", "T_req", _by(eq.request_us), "arbitration and data of the request"),
    Figure("response_us", "T_resp", _by(eq.response_us), "arbitration and data of the response"),
    Figure("acknowledge_us", "T_ack", _ACKNOWLEDGE, "acknowledge of either packet, T_ack1 = T_ack2"),
    Figure("execution_us", "T_exec", "profile", "execution in the node, T3 of the bench"),
    Figure(
        "latency_us",
        "T_lant",
        _by(eq.transaction_latency_us, eq.interval_latency_us),
        "the whole transaction, without the gaps after it",
    ),
    Figure("request_and_acknowledge_us", "T1+T2", _by(eq.request_and_acknowledge_us), "first half of the transaction"),
    Figure(
        "response_and_acknowledge_us", "T4+T5", _by(eq.response_and_acknowledge_us), "second half of the transaction"
    ),
    _SUBACTION_GAP,
    _RESET_GAP,
    _BOTH_GAPS,
    Figure(
        "latency_with_gaps_us",
        "T_full",
        _by(eq.transaction_latency_us, eq.gaps_us),
        "what the transaction takes of the cycle, T_lant + T_sum",
    ),
)
_CAPACITY_FIGURES: Final = (
    _MODEL,
    _PERIOD,
    _NODES,
    Figure("axes", "axes", "profile", "axes of all nodes"),
    _HOPS,
    _GAP_COUNT,
    Figure("safe_gap_count", "g_safe", "table", "smallest safe gap count for the hops"),
    Figure("gap_count_safe", "safe", "table", "whether the gap count is at least that"),
    _AVAILABLE,
    _REQUIRED,
    Figure("time_slice_us", "T_cs,given", _by(eq.time_slice_us), "time slice that the cycle gives each node"),
    Figure("required_time_slice_us", "T_cs,needed", _SLICE, "time slice that each node needs"),
    Figure("read_latency_us", "T_lant,read", _LATENCY, "one read, without the gaps after it"),
    Figure("write_latency_us", "T_lant,write", _LATENCY, "one write, without the gaps after it"),
    _BOTH_GAPS,
    _SUBACTION_GAP,
    _RESET_GAP,
    Figure("sync_us", "CTS", "profile", "the synchronous packet that opens a cycle"),
    Figure("nonperiodic_us", "T_npd", "profile", "time kept for non-periodic data"),
    Figure("cycle_arbitration_us", "arbitration", _by(eq.arbitration_phase_us), "all arbitration of a cycle"),
    Figure("cycle_data_us", "data", _by(eq.data_phase_us), "all packets of a cycle"),
    Figure("cycle_acknowledge_us", "acknowledge", _ACKNOWLEDGE, "all acknowledges of a cycle"),
    Figure("cycle_execution_us", "execution", "profile", "all execution of a cycle"),
    Figure("cycle_gaps_us", "gaps", _GAPS, "all gaps of a cycle"),
    Figure("binding_term", "binding term", _SLICE, "the largest part of what the cycle needs"),
    Figure("utilisation", "U", _CYCLE, "share of the slice that is used, 0..1"),
    Figure("margin_us", "margin", _CYCLE, "what is left of the slice"),
    Figure("nodes_eq11", "N_11", _by(eq.published_nodes), "number of nodes as published, at the profile's own N"),
    Figure("max_nodes", "N_max", _CYCLE, "most nodes that fit the period"),
    Figure("max_axes", "axes_max", _CYCLE, "axes of the most nodes that fit"),
    Figure("limited_by", "limit", _CYCLE, "what keeps the most nodes from being more"),
    Figure("min_period_us", "T_s,min", _CYCLE, "smallest period that these nodes fit in"),
    Figure("min_slice_ratio", "alpha_min", _CYCLE, "smallest slice ratio that these nodes fit with"),
    Figure("exceeded", "broken", _CYCLE, "limits that the profile breaks"),
    Figure("fits", "fits", _CYCLE, "whether the cycle fits and breaks no limit"),
    Figure("models_agree", "models agree", _CYCLE, "whether both timing models say the same of the fit"),
    Figure("cheapest_change", "change", _CYCLE, "cheapest change that makes it fit, or carries more nodes"),
    Figure("warnings", "warnings", "table", "what to beware of: unsafe gap count, long cables"),
    Figure("text", "text", _CYCLE, "the verdict in words"),
)
_CIRCLE_FIGURES: Final = (
    _PERIOD,
    Figure("feed_mm_per_min", "F", "profile", "speed along the circle"),
    Figure("radius_mm", "r", "profile", "radius of the circle"),
    Figure("duration_s", "D", "path", "duration of the move"),
    Figure("setpoints", "n", "path", "set-points of the move"),
    Figure("steps", "n_h", "path", "simulated steps of each axis"),
    Figure("step_us", "h", "profile", "period of the node's position loop, and step of the simulation"),
    Figure("loop", "loop", "profile", "where the position loop is closed: node or host"),
    Figure("delay_us", "T_d", _SLICE, "bus delay inside the loop"),
    Figure("timing_model", "model", "profile", "timing model that decides whether the bus fits"),
    Figure("bus_fits", "fits", _CYCLE, "whether the cycle fits the bus"),
    _REQUIRED,
    _AVAILABLE,
    Figure("servo_grade", "grade", "profile", "how the servo values are known"),
    Figure("stable", "stable", "loop", "whether both position loops are stable"),
    Figure("phase_margin_deg", "phase margin", "loop", "turn of the loop's phase that makes it unstable"),
    Figure("gain_margin_db", "gain margin", "loop", "change of the loop's gain that makes it unstable"),
    Figure("crossover_hz", "f_c", "loop", "frequency at which the phase margin is counted"),
    Figure("mean_contour_error_mm", "mean", "simulation", "mean contour error of the whole move"),
    Figure("max_contour_error_mm", "max", "simulation", "largest contour error of the whole move"),
    Figure("radial_deviation_min_mm", "F_min", _ISO, "smallest radial deviation at constant speed"),
    Figure("radial_deviation_max_mm", "F_max", _ISO, "largest radial deviation at constant speed"),
    Figure("circular_deviation_mm", "G", _ISO, "circular deviation about the least-squares centre"),
    Figure("radius_deviation_mm", "r_ls - r", "least squares", "least-squares radius less the nominal one"),
    Figure("centre_offset_mm", "centre", "least squares", "least-squares centre, x and y"),
    Figure("constant_speed_deg", "arc", "simulation", "arc at constant speed with the loops settled"),
    Figure("passed", "passed", "profile", "whether the circle holds every tolerance"),
    Figure("failures", "failures", "profile", "what the circle does not hold"),
    Figure("contributions", "contributions", "simulation", "what each error source takes of the largest error"),
)

FIGURES: Final[Mapping[Command, Mapping[str, Figure]]] = MappingProxyType(
    {
        "capacity": MappingProxyType({figure.key: figure for figure in _CAPACITY_FIGURES}),
        "latency": MappingProxyType({figure.key: figure for figure in _LATENCY_FIGURES}),
        "circle-test": MappingProxyType({figure.key: figure for figure in _CIRCLE_FIGURES}),
    }
)
"""Figures by command and key. A key that several commands give is the first one's, where no command is named."""

HOLDERS: Final[Mapping[str, tuple[Command, str]]] = MappingProxyType(
    {
        "changes": ("capacity", "cheapest_change"),
        **dict.fromkeys(("name", "value", "limit"), ("circle-test", "failures")),
        **dict.fromkeys(("source", "removed_mm"), ("circle-test", "contributions")),
    }
)
"""Keys that stand inside a figure, by that figure: they are derived with it."""
