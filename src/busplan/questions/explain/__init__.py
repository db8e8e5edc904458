"""`busplan.explain`."""

from collections.abc import Iterable
from dataclasses import dataclass

from busplan.buses import kind_named, kind_names
from busplan.buses.figure import Figure
from busplan.english import listed, plural
from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import Record, Report
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    Models,
    Periods,
    ProfileLike,
    checked_models,
    load_network,
    one_or_several,
    with_its_constants,
)
from busplan.questions.explain.derivation import (
    CommandName,
    Derivation,
    assumptions,
    constant_rows,
    derive,
    equation_rows,
    explained_figures,
    figures_of,
    latency_names,
)
from busplan.questions.fit.figures import COUNTS
from busplan.questions.fit.network import at_periods
from busplan.sections.profile import Profile
from busplan.sourced import Input


@dataclass(frozen=True, repr=False)
class ExplainAnswer(Answer):
    """Answer of `explain`."""

    profile: Profile
    derivations: tuple[Derivation, ...] = ()
    """The figure for each period, transaction and timing model, with `value`, `steps` and `inputs`; empty without a
    figure.
    """
    assumptions: tuple[Input, ...] = ()
    """Without a figure, the inputs on which the verdict rests, the least well known first; empty with one."""
    figures: tuple[tuple[CommandName, Figure], ...] = ()
    """Without a figure, each figure that can be explained, with its command; empty with one."""
    equations: tuple[Record, ...] = ()
    """Without a figure, one row for each equation: numbers, formula, function and source; empty with one."""
    constants: tuple[Record, ...] = ()
    """Without a figure, one row for each constant of the kind of bus: value, unit, grade and source; empty with one."""

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.explain.report import assumptions_report, explain_report

        if self.derivations:
            return explain_report(self.profile.name, self.derivations)
        return assumptions_report(self)

    def _headline(self) -> str:
        if self.derivations:
            return super()._headline()
        return f"{self.profile.name}: {plural(len(self.assumptions), 'assumption')} behind its verdict"


@with_its_constants
def explain(
    profile: ProfileLike,
    figure: str | None = None,
    *,
    period_us: Periods | None = None,
    timing_model: Models | None = None,
    transaction: str | Iterable[str] | None = None,
) -> ExplainAnswer:
    """Show where a figure of the bus comes from: every step in symbols and in numbers, and what it starts from.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    figure
        A key in the JSON of capacity or latency that an equation leads to: "required_us"; "latency.gaps_us" if both
        have it and the first is not meant. Or the number of an equation, "(11)"; a label of a table, "arbitration";
        the name of a transaction, a message or a group of nodes, for its latency. Without it, the answer has the
        inputs on which the verdict rests, and all these figures.
    period_us
        Communication period T_s [us], or several; by default the profile's own.
    timing_model
        Name of a timing model, or several; by default the one that leads, for bias and uncertainty
        the one that decides.
    transaction
        Name of a transaction, such as "read", or several, for a figure of `latency`; by default all.

    Returns
    -------
    ExplainAnswer
        One derivation for each period, transaction and timing model. Each step has the unit of its value.

    Raises
    ------
    BusplanError
        Not a profile, no such figure, one without an equation, or an argument that the figure does not have.

    Examples
    --------
    >>> import busplan
    >>> (explanation,) = busplan.explain("paper-4ms", "required_us").derivations
    >>> explanation.steps[-1].formula
    'J + CTS + arbitration + data + acknowledge + execution + worst extra + idle + host + retries + T_npd'
    >>> round(explanation.value, 3), explanation.weakest_grade
    (263.32, 'recalled')
    >>> busplan.explain("paper-4ms").assumptions[0].grade
    'assumed'
    """
    network = load_network(profile)
    if figure is None:
        given = {"period_us": period_us, "timing_model": timing_model, "transaction": transaction}
        names = [name for name, value in given.items() if value is not None]
        if names:
            raise BusplanError(f"{listed(names, 'and')}: needs a figure, as in busplan explain PROFILE required_us")
        return ExplainAnswer(
            network.profile,
            assumptions=assumptions(network),
            figures=tuple(explained_figures(network)),
            equations=tuple(equation_rows(network.bus)),
            constants=tuple(constant_rows(network.bus)),
        )
    if not isinstance(figure, str):
        raise BusplanError(f'figure {figure!r}: expected a key of the JSON, as "required_us"')
    transactions: list[str] | None = None if transaction is None else one_or_several(transaction, name="transaction")
    labels = latency_names(network)
    for name in transactions or ():
        if name not in labels:
            raise ArgumentError(f"transaction {name!r}: expected {listed([*map(repr, labels)], 'or')}")
    derivations = derive(
        at_periods(network, None if period_us is None else one_or_several(period_us, name="period_us")),
        figure,
        timing_models=None if timing_model is None else checked_models(timing_model, network),
        transactions=transactions,
    )
    return ExplainAnswer(network.profile, derivations)


def figure_names() -> list[str]:
    """Keys of figures that `explain` takes, on all kinds of bus. No single kind has all of them."""
    registers = (figures for kind in kind_names() for figures in figures_of(kind_named(kind)).values())
    figures = (figure for register in registers for figure in register.values())
    return list(
        dict.fromkeys(
            figure.key for figure in figures if figure.sort in ("number", "count") and figure.key not in COUNTS
        )
    )
