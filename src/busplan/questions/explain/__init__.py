"""`busplan.explain`."""

from collections.abc import Iterable
from dataclasses import dataclass

from busplan.buses import kind_named, kind_names
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.numbers import plural
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Models, Periods, ProfileLike, checked_models, load_profile, one_or_several
from busplan.questions.explain import derivation as analysis
from busplan.questions.explain.bus import latency_names
from busplan.questions.explain.derivation import Derivation, Explanation, figures_of
from busplan.sections.profile import Profile
from busplan.sourced import Input


@dataclass(frozen=True, slots=True, repr=False)
class ExplainAnswer(Answer):
    """Answer of `explain`.

    Parameters
    ----------
    profile
        The network.
    derivations
        The figure under each period, transaction and timing model, with its `value`, `steps` and `inputs`; empty
        without a figure.
    assumptions
        Without a figure, what all figures rest on, the least well known first; empty with one.
    """

    profile: Profile
    derivations: tuple[Derivation, ...]
    assumptions: tuple[Input, ...]

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.explain.report import assumptions_report, explain_report

        if self.derivations:
            return explain_report(Explanation(self.profile, self.derivations))
        return assumptions_report(self.profile, self.assumptions)

    def _headline(self) -> str:
        if self.derivations:
            return Answer._headline(self)  # noqa: SLF001 - super() knows no class with slots made anew
        return f"{self.profile.name}: {plural(len(self.assumptions), 'assumption')} behind its figures"


def explain(
    profile: ProfileLike,
    figure: str | None = None,
    *,
    period_us: Periods | None = None,
    timing_model: Models | None = None,
    transaction: str | Iterable[str] | None = None,
    progress: Progress | None = None,
) -> ExplainAnswer:
    """Show where a figure comes from: every step in symbols and in numbers, and what it starts from.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    figure
        A key of the JSON of latency, capacity or circle-test: "required_us"; "circle-test.required_us" where several
        have it and the first is not meant. Without it, what all figures rest on.
    period_us
        Communication period T_s [us], or several; by default the profile's own.
    timing_model
        Name of a timing model, or several; by default the one that leads. A circle test and a verdict have only the
        one that decides.
    transaction
        Name of a transaction, such as "read", or several, for a figure of `latency`; by default all.
    progress
        Called from time to time with the steps simulated and the steps known to be needed.

    Returns
    -------
    ExplainAnswer
        One derivation for each period, transaction and timing model. Each step has the unit of its value.

    Raises
    ------
    BusplanError
        Not a profile, no such figure, or an argument that the figure does not have.

    Examples
    --------
    >>> import busplan
    >>> (explanation,) = busplan.explain("paper-4ms", "required_us").derivations
    >>> explanation.steps[-1].formula
    'CTS + arbitration + data + acknowledge + execution + worst extra + idle + T_npd'
    >>> round(explanation.value, 3), explanation.weakest_grade
    (207.117, 'recalled')
    >>> busplan.explain("paper-4ms").assumptions[0].grade
    'assumed'
    """
    network = load_profile(profile)
    if figure is None:
        given = {"period_us": period_us, "timing_model": timing_model, "transaction": transaction}
        for name, value in given.items():
            if value is not None:
                raise BusplanError(f'{name} {value!r}: goes with a figure, as busplan.explain(profile, "required_us")')
        return ExplainAnswer(network, (), analysis.assumptions(network))
    if not isinstance(figure, str):
        raise BusplanError(f'figure {figure!r}: expected a key of the JSON, as "required_us"')
    explanation = analysis.explain(
        network,
        figure,
        periods_us=None if period_us is None else one_or_several(period_us, name="period_us"),
        timing_models=None if timing_model is None else checked_models(timing_model, network),
        transactions=None if transaction is None else _transactions(transaction, network),
        progress=progress,
    )
    return ExplainAnswer(network, explanation.derivations, ())


def figure_names() -> list[str]:
    """Names of the figures that `explain` takes, on all kinds of bus: each key, alone and after its command."""
    registers = (figures_of(kind_named(kind)) for kind in kind_names())
    names = (
        name
        for register in registers
        for command, figures in register.items()
        for key in figures
        for name in (key, f"{command}.{key}")
    )
    return list(dict.fromkeys(names))


def _transactions(transaction: str | Iterable[str], profile: Profile) -> list[str]:
    asked: list[str] = one_or_several(transaction, name="transaction")
    known = latency_names(profile)
    for name in asked:
        if name not in known:
            raise BusplanError(f"transaction {name!r}: expected {' or '.join(map(repr, known))}")
    return asked
