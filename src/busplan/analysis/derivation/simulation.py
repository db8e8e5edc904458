"""The numbers that a circle's measures are made of: which steps, when and where, and how they are put together."""

import numpy as np

from busplan.analysis.circle.roundness import CircleFigures
from busplan.analysis.derivation.formulas import less
from busplan.analysis.derivation.trace import short
from busplan.servo.circle import CircleRun
from busplan.servo.contour import contour_error


class SimulationNumbers:
    """The numbers of a simulation that its measures are made of."""

    def __init__(self, result: CircleFigures, run: CircleRun | None) -> None:
        self._result, self._run = result, run

    @property
    def is_round(self) -> bool:
        """Whether the arc is long enough for a centre."""
        return self._result.circular_deviation_mm is not None

    def mean(self) -> str:
        """Sum and number of the errors."""
        run, mean = self._run, self._result.mean_contour_error_mm
        return "" if run is None or mean is None else f"{short(mean * run.steps)} / {run.steps}"

    def at(self, key: str) -> str:
        """When and where an extreme is reached."""
        run = self._run
        if run is None:
            return ""
        errors = contour_error(run.x_mm, y_mm=run.y_mm, radius_mm=run.path.radius_mm)
        first = 0
        if key == "max_contour_error_mm":
            index = int(np.abs(errors).argmax())
        else:
            first = run.constant_speed.start
            part = errors[run.constant_speed]
            index = first + int(part.argmin() if key == "radial_deviation_min_mm" else part.argmax())
        x, y = float(run.x_mm[index]), float(run.y_mm[index])
        angle = float(np.degrees(np.arctan2(y, x)) % 360)
        time_s = (index + 1) * run.timing.step_us / 1e6
        root = f"sqrt(({short(x)})^2 + ({short(y)})^2) - {short(run.path.radius_mm)}"
        return f"{root}, {short(time_s)} s from the start, at {angle:.2f} deg"

    def range(self) -> str:
        """The two distances that the circular deviation lies between, from the radius."""
        run, centre = self._run, self._result.centre_offset_mm
        if run is None or centre is None:
            return ""
        part, radius = run.constant_speed, run.path.radius_mm
        errors = contour_error(run.x_mm[part] - centre[0], y_mm=run.y_mm[part] - centre[1], radius_mm=radius)
        return f"(r + {short(float(errors.max()))}) - (r + {short(float(errors.min()))})"

    def radius(self) -> str:
        """Both radii."""
        run, deviation = self._run, self._result.radius_deviation_mm
        if run is None or deviation is None:
            return ""
        return less(run.path.radius_mm + deviation, run.path.radius_mm)

    def centre(self) -> str:
        """Over how many points it was fitted."""
        part = None if self._run is None else self._run.constant_speed
        return "" if part is None else f"least squares over {part.stop - part.start} steps"

    def constant_speed(self) -> str:
        """The steps at constant speed."""
        part = None if self._run is None else self._run.constant_speed
        return "" if part is None else f"steps {part.start + 1} to {part.stop}"
