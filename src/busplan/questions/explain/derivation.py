"""Derive a figure: every step to it, in symbols and in numbers, and all its inputs."""

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from math import isfinite
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

from busplan.buses.bus import Bus
from busplan.buses.figure import BIAS, CERTAINTY, MARGIN_CORRECTED, UNCERTAINTY, VERDICT_FIGURES, Figure, by_key
from busplan.elementwise import Traced
from busplan.errors import BusplanError
from busplan.profile.toml import at_periods
from busplan.progress import Progress
from busplan.questions.circle.figures import CIRCLE_BY_KEY
from busplan.questions.explain.bus import (
    VERDICT_KEYS,
    TracedLatencies,
    capacity_figures,
    latency_figures,
    latency_names,
    traced_latencies,
    verdict_figure,
)
from busplan.questions.explain.formulas import formula_text, inputs, lines
from busplan.questions.fit.inputs import choosing_keys
from busplan.questions.fit.network import bus_of, leading_model, model_names, network_of
from busplan.sections.profile import Profile
from busplan.sourced import Input

CommandName = Literal["latency", "capacity", "circle-test"]

_HOLDERS: Final[Mapping[str, tuple[CommandName, str]]] = MappingProxyType(
    {
        **dict.fromkeys(("changes", "circle_is_untested"), ("capacity", "cheapest_change")),
        **dict.fromkeys(("change", "key", "from", "to", "margin_change_us", "note"), ("capacity", "sensitivity")),
        **dict.fromkeys(
            (
                *("binding_term_us", "next_binding_term", "next_binding_term_us", "next_margin_corrected_us"),
                *("next_safe_nodes", "next_safe_limited_by"),
            ),
            ("capacity", "next_bottleneck"),
        ),
        **dict.fromkeys(("input", "label", "standard_uncertainty_us", "share"), ("capacity", "uncertainty_parts")),
        **dict.fromkeys(("name", "value", "limit", "limit_is_default"), ("circle-test", "failures")),
        **dict.fromkeys(("source", "removed_mm"), ("circle-test", "contributions")),
    }
)
"""Figure that contains a key, for keys inside a figure."""


def figures_of(bus: Bus) -> dict[CommandName, dict[str, Figure]]:
    """Figures by command and key. Without a command, a key means that of the first command that has it."""
    return {
        "capacity": by_key((*bus.figures.capacity, *VERDICT_FIGURES)),
        "latency": by_key(bus.figures.latency),
        "circle-test": dict(CIRCLE_BY_KEY),
    }


