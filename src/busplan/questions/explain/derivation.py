"""Derive a figure: every step to it, in symbols and in numbers, and all its inputs.

The functions that compute the figure are called with traced numbers (`busplan.questions.explain.trace`), so that the
steps are what was executed. A simulation or a search is one step.
"""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from busplan.buses.figure import BIAS, CERTAINTY, MARGIN_CORRECTED, UNCERTAINTY, Figure
from busplan.elementwise import Traced
from busplan.errors import BusplanError
from busplan.profile.toml import at_periods
from busplan.progress import Progress
from busplan.questions.explain.capacity import VERDICT_KEYS, capacity_figures, verdict_figure
from busplan.questions.explain.formulas import formula_text
from busplan.questions.explain.latency import TracedLatencies, latency_figures, latency_names, traced_latencies
from busplan.questions.explain.register import CommandName, figure_named, figures_of
from busplan.questions.explain.trace import inputs, lines
from busplan.questions.fit.inputs import choosing_keys
from busplan.questions.fit.network import bus_of, leading_model, model_names, network_of
from busplan.sections.profile import Profile
from busplan.sourced import Input

_GRADES: Final = ("assumed", "recalled", "calibrated", "derived", "measured", "published", "given")
"""From the weakest to the strongest; "given" values are choices, not knowledge."""


_BESIDE: Final = {MARGIN_CORRECTED.key: (UNCERTAINTY,)}
"""Figures that are derived beside another: a margin says nothing without its uncertainty."""


class Step(NamedTuple):
    """One line of a derivation.

    Parameters
    ----------
    key
        Key of the figure in the results; a name used only here if it is no figure.
    symbol
        Symbol in formulas.
    reference
        Numbers of its equations, or another source.
    formula
        The computation in symbols.
    numbers
        The computation in numbers.
    value
        The result: a number, a truth value, a word or a list; None if there is none.
    unit
        Unit of the result; empty for counts, shares and words.
    """

    key: str
    symbol: str
    reference: str
    formula: str
    numbers: str
    value: object
    unit: str


class Derivation(NamedTuple):
    """A figure and its steps."""

    command: CommandName
    figure: Figure
    timing_model: str
    transaction: str | None
    """Transaction of a figure of `latency`; None for others."""
    period_us: float
    value: object
    """Value as in the command's JSON."""
    steps: tuple[Step, ...]
    """In the order of computation; the last step is the figure, unless that is an input."""
    inputs: tuple[Input, ...]

    @property
    def weakest_grade(self) -> str:
        """Grade of the least well known input."""
        return min((one.grade for one in self.inputs), key=_GRADES.index, default=_GRADES[-1])


class Explanation(NamedTuple):
    """Answer of `explain`."""

    profile: Profile
    derivations: tuple[Derivation, ...]


