"""Register of the figures of the circle test."""

from typing import Final

from busplan.buses.figure import AVAILABLE, PERIOD, REQUIRED, VERDICT, Figure, by, by_key
from busplan.buses.time_slice import required_time_slice_us, time_slice_us

_CYCLE: Final = by(time_slice_us, required_time_slice_us)
_ISO: Final = "ISO 230-4"

JITTER: Final = Figure(
    "jitter_us",
    "J",
    "profile",
    "jitter of the synchronous packet, either way of its mean: delivery.jitter_us and what the bus adds",
    "jitter of the packet",
)
CIRCLE_FIGURES: Final = (
    PERIOD,
    Figure("feed_mm_per_min", "F", "profile", "speed along the circle", "feed", decimals=None),
    Figure("radius_mm", "r", "profile", "radius of the circle", "radius", decimals=None),
    Figure("path", "path", "profile", "the move: trapezoid or iso230-4", "path", sort="word"),
    Figure("duration_s", "D", "path", "duration of the move", "duration"),
    Figure("setpoints", "n", "path", "set-points of the move", "set-points", "1", "count"),
    Figure("steps", "n_h", "path", "simulated steps of each axis"),
    Figure(
        "step_us",
        "h",
        "profile",
        "period of the node's position loop, and step of the simulation",
        "position-loop step",
        decimals=None,
    ),
    Figure(
        "loop",
        "loop",
        "profile",
        "where the position loop is closed: node or host",
        "position loop on the",
        sort="word",
    ),
    Figure(
        "update", "update", "profile", "when a node applies a command of a loop on the host: next_sync or on_arrival"
    ),
    Figure("delay_us", "T_d", "III-C", "bus delay inside the loop, the longer one of both axes", "delay in the loop"),
    Figure("delay_x_us", "T_dx", "III-C", "bus delay inside the loop of x"),
    Figure("delay_y_us", "T_dy", "III-C", "bus delay inside the loop of y"),
    JITTER,
    Figure("timing_model", "model", "profile", "timing model that decides whether the bus fits"),
    Figure("bus_fits", "fits", _CYCLE, "whether required <= available, and no limit is broken"),
    VERDICT,
    REQUIRED,
    AVAILABLE,
    Figure("servo_grade", "grade", "profile", "how the servo values are known", "servo values", sort="word"),
    Figure("ideal_drive", "ideal", "profile", "whether an ideal drive was simulated, for the profile has no [servo]"),
    Figure("stable", "stable", "loop", "whether both position loops are stable", "stable", sort="truth", better="more"),
    Figure(
        "phase_margin_deg",
        "phase margin",
        "loop",
        "turn of the loop's phase that makes it unstable",
        "phase margin",
        decimals=2,
        better="more",
    ),
    Figure(
        "gain_margin_db",
        "gain margin",
        "loop",
        "change of the loop's gain that makes it unstable",
        "gain margin",
        decimals=2,
        better="more",
        relative=False,
    ),
    Figure("crossover_hz", "f_c", "loop", "frequency at which the phase margin is counted", "crossover", decimals=2),
    Figure("settled", "settled", "loop", "whether the loops settle before the measured turn; null on a trapezoid"),
    Figure(
        "mean_contour_error_mm",
        "mean",
        "simulation",
        "mean contour error of the turn, or of the whole trapezoid",
        "mean contour error",
        "um",
        better="less",
        scale="radius_mm",
    ),
    Figure(
        "max_contour_error_mm",
        "max",
        "simulation",
        "largest contour error of the turn, or of the whole trapezoid",
        "largest contour error",
        "um",
        better="less",
        scale="radius_mm",
    ),
    Figure(
        "radial_deviation_min_mm",
        "F_min",
        _ISO,
        "smallest radial deviation of the turn, or of a trapezoid at constant speed",
        "smallest radial deviation F_min",
        "um",
    ),
    Figure(
        "radial_deviation_max_mm",
        "F_max",
        _ISO,
        "largest radial deviation of the turn, or of a trapezoid at constant speed",
        "largest radial deviation F_max",
        "um",
    ),
    Figure(
        "circular_deviation_mm",
        "G",
        _ISO,
        "circular deviation about the least-squares centre of the turn; null on a trapezoid",
        "circular deviation G",
        "um",
        better="less",
        scale="radius_mm",
    ),
    Figure(
        "radius_deviation_mm",
        "r_ls - r",
        "least squares",
        "least-squares radius less the nominal one",
        "radius deviation",
        "um",
    ),
    Figure("centre_offset_mm", "centre", "least squares", "least-squares centre, x and y"),
    Figure("constant_speed_deg", "arc", "simulation", "arc that F, G, centre and radius are taken on: 360 for a turn"),
    Figure(
        "passed",
        "passed",
        "profile",
        "whether the circle holds every tolerance; null if nothing fails, and no contour tolerance is asked for",
        "passed",
        sort="truth",
        better="more",
    ),
    Figure("failures", "failures", "profile", "what the circle does not hold"),
    Figure("contributions", "contributions", "simulation", "what each error source takes of the largest error"),
)
CIRCLE_BY_KEY: Final = by_key(CIRCLE_FIGURES)
"""The same by key."""
