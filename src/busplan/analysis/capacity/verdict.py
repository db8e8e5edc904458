"""The verdict on one period: what decides, what the other model says, and what to do."""

from typing import NamedTuple

from busplan.analysis.capacity.figures import Capacity, CapacityFigures
from busplan.analysis.planning.cures import Change, change_for_more, change_to_fit
from busplan.profile.toml import override


class Verdict(NamedTuple):
    """What a person acts on."""

    period_us: float
    deciding: CapacityFigures
    """Figures of the timing model that decides."""
    others: tuple[CapacityFigures, ...]
    """Figures of the other models that were asked for."""
    change: Change | None
    """The cheapest change: one after which every model that was asked for fits, and the bus is safe; or, where all
    is well already, one that carries more nodes under the deciding model."""

    @property
    def all_figures(self) -> tuple[CapacityFigures, ...]:
        """Figures of all models that were asked for, the deciding first."""
        return (self.deciding, *self.others)

    @property
    def models_agree(self) -> bool:
        """Whether every model says the same of the fit."""
        return all(other.fits == self.deciding.fits for other in self.others)

    @property
    def all_well(self) -> bool:
        """Whether every model fits and the bus is set safely."""
        return all(one.fits for one in self.all_figures) and self.deciding.safe


def verdicts(capacity: Capacity) -> tuple[Verdict, ...]:
    """Judge each period of a capacity result.

    The profile's `timing_model` decides; where only another model was asked for, that one does.
    """
    return tuple(_judge(capacity, results) for results in capacity.periods)


def _judge(capacity: Capacity, results: tuple[CapacityFigures, ...]) -> Verdict:
    wanted = capacity.profile.bus.timing_model
    deciding = next((figures for figures in results if figures.timing_model == wanted), results[0])
    profile = override(capacity.profile, {"cycle.period_us": deciding.period_us})
    verdict = Verdict(
        period_us=deciding.period_us,
        deciding=deciding,
        others=tuple(figures for figures in results if figures is not deciding),
        change=None,
    )
    if verdict.all_well:
        return verdict._replace(change=change_for_more(profile, model=deciding.timing_model))
    models = [figures.timing_model for figures in verdict.all_figures]
    return verdict._replace(change=change_to_fit(profile, models=models))
