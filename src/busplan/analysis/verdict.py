"""The verdict on one period: what decides, what the other model says, and what to do."""

from typing import NamedTuple

from busplan.analysis.advice import Change, cheapest_change
from busplan.analysis.capacity import Capacity, CapacityFigures
from busplan.profile.toml import override


class Verdict(NamedTuple):
    """What a person acts on."""

    period_us: float
    deciding: CapacityFigures
    """Figures of the timing model that decides."""
    others: tuple[CapacityFigures, ...]
    """Figures of the other models that were asked for."""
    advised: CapacityFigures
    """The figures that the change is to better: those that do not fit where the models disagree, else the deciding."""
    change: Change | None
    """The cheapest change for the model of `advised`; see `cheapest_change`."""

    @property
    def models_agree(self) -> bool:
        """Whether every model says the same of the fit."""
        return all(other.fits == self.deciding.fits for other in self.others)


def verdicts(capacity: Capacity) -> tuple[Verdict, ...]:
    """Judge each period of a capacity result.

    The profile's `timing_model` decides; where only another model was asked for, that one does.
    """
    return tuple(_judge(capacity, results) for results in capacity.periods)


def _judge(capacity: Capacity, results: tuple[CapacityFigures, ...]) -> Verdict:
    wanted = capacity.profile.bus.timing_model
    deciding = next((figures for figures in results if figures.timing_model == wanted), results[0])
    advised = next((figures for figures in (deciding, *results) if not figures.fits), deciding)
    profile = override(capacity.profile, {"cycle.period_us": deciding.period_us})
    return Verdict(
        period_us=deciding.period_us,
        deciding=deciding,
        others=tuple(figures for figures in results if figures is not deciding),
        advised=advised,
        change=cheapest_change(profile, model=advised.timing_model),
    )
