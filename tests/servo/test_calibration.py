"""The paper's circle test. A calibration to its four figures, not a validation: see tests/oracles/fit_servo.py."""

from types import ModuleType

import numpy as np
import pytest

from tests.extras import needed


@pytest.mark.parametrize(
    ("period_us", "feed_mm_per_min", "duration_s", "mean_mm", "max_mm"),
    [(4000.0, 2500.0, 48.656, 0.0036, 0.0187), (1000.0, 10_000.0, 12.164, 0.0049, 0.0219)],
)
def test_the_calibrated_axis_meets_the_papers_figures_within_two_percent(
    calibration: ModuleType,
    period_us: float,
    feed_mm_per_min: float,
    duration_s: float,
    mean_mm: float,
    max_mm: float,
) -> None:
    run = calibration.run(calibration.calibrated_axis(), period_us=period_us, feed_mm_per_min=feed_mm_per_min)
    assert run.path.duration_us == duration_s * 1e6
    assert run.path.setpoints == 12164
    assert run.steps == duration_s * 1e4
    assert run.contour.mean_contour_error_mm == pytest.approx(mean_mm, rel=0.02)
    assert run.contour.max_contour_error_mm == pytest.approx(max_mm, rel=0.02)
    assert not run.diverged


@pytest.mark.slow
def test_the_shipped_set_is_where_the_fit_ends(calibration: ModuleType) -> None:
    needed("scipy")
    fitted = calibration.fit(evaluations=6)
    assert np.abs(calibration.deviations(fitted)).max() < 5e-3
    np.testing.assert_allclose(fitted, calibration.CALIBRATED, rtol=0.03)
    assert "a calibration" in calibration.report("a calibration", fitted)


def test_every_fitted_parameter_matters(calibration: ModuleType) -> None:
    """A fit with a parameter that moves no figure would be a fit of fewer."""
    at = calibration.deviations()
    for i in range(len(calibration.FITTED)):
        changed = calibration.CALIBRATED.copy()
        changed[i] *= 1.1
        assert np.abs(calibration.deviations(changed) - at).max() > 0.01
