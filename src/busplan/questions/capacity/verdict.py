"""The verdict on one period, by the timing model that decides, and the change that mends or extends the network."""

from typing import NamedTuple

from busplan.buses.network import Network
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import Capacity, CapacityFigures, FitFigures, after_reset, capacity_figures
from busplan.questions.fit.network import bus_of
from busplan.questions.plan.advice import Change, advice
from busplan.questions.plan.constraints import Need, missed_limits


class Verdict(NamedTuple):
    """Verdict on one period, and the change that makes the cycle fit or carries another node."""

    network: Network
    """The network at its period."""
    period_us: float
    """None of a network without a cycle."""
    deciding: CapacityFigures
    """Figures of the timing model that decides, whatever was asked for."""
    others: tuple[CapacityFigures, ...]
    """Figures of the other models that were asked for."""
    missed_limits: tuple[Need, ...]
    """Needs of [limits] that the slice does not meet."""
    after_reset: FitFigures | None
    """Figures after a bus reset; None unless the cycle is shown to fit now and not after the reset."""
    change: Change | None
    """The least change after which every constraint of a plan holds; or, where all do already, one that carries another
    node."""
    no_change: str
    """Reason that no change is given; empty with a change."""

    @property
    def models_agree(self) -> bool | None:
        """Whether `fits` is the same under every model that was asked for; None where there is no other."""
        return all(figures.fits == self.deciding.fits for figures in self.others) if self.others else None

    @property
    def all_well(self) -> bool:
        """Whether the cycle is shown to fit, on a safe bus, within [limits], and the circle can be run."""
        figures = self.deciding
        return figures.verdict == FITS and figures.safe and not figures.circle_refused_by and not self.missed_limits


def verdicts(capacity: Capacity) -> tuple[Verdict, ...]:
    """Judge each period of a capacity result, by the timing model that decides."""
    return tuple(_judge(*at) for at in zip(capacity.networks, capacity.periods, strict=True))


def _judge(network: Network, results: tuple[CapacityFigures, ...]) -> Verdict:
    profile = network.profile
    model = bus_of(profile).deciding_model
    deciding = next((result for result in results if result.timing_model == model), None) or capacity_figures(
        network, model=model
    )
    change, no_change = advice(profile, deciding)
    return Verdict(
        network=network,
        period_us=deciding.period_us,
        deciding=deciding,
        others=tuple(result for result in results if result is not deciding),
        missed_limits=missed_limits(profile),
        after_reset=after_reset(profile, deciding),
        change=change,
        no_change=no_change,
    )