def explain(
    profile: Profile,
    figure: str,
    *,
    periods_us: Sequence[float] | None = None,
    timing_models: Sequence[str] | None = None,
    transactions: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Explanation:
    """Derive a figure of `latency`, `capacity` or `circle-test`.

    Parameters
    ----------
    profile
        The network.
    figure
        Its key, with or without its command; see `figure_named`.
    periods_us
        Communication periods T_s [us]; by default the profile's own.
    timing_models
        Timing models; by default the one that leads. Figures of a circle test and of how sure the verdict is have the
        one that decides, and no other.
    transactions
        Transactions, for a figure of `latency`; by default all.
    progress
        As for `circle_test`.

    Returns
    -------
    Explanation
        One derivation for each period, transaction and model, nested in this order; behind that of the corrected margin
        stands that of its uncertainty.

    Raises
    ------
    BusplanError
        There is no such figure, an option does not apply to it, or the command fails.
    """
    command, one = figure_named(figure, bus=bus_of(profile))
    if (command, one) not in explained_figures(profile):
        raise BusplanError(f"{one.key}: no bias is known for this bus, {bus_of(profile).title}")
    deciding = bus_of(profile).deciding_model
    is_decided = command == "circle-test" or one in CERTAINTY
    of_one = is_decided or one.key in VERDICT_KEYS
    models = [deciding if of_one else leading_model(profile)] if timing_models is None else timing_models
    kinds: Sequence[str | None] = (transactions or latency_names(profile)) if command == "latency" else [None]
    if is_decided and list(models) != [deciding]:
        raise BusplanError(f"{one.key}: belongs to the timing model that decides and to no other, {deciding}")
    if one.key in VERDICT_KEYS and timing_models is not None:
        raise BusplanError(f"{one.key}: compares the timing models, so it has no timing model of its own")
    if command != "latency" and transactions is not None:
        raise BusplanError(f"{one.key}: not a figure of latency, so it has no transaction")
    found = []
    for where in at_periods(profile, periods_us):
        latencies = {model: traced_latencies(where, model=model) for model in models if command == "latency"}
        for kind in kinds:
            for model in models:
                for each in (one, *_BESIDE.get(one.key, ())):
                    known = latencies.get(model)
                    traced = _traced(
                        where, command, each.key, model=model, kind=kind, latencies=known, progress=progress
                    )
                    steps = tuple(_steps(where, traced, command, each))
                    found.append(
                        Derivation(
                            command,
                            each,
                            model,
                            kind,
                            where.cycle.period_us,
                            traced.value,
                            steps,
                            tuple(inputs(traced)),
                        )
                    )
    return Explanation(profile, tuple(found))


def explained_figures(profile: Profile) -> Iterator[tuple[CommandName, Figure]]:
    """Every figure that can be derived for a profile, with its command: no bias where nobody has measured one.

    Parameters
    ----------
    profile
        The network.
    """
    bus = bus_of(profile)
    has_bias = bus.cycle(network_of(profile), model=bus.deciding_model).bias_us() is not None
    for command, figures in figures_of(bus).items():
        yield from ((command, one) for one in figures.values() if has_bias or one != BIAS)


def assumptions(profile: Profile) -> tuple[Input, ...]:
    """What the figures of a profile rest on, each with its grade, the least well known first.

    Parameters
    ----------
    profile
        The network; inputs of its circle test are included if it asks for one.

    Returns
    -------
    tuple
        Inputs of the cycle under every timing model, and of the circle, without "given" ones. An execution time without
        a grade comes first.
    """
    found: dict[str, Input] = {}
    for model in model_names(profile):
        figures = capacity_figures(profile, model=model)
        for key in ("fits", "verdict"):
            for one in inputs(figures[key]) if key in figures else ():
                found.setdefault(one.name, one)
    if profile.asks_for_circle:
        from busplan.questions.explain.circle import simulated_inputs  # loads the simulation, and numpy with it

        for one in simulated_inputs(profile):
            found.setdefault(one.name, one)
    # An execution time is a fact, not a choice: without a grade it is the least well known input.
    choices = choosing_keys(bus_of(profile))
    executions = tuple(one.node_key("execution.") for one in profile.alike_nodes)
    known = (
        one
        for one in found.values()
        if one.grade != "given"
        or (one.name.startswith(executions) and not one.name.endswith(choices) and not one.source.startswith("default"))
    )
    return tuple(sorted(known, key=lambda one: -1 if one.grade == "given" else _GRADES.index(one.grade)))


def _traced(
    profile: Profile,
    command: CommandName,
    key: str,
    *,
    model: str,
    kind: str | None,
    latencies: TracedLatencies | None,
    progress: Progress | None,
) -> Traced:
    if command == "latency":
        return latency_figures(profile, model=model, kind=kind or "", latencies=latencies)[key]
    if command == "capacity":
        if key in VERDICT_KEYS:
            return verdict_figure(profile, key, model=model)
        return capacity_figures(profile, model=model)[key]
    from busplan.questions.explain.circle import circle_figures  # as above

    return circle_figures(profile, with_contributions=key == "contributions", progress=progress)[key]


def _steps(profile: Profile, traced: Traced, command: CommandName, figure: Figure) -> Iterator[Step]:
    for one in lines(traced):
        known = figure if one is traced else _known(profile, one.key, command)
        yield Step(
            key=known.key,
            symbol=figure.symbol if one is traced else one.symbol,
            reference=known.reference,
            formula=formula_text(one, in_numbers=False),
            numbers=formula_text(one, in_numbers=True),
            value=one.value,
            unit=known.unit,
        )


def _known(profile: Profile, key: str, command: CommandName) -> Figure:
    """Registered figure of a line; a line without one gets a figure of its own."""
    register = figures_of(bus_of(profile))
    for figures in (register[command], *register.values()):
        if key in figures:
            return figures[key]
    return Figure(key, key, "", "")
