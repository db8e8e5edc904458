"""`busplan.capacity`: does the cycle fit its period, and how many axes does the bus carry?"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    Models,
    Periods,
    ProfileLike,
    checked_models,
    load_network,
    one_or_several,
    require_cycle,
    with_its_constants,
)
from busplan.questions.capacity.verdict import Verdict, verdicts_of
from busplan.questions.fit.certainty import FITS, VerdictWord
from busplan.questions.fit.figures import CapacityFigures, FitFigures, capacity_figures
from busplan.questions.fit.grid import GridPoint
from busplan.questions.fit.network import PERIOD, at_periods, model_names
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.questions.capacity.sensitivity import Sensitivity


@dataclass(frozen=True, slots=True, repr=False)
class CapacityAnswer(Answer):
    """Answer of `capacity`.

    Parameters
    ----------
    profile
        The profile.
    periods
        Figures of each period, one set for each timing model: `CapacityFigures` of a cycle.
    verdicts
        One verdict for each period.
    sensitivities
        Effects of small changes on the margin, one for each period; empty if it was not asked for.
    """

    profile: Profile
    periods: tuple[tuple[FitFigures, ...], ...]
    verdicts: tuple[Verdict, ...]
    sensitivities: "tuple[Sensitivity, ...]" = ()

    @property
    def verdict(self) -> VerdictWord:
        """The verdict on the only period, by the timing model that decides."""
        return cast("VerdictWord", self._figures.verdict)

    @property
    def fits(self) -> bool:
        """Whether the cycle is shown to fit the only period: `verdict` is "fits"."""
        return self.verdict == FITS

    @property
    def margin_us(self) -> float:
        """Free time in the slice of the only period less the bias: `margin_corrected_us` of the deciding model [us].

        BusplanError for messages alone, which have no cycle.
        """
        return cast("float", CapacityFigures.of(self._figures).margin_corrected_us)

    @property
    def _figures(self) -> FitFigures:
        if len(self.verdicts) > 1:
            raise BusplanError(
                f"{len(self.verdicts)} periods have no single verdict: each has its own, "
                "as verdicts[0].deciding.verdict"
            )
        return self.verdicts[0].figures

    @property
    def figures(self) -> tuple[FitFigures, ...]:
        """All sets of figures, period by period, and in each period timing model by timing model."""
        return tuple(figures for at_period in self.periods for figures in at_period)

    @property
    def results(self) -> tuple[CapacityFigures, ...]:
        """The `figures`, those of a cycle; BusplanError for messages alone, which have none."""
        return tuple(map(CapacityFigures.of, self.figures))

    def report(self) -> Report:
        """The answer in blocks."""
        if self.sensitivities:
            from busplan.questions.capacity.sensitivity_report import sensitivity_report

            return sensitivity_report(self)
        from busplan.questions.capacity.report import capacity_report

        return capacity_report(self)


@with_its_constants
def capacity(
    profile: ProfileLike,
    *,
    period_us: Periods | None = None,
    timing_model: Models | None = None,
    sensitivity: bool = False,
) -> CapacityAnswer:
    """Tell whether the cycle fits its period, by what margin, and how many axes the bus carries.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    period_us
        Communication period T_s [us], or n of them; by default the profile's own.
    timing_model
        Name of a timing model, or several in this order; by default all of the kind of bus. IEEE 1394 has "paper" for
        the paper's equations as published, and "standard" for the standard's clock and packets.
    sensitivity
        If True, `sensitivities` say by how much each small change of the network moves the margin, by the timing model
        that decides, and what binds next.

    Returns
    -------
    CapacityAnswer
        Its `results` have n entries for each timing model, its `verdicts` n, its `sensitivities` n or none. Times are
        in us, shares are 0..1.

    Raises
    ------
    BusplanError
        Not a profile, an invalid period, or an unknown timing model.

    References
    ----------
    Paper, equations (1), (2), (11).

    Examples
    --------
    >>> import busplan
    >>> busplan.capacity("paper-4ms").verdict
    'fits'
    >>> answer = busplan.capacity("paper-1ms", period_us=500)
    >>> [(figures.timing_model, figures.fits, figures.max_axes) for figures in answer.results]
    [('standard', False, 4), ('paper', True, 8)]
    >>> answer.verdicts[0].models_agree, answer.verdicts[0].deciding.verdict
    (False, 'does not fit')
    >>> (sensitivity,) = busplan.capacity("paper-1ms", sensitivity=True).sensitivities
    >>> [(effect.change, round(effect.margin_change_us, 1)) for effect in sensitivity.effects[:2]]
    [('one more node', -128.1), ('one more busy retry', -28.0)]
    >>> sensitivity.next_bottleneck.next_binding_term.name
    'idle'
    """
    network = load_network(profile)
    if sensitivity:
        require_cycle(network.profile, question="the effect of small changes on its margin")
    models = checked_models(timing_model, network) or model_names(network)
    networks = at_periods(network, None if period_us is None else one_or_several(period_us, name="period_us"))
    periods = tuple(tuple(capacity_figures(at, model=model) for model in models) for at in networks)
    verdicts = tuple(verdicts_of([GridPoint({PERIOD: at.period_us}, at) for at in networks], periods))
    if not sensitivity:
        return CapacityAnswer(network.profile, periods, verdicts)
    from busplan.questions.capacity.sensitivity import sensitivity_of

    sensitivities = tuple(sensitivity_of(at, of.deciding) for at, of in zip(networks, verdicts, strict=True))
    return CapacityAnswer(network.profile, periods, verdicts, sensitivities)
