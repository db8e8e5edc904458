"""The circle test as a matplotlib figure, as in ballbar reports. Needs the extra `plot`."""

from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from math import ceil
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from busplan.drawings.circle import ERROR_SHARE
from busplan.errors import BusplanError
from busplan.forms.numbers import ROUNDING_UM
from busplan.forms.scale import ring_step

if TYPE_CHECKING:
    from busplan.analysis.circle.roundness import CircleFigures, CircleTest
    from busplan.servo.circle import CircleRun

PLOT_FORMATS: Final = ("png", "svg", "pdf")
_MAX_POINTS: Final = 8000
"""Most points of one curve: more would not be visible."""


def require_matplotlib(option: str = "--plot") -> None:
    """Refuse to start if no figure can be drawn.

    Parameters
    ----------
    option
        Option that asked for the figure.

    Raises
    ------
    BusplanError
        The extra `plot` is not installed, or does not load.
    """
    if find_spec("matplotlib") is None:
        raise BusplanError(f"{option} needs matplotlib: install it with the extra, as in pip install 'busplan[plot]'")
    try:
        import_module("matplotlib.figure")
    except Exception as error:  # noqa: BLE001 - a broken installation fails in many ways
        raise BusplanError(
            f"{option} needs matplotlib, and the installed one does not load ({type(error).__name__}: {error}); "
            "install it again, as in pip install --force-reinstall matplotlib"
        ) from None


def circle_figure(test: "CircleTest", *, file_format: str) -> bytes:
    """Draw the magnified polar error and the contour error over time of every simulated period.

    Parameters
    ----------
    test
        The circle test.
    file_format
        One of `PLOT_FORMATS`.

    Returns
    -------
    bytes
        Content of the file. The same test always gives the same bytes.

    Raises
    ------
    BusplanError
        matplotlib is not installed, or no period was simulated.
    """
    require_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    pairs = [(result, run) for result, run in zip(test.results, test.runs, strict=True) if run is not None]
    if not pairs:
        raise BusplanError("--plot: nothing to draw, no period fits the bus")
    buffer = BytesIO()
    # A dollar sign in a name starts no formula. A fixed salt makes the ids of an SVG reproducible.
    with rc_context({"text.parse_math": False, "svg.hashsalt": "busplan"}):
        figure = Figure(figsize=(11.0, 4.6 * len(pairs)), layout="constrained")
        axes = figure.subplots(len(pairs), 2, squeeze=False, width_ratios=(1, 1.4))
        grades = f"servo values: {test.results[0].servo_grade}"
        figure.suptitle(f"{test.profile.name}: circle test, {grades}")
        for (left, right), (result, run) in zip(axes, pairs, strict=True):
            _polar(left, result, run)
            _over_time(right, result, run)
        figure.savefig(buffer, format=file_format, dpi=120, metadata=metadata(file_format))
    return buffer.getvalue()


def metadata(file_format: str) -> dict[str, None]:
    """Metadata without a date, so that the same test gives the same bytes."""
    return {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(file_format, {})


def _title(result: "CircleFigures") -> str:
    verdict = "passed" if result.passed else "failed"
    return f"{result.period_us / 1000:g} ms, {result.feed_mm_per_min:g} mm/min, r {result.radius_mm:g} mm: {verdict}"


def _every(points: int) -> int:
    return max(1, ceil(points / _MAX_POINTS))


def _polar(axes: Any, result: "CircleFigures", run: "CircleRun") -> None:
    """Draw the nominal circle, rings, and the path with its error magnified."""
    trace = run.trace(every=_every(run.steps))
    error_um = trace.contour_error_mm * 1e3
    largest_um = max(float(np.abs(error_um).max()), ROUNDING_UM)
    step_um = ring_step(largest_um)
    per_um = ERROR_SHARE / largest_um
    turn = np.linspace(0.0, 2 * np.pi, 361)
    rings = range(-ceil(largest_um / step_um), ceil(largest_um / step_um) + 1)
    for ring in rings:
        size = 1 + ring * step_um * per_um
        style = {"color": "black", "linewidth": 0.9} if ring == 0 else {"color": "0.8", "linewidth": 0.6}
        axes.plot(size * np.cos(turn), size * np.sin(turn), **style)
    magnified = 1 + error_um * per_um
    angle = np.arctan2(trace.y_mm, trace.x_mm)
    axes.plot(magnified * np.cos(angle), magnified * np.sin(angle), color="tab:red", linewidth=0.8)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(_title(result), fontsize=10)
    factor = per_um * 1e3 * result.radius_mm
    deviation = "-" if result.circular_deviation_mm is None else f"{result.circular_deviation_mm * 1e3:.2f} um"
    axes.text(
        0.0,
        0.0,
        f"{step_um:g} um a ring\n{factor:.0f} times magnified\nG = {deviation}",
        ha="center",
        va="center",
        fontsize=9,
    )


def _over_time(axes: Any, result: "CircleFigures", run: "CircleRun") -> None:
    """Draw the contour error over time, with its mean and maximum in the title."""
    trace = run.trace(every=_every(run.steps))
    axes.plot(trace.time_us / 1e6, trace.contour_error_mm * 1e3, linewidth=0.7, color="tab:red")
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("contour error [um]")
    axes.grid(visible=True, linewidth=0.4, color="0.85")
    mean_um, max_um = ((value or 0.0) * 1e3 for value in (result.mean_contour_error_mm, result.max_contour_error_mm))
    axes.set_title(f"mean {mean_um:.3f} um, max {max_um:.3f} um", fontsize=10)