def figure_named(name: str, *, bus: Bus) -> tuple[CommandName, Figure]:
    """Find a figure by its name.

    Parameters
    ----------
    name
        A key ("required_us"), or a command and a key ("circle-test.required_us"). A key inside a figure ("removed_mm")
        means that figure.
    bus
        The kind of bus.

    Raises
    ------
    BusplanError
        There is none; the message suggests similar names.

    Examples
    --------
    >>> from busplan.buses import kind_named
    >>> figure_named("latency.gaps_us", bus=kind_named("ieee1394"))[1].meaning
    'both gaps, after each transaction'
    """
    register = figures_of(bus)
    for command, figures in register.items():
        key = name.removeprefix(f"{command}.")
        if key in figures and name in (key, f"{command}.{key}"):
            return command, figures[key]
    before, _, inner = name.rpartition(".")
    held = _HOLDERS.get(inner)
    if held is not None and before in ("", held[0]):
        return held[0], register[held[0]][held[1]]
    known = [key for figures in register.values() for key in figures]
    close = get_close_matches(name.rpartition(".")[2], known, n=3, cutoff=0.5)
    hint = f", did you mean {' or '.join(dict.fromkeys(close))}" if close else ""
    raise BusplanError(f"{name or repr(name)}: no such figure{hint}? Without a figure, explain lists them all")


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
    period_us: float | None
    """None of a network without a cycle."""
    value: object
    """Value as in the command's JSON."""
    steps: tuple[Step, ...]
    """In the order of computation; the last step is the figure, unless that is an input."""
    inputs: tuple[Input, ...]

    @property
    def weakest_grade(self) -> str:
        """Grade of the least well known input."""
        return min((given.grade for given in self.inputs), key=_GRADES.index, default=_GRADES[-1])


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
        One derivation for each period, transaction and model, nested in this order; after that of the corrected margin
        stands that of its uncertainty.

    Raises
    ------
    BusplanError
        There is no such figure, an option does not apply to it, or the command fails.
    """
    command, asked = figure_named(figure, bus=bus_of(profile))
    if (command, asked) not in explained_figures(profile):
        why = f"no bias is known for this bus, {bus_of(profile).title}" if asked == BIAS else "messages have no circle"
        raise BusplanError(f"{asked.key}: {why}")
    deciding = bus_of(profile).deciding_model
    is_decided = command == "circle-test" or asked in CERTAINTY
    has_one_model = is_decided or asked.key in VERDICT_KEYS
    models = [deciding if has_one_model else leading_model(profile)] if timing_models is None else timing_models
    kinds: Sequence[str | None] = (transactions or latency_names(profile)) if command == "latency" else [None]
    if is_decided and list(models) != [deciding]:
        raise BusplanError(f"{asked.key}: belongs to the timing model that decides and to no other, {deciding}")
    if asked.key in VERDICT_KEYS and timing_models is not None:
        raise BusplanError(f"{asked.key}: compares the timing models, so it has no timing model of its own")
    if command != "latency" and transactions is not None:
        raise BusplanError(f"{asked.key}: not a figure of latency, so it has no transaction")
    derivations = []
    for where in at_periods(profile, periods_us):
        latencies = {model: traced_latencies(where, model=model) for model in models if command == "latency"}
        for kind in kinds:
            for model in models:
                for shown in (asked, *_BESIDE.get(asked.key, ())):
                    known = latencies.get(model)
                    traced = _traced(
                        where, command, shown.key, model=model, kind=kind, latencies=known, progress=progress
                    )
                    steps = tuple(_steps(where, traced, command, shown))
                    derivations.append(
                        Derivation(
                            command,
                            shown,
                            model,
                            kind,
                            where.cycle.period_us if where.has_cycle else None,
                            traced.value,
                            steps,
                            tuple(inputs(traced)),
                        )
                    )
    return Explanation(profile, tuple(derivations))


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
        if command != "circle-test" or profile.has_cycle:
            yield from ((command, figure) for figure in figures.values() if has_bias or figure != BIAS)


def assumptions(profile: Profile) -> tuple[Input, ...]:
    """Inputs that the figures of a profile rest on, each with its grade, the least well known first.

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
    by_name: dict[str, Input] = {}
    for model in model_names(profile):
        figures = capacity_figures(profile, model=model)
        for key in ("fits", "verdict"):
            for input_ in inputs(figures[key]) if key in figures else ():
                by_name.setdefault(input_.name, input_)
    if profile.asks_for_circle:
        from busplan.questions.explain.circle import simulated_inputs  # loads the simulation, and numpy with it

        for input_ in simulated_inputs(profile):
            by_name.setdefault(input_.name, input_)
    # An execution time is a fact, not a choice: without a grade it is the least well known input.
    choices = choosing_keys(bus_of(profile))
    executions = tuple(alike.node_key("execution.") for alike in profile.alike_nodes)
    known = (
        given
        for given in by_name.values()
        if given.grade != "given"
        or (
            given.name.startswith(executions)
            and not given.name.endswith(choices)
            and not given.source.startswith("default")
        )
    )
    return tuple(sorted(known, key=lambda input_: -1 if input_.grade == "given" else _GRADES.index(input_.grade)))


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
    for line in lines(traced):
        known = figure if line is traced else _known(profile, line.key, command)
        yield Step(
            key=known.key,
            symbol=figure.symbol if line is traced else line.symbol,
            reference=known.reference,
            formula=formula_text(line, in_numbers=False),
            numbers=formula_text(line, in_numbers=True),
            # What is infinite does not exist.
            value=None if isinstance(line.value, float) and not isfinite(line.value) else line.value,
            unit=known.unit,
        )


def _known(profile: Profile, key: str, command: CommandName) -> Figure:
    """Registered figure of a line; a line without one gets a figure of its own."""
    register = figures_of(bus_of(profile))
    for figures in (register[command], *register.values()):
        if key in figures:
            return figures[key]
    return Figure(key, key, "", "")
